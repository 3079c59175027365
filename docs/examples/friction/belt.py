"""Chaos that is born where an orbit first touches sticking

A block on a belt, shaken. The orbit of four forcing periods that never sticks touches the velocity of the belt
at $nu = 1.7077997$, a grazing-sliding: the derivative of its return map jumps there from a stable one to one with
a multiplier $-1.66$, and chaos begins whose size grows in proportion to the distance. Lines: the orbit, continued
through the touch to where it doubles from one of two periods (Kowalczyk & di Bernardo 2005). Dots: long runs,
once every four forcing periods.
"""

import numpy as np

import nonsmooth as ns

belt = ns.textbook.belt_oscillator()
system = belt.system
orbit = ns.periodic_orbit(system, [2.19, -0.42], parameters={"nu": 1.7085})
branch = ns.continue_orbit(orbit, "nu", bounds=(1.7055, 1.7095))
touch = branch.events[0]


def strobe(nu, rounds, skip):
    """Displacements once every four forcing periods, from the orbit that touches."""
    span = 8 * np.pi / nu
    looks = ns.Section(span, skip=skip)
    run = ns.simulate(system, belt.start, span * (rounds + 0.5), parameters={"nu": nu}, at=looks)
    return run.sample_x[:, 0]


values = np.linspace(1.7055, 1.7085, 121)
clouds = [strobe(nu, 260, 100) for nu in values]


def start(orbit):
    """The displacement at t = 0."""
    run = orbit.trajectory
    return float(run(run.t[0] + (-run.t[0]) % (run.t[-1] - run.t[0]))[0])


figure = ns.plot.style.new_figure((6.6, 4.2))
ax = figure.subplots()
for nu, cloud in zip(values, clouds, strict=True):
    ax.plot(np.full(len(cloud), nu), cloud, **ns.plot.style.CLOUD)
ns.plot.branch(branch, against=start, ax=ax)
ax.set(xlabel="forcing frequency ν", ylabel="displacement u every four periods")
ax.set(xlim=(float(values[0]), float(branch.values.max())))
ax.annotate(
    "grazing-sliding", (touch.parameter, start(touch.orbit)), (8, 2), textcoords="offset points"
)
ax.text(1.7085, 2.182, "never sticks")
ax.text(1.7063, 2.185, "sticks once: chaos", ha="center")

if __name__ == "__main__":
    print(touch, dict(touch.coefficients))
    figure.savefig("belt.png", dpi=110)
