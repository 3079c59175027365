"""A walker from its gait to chaos

The simplest walking model on ever steeper slopes. Its two gaits, of long and of short steps, are born
together on level ground; the long one is stable until its steps begin to alternate, and then falls into
chaos by further doublings. Lines are continued, broken where they are unstable, with squares at the
doublings; dots are walks of a hundred steps, beyond their transients.
"""

import numpy as np

import nonsmooth as ns

walker = ns.textbook.simplest_walker()
system, strike = walker.system, [("", "heelstrike")]
long = ns.periodic_orbit(system, walker.start, itinerary=strike)
short_start = list(walker["short step"].at.values())
short = ns.periodic_orbit(system, short_start, itinerary=strike)
steep = 0.0192
gaits = [ns.continue_orbit(g, "gamma", bounds=(5e-4, steep)) for g in (short, long)]
for _ in range(3):
    doubling = next(e for e in gaits[-1].events if e.kind == "period doubling")
    gaits.append(ns.continue_orbit(doubling, "gamma", bounds=(5e-4, steep)))
doublings = [gait.events[0].parameter for gait in gaits[1:]]


def stance(k):
    """The stance angle after the k-th heelstrike of a gait."""

    def angle(orbit):
        return float(orbit.legs[k % len(orbit.legs)].start[0])

    return angle


slopes = np.linspace(0.0172, 0.0190, 109)
strikes = ns.Section("heelstrike", skip=120, count=100, after=True)
walks = []
orbit = gaits[1][float(slopes[0])]
near = orbit.trajectory(orbit.trajectory.t[0] + 1.0)  # in mid-step: a start at a strike strikes
for slope in slopes:
    walk = ns.simulate(system, near, 1500.0, parameters={"gamma": slope}, at=strikes)
    walks.append(walk.sample_x[:, 0])
    if len(walk.sample_x) == 100:
        near = walk(walk.t[-1] - 1.0)

figure = ns.plot.style.new_figure((6.6, 4.2))
whole, close = figure.subplots(1, 2)
for ax in (whole, close):
    for slope, angles in zip(slopes, walks, strict=True):
        ax.plot(np.full(len(angles), slope), angles, **ns.plot.style.CLOUD)
    for rounds, gait in zip((1, 1, 2, 4, 8), gaits, strict=True):
        for k in range(rounds):
            ns.plot.branch(gait, against=stance(k), events=ax is close, ax=ax)
    ax.set(xlabel="slope γ in radians", ylabel="stance angle after heelstrike")
whole.set_title("two gaits")
whole.text(0.0088, 0.21, "long steps", ha="right")
whole.text(0.0092, 0.183, "short steps")
close.set(title="the long one doubles", xlim=(0.0146, 0.0192), ylim=(0.2315, 0.2685))
close.text(0.01475, 0.2545, "steps\nalternate")
close.text(0.0191, 0.2325, "chaos", ha="right")

if __name__ == "__main__":
    print(doublings)
    figure.savefig("walker.png", dpi=110, bbox_inches="tight")
