"""A buck converter, its period doublings and the chaos beyond

The voltage of a converter that is switched by a ramp, at each tick of its clock, as the input voltage
grows. Branches of one, two and four ticks are continued and switched at their doublings; broken where they
are unstable. Squares: the doublings. Dots: long runs, beyond their transients. The wide attractor begins
all at once at about 32.3 V.
"""

import numpy as np

import nonsmooth as ns

buck = ns.textbook.buck_converter()
system = buck.system
orbit = ns.periodic_orbit(system, buck.run(tol=1e-12))
branches = [ns.continue_orbit(orbit, "E", bounds=(22.0, 33.5))]
for _ in range(2):
    doubling = next(e for e in branches[-1].events if e.kind == "period doubling")
    branches.append(ns.continue_orbit(doubling, "E", bounds=(22.0, 33.5)))
doublings = [e.parameter for b in branches for e in b.events if e.kind == "period doubling"]


def tick(k):
    """The voltage of an orbit at its k-th tick of the clock."""

    def volts(orbit):
        legs = orbit.legs
        after = [legs[(i + 1) % len(legs)] for i, leg in enumerate(legs) if leg.event == "clock"]
        return float(after[k % len(after)].start[0])

    return volts


figure = ns.plot.style.new_figure((6.6, 4.4))
ax = figure.subplots()
for E in [*np.linspace(22.0, 32.0, 41), *np.linspace(32.02, 33.5, 75)]:
    long = ns.simulate(
        system, buck.start, 0.13, parameters={"E": E}, at=ns.Section("clock", skip=240)
    )
    ax.plot(np.full(len(long.sample_x), E), long.sample_x[:, 0], **ns.plot.style.CLOUD)
for rounds, branch in zip((1, 2, 4), branches, strict=True):
    for k in range(rounds):
        ns.plot.branch(branch, against=tick(k), ax=ax)
ax.set_xlabel("input voltage E in V")
ax.set_ylabel("v at the ticks of the clock, in V")
ax.set_xlim(22.0, 33.5)
ax.text(24.4, 12.06, "period doubling", ha="right")
ax.text(32.35, 12.55, "chaos", ha="right")
ax.set_title("Buck converter: doublings and chaos")

if __name__ == "__main__":
    print(doublings)
    figure.savefig("buck.png", dpi=110, bbox_inches="tight")
