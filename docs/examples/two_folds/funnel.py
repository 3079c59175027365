"""Forward-reachable set of a two-fold

Along the canard of a visible two-fold (class VV-C1) sliding leads through the singularity into
repelling sliding, where the motion may leave to either side at any time. A run stops at the
two-fold with `NON_UNIQUE`; a funnel samples the forward-reachable set instead.
"""

import numpy as np

import nonsmooth as ns

system = ns.textbook.two_fold("VV-C1").system
fold = ns.find_two_fold(system, near=[0.0, 0.0, 0.0])
slope = fold.classification.into.low  # z3/z2 on the canard
run = ns.simulate(system, [0.0, 0.5, 0.5 * slope], t_end=10.0)
funnel = ns.orbit.funnel(run, t_end=run.t[-1] + 1.0, samples=41)

figure = ns.plot.style.new_figure((7.0, 3.6))
height, plane = figure.subplots(1, 2)
STYLE = {
    "+": dict(color=ns.plot.style.ABOVE, linewidth=0.8),
    "-": dict(color=ns.plot.style.BELOW, linewidth=0.8, linestyle="--"),
    "s": dict(color="black", linewidth=2.0),
}
before = np.linspace(0.0, funnel.t, 100)
after = np.linspace(funnel.t, funnel.t + 1.0, 200)
height.plot(before, run(before)[:, 0], **STYLE["s"])
plane.plot(*run(before)[:, 1:].T, **STYLE["s"])
for k, (states, departure) in enumerate(zip(funnel(after), funnel.departures, strict=True)):
    height.plot(after, states[:, 0], **STYLE[departure.side])
    if k % 4 == 0:  # seen from above they are close to each other
        plane.plot(*states[:, 1:].T, **STYLE[departure.side])
for side, label in (("+", "leaves up"), ("-", "leaves down"), ("s", "slides")):
    height.plot([], [], label=label, **STYLE[side])
ns.plot.style.arrowhead(plane, run(before)[:, 1:], 0.5, "black", mutation_scale=16, zorder=4)
height.set(xlabel="$t$", ylabel="$z_1$", xlim=(0.0, funnel.t + 1.0), xticks=[0, 0.5, 1, 1.5])
height.legend(loc="upper left", frameon=False)
plane.plot(0.0, 0.0, "ko")
plane.annotate("two-fold", (0.0, 0.0), xytext=(8, -4), textcoords="offset points")
plane.set(xlabel="$z_2$", ylabel="$z_3$", xlim=(-1.0, 0.5), xticks=[-1, -0.5, 0, 0.5])

if __name__ == "__main__":
    print(run.status, run.message)
    print(funnel)
    figure.savefig("funnel.png")
