"""Two wells and what divides them

A mass between two springs that pull it to $-1$ and to $1$, with the damping ratio $zeta$. Each start is labelled by the
point that its run comes back to; the two orbits that end at the two-fold on the hill, followed backward
through every crossing, are the boundary. Released at rest, the mass goes to the other well beyond
$x = 1 + exp(zeta pi/sqrt(1 - zeta^2))$.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

x, v, zeta = ca.SX.sym("x"), ca.SX.sym("v"), ca.SX.sym("zeta")
system = ns.FilippovSystem(
    states=[x, v],
    surface=x,
    above=[v, 1 - x - 2 * zeta * v],
    below=[v, -1 - x - 2 * zeta * v],
    parameters={zeta: 0.1},
)
grid = {"x": np.linspace(-4, 4, 160), "v": np.linspace(-3.5, 3.5, 140)}
found = ns.basins(system, grid, t_end=150.0, work=ns.Work(progress=False))
edge = ns.manifold(system, ns.local.fold_fold(system, [0.0, 0.0]), length=34.0, spacing=0.01)

outward = next(arc for arc in edge.arcs if arc.points[5, 0] > 0).points
turn = int(np.flatnonzero(outward[:-1, 1] * outward[1:, 1] < 0)[0])
near = outward[turn - 3 : turn + 5]
threshold = float(np.polyval(np.polyfit(near[:, 1], near[:, 0], 4), 0.0))

figure = ns.plot.basins(found, size=(6.6, 5.0))
ns.plot.manifold(edge, ax=figure.axes[0], legend=False)
names = ns.plot.labels.Labels(figure.axes[0])
names.name("two-fold", (0.0, 0.0))
names.name("the boundary:\nends at the two-fold", outward, ns.plot.style.BLUE)

if __name__ == "__main__":
    print(found, edge, f"first threshold {threshold:.9f}")
    figure.savefig("wells.png", bbox_inches="tight")
