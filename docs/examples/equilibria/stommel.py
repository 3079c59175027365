"""Two states of the ocean's circulation

Equilibria of Stommel's box model as the supply e of fresh water changes. The flow $T - S$ that is driven by
temperature ends in a smooth fold; the saddle that it meets there ends at $T = S$ in a nonsmooth fold, where the
field is continuous and its derivative jumps. Between the two folds there are two stable states.
"""

import numpy as np

import nonsmooth as ns

problem = ns.textbook.stommel_box()
start = ns.find_equilibrium(problem.system, [2.1, 1.6]).point
branch = ns.continue_equilibrium(problem.system, start, "e", bounds=(0.5, 1.5))
flows = np.array([at.point[0] - at.point[1] for at in branch.solutions])
stable = np.array([at.kind.startswith("stable") for at in branch.solutions])

figure = ns.plot.style.new_figure((6.2, 4.0))
ax = figure.subplots()
for shown, look in ((stable, "-"), (~stable, "--")):
    ax.plot(branch.values, np.where(shown, flows, np.nan), look, color=ns.plot.style.BLUE)
for event in branch.events:
    flow = event.solution.point[0] - event.solution.point[1]
    ax.plot(event.parameter, flow, "o", color=ns.plot.style.ORANGE, zorder=3)
    name, side = ("smooth fold", 8) if event.kind == "fold" else ("nonsmooth fold", -8)
    look = {"va": "center" if side > 0 else "bottom", "ha": "left" if side > 0 else "right"}
    ax.annotate(name, (event.parameter, flow), (side, 0), textcoords="offset points", **look)
ax.axhline(0.0, color=ns.plot.style.BLACK, linewidth=0.6)
ax.set(xlabel="supply of fresh water e", ylabel="flow T − S", xlim=(0.5, 1.5))

if __name__ == "__main__":
    print(branch)
    figure.savefig("stommel.png", dpi=110)
