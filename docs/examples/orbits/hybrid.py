"""A hybrid automaton in its two discrete states

A pendulum with friction that a relay with hysteresis pushes: to the left ($q = 1$) once it is beyond $x = 0.5$, to the
right ($q = -1$) once it is beyond $x = -0.5$. Each panel is the phase portrait of one discrete state, which is that of
a system without resets; the limit cycle passes from one panel to the other at the thresholds.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

x, v, q = (ca.SX.sym(name) for name in ("x", "v", "q"))
left = ns.Reset(x - 0.5, {q: 1}, 1, level=True, when=q == -1, name="left")
right = ns.Reset(x + 0.5, {q: -1}, -1, level=True, when=q == 1, name="right")
pendulum = ns.FilippovSystem(
    [x, v],
    surface=v,
    above=[v, -x - 0.2 * v - 0.3 - q],
    below=[v, -x - 0.2 * v + 0.3 - q],
    discrete={q: (-1, 1)},
    resets=[left, right],
)
orbit = ns.periodic_orbit(pendulum, ns.simulate(pendulum, [0.0, 1.0, 1], 80.0))

figure = ns.plot.style.new_figure((7.0, 4.2))
for ax, value in zip(figure.subplots(1, 2, sharey=True), (-1, 1), strict=True):
    held = pendulum.holding({q: value})
    ns.plot.phase_portrait(
        held, (-3, 3, -2.5, 2.5), ax=ax, legend=False, labels=False, title=f"q = {value}"
    )
    run = orbit.trajectory
    for segment in run.segments:
        if segment.discrete == (value,):
            part = run(np.linspace(segment.t_start, segment.t_end, 200))
            ax.plot(*part.T[:2], color=ns.plot.style.ORANGE, linewidth=2.4, zorder=8)
    ax.axvline(-0.5 * value, color=ns.plot.style.BLACK, linewidth=0.8, linestyle=":")

if __name__ == "__main__":
    print(orbit)
    figure.savefig("hybrid.png", dpi=110)
