"""Infinitely many impacts, and where they end

A force $F cos(t)$ lifts a mass off its stop once a period, at $cos(t) = 1/F$. The mass comes back with impacts that
accumulate (**chatter**) and rests until the next lift. This orbit forgets its past: it is
superstable. A stronger force leaves less time for the rest, and where the limit of the impacts meets the lift the
branch ends: end of complete chatter. Beyond it orbits have finitely many impacts. A second branch comes down to the
same value through grazings, each of which adds an impact; their distances from the end shrink like powers of the
restitution 0.6, as the last impacts do.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

x, v, t, F = (ca.SX.sym(name) for name in ("x", "v", "t", "F"))
system = ns.FilippovSystem(
    [x, v],
    field=[v, F * ca.cos(t) - 1 - x - 0.1 * v],
    impacts=ns.Impact(x, restitution=0.6, name="stop"),
    time=t,
    parameters={F: 1.5},
)
chatters = ns.periodic_orbit(system, ns.simulate(system, [0.0, 0.0], 100.0))
complete = ns.continue_orbit(chatters, "F", bounds=(1.05, 2.4))
end = complete.events[-1]
run = ns.simulate(system, [0.0, 0.0], 200.0, parameters={"F": 2.05})
returns = ns.periodic_orbit(system, run, parameters={"F": 2.05})
finite = ns.continue_orbit(returns, "F", bounds=(1.945, 2.4))
touches = np.array([e.parameter for e in finite.events if e.kind == "impact grazing"])


def impacts(orbit):
    """Times of the impacts of one period, from the time at which the force begins to lift the mass."""
    run, lift = orbit.trajectory, -np.arccos(1 / orbit.parameters["F"])
    times = np.array([event.t for event in run.events if event.kind == "impact"])
    return (times - lift - 0.5) % (2 * np.pi) + 0.5


figure = ns.plot.style.new_figure((7.0, 3.8))
left, right = figure.subplots(1, 2, width_ratios=(2, 1))
for branch, color in ((complete, ns.plot.style.BLUE), (finite, ns.plot.style.VERMILLION)):
    for F in np.linspace(branch.values.min(), branch.values.max(), 80)[1:-1]:
        times = impacts(branch[F])
        left.plot(np.full(len(times), F), times, ".", color=color, ms=2.6, mew=0)
left.axvline(end.parameter, color=ns.plot.style.GREY, linewidth=0.8)
left.text(end.parameter - 0.02, 0.8, "end of\ncomplete chatter", ha="right")
left.text(1.1, 5.4, "rest")
left.axhline(2 * np.pi, color=ns.plot.style.BLACK, linewidth=0.8)
left.text(1.1, 6.4, "next lift")
left.set(xlabel="force F", ylabel="time of impacts after a lift", ylim=(0.5, 6.8))
order = np.arange(len(touches))[::-1]
right.semilogy(order, touches - end.parameter, "o", color=ns.plot.style.VERMILLION)
right.semilogy(order, (touches[0] - end.parameter) * 0.6 ** (order - order[0]), "k--")
right.set(xlabel="number of the grazing", ylabel="distance from the end in F")

if __name__ == "__main__":
    print(complete, finite, end, touches, sep="\n")
    figure.savefig("chatter.png", dpi=110)
