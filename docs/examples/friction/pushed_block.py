"""How a pushed block moves: a diagram in two parameters

A block with dry and viscous friction, $v' = m + A cos t - v/2 - sgn v$, under a steady push m and a periodic one of
amplitude A. One curve of sliding bifurcations is followed from an event of a branch; the others leave it, one after
the other, at its points of codimension two (dots). Each region has one attractor, named by its itinerary: + forwards,
- backwards, s stuck.
"""

import casadi as ca
import numpy as np

import nonsmooth as ns

v, t, m, A = (ca.SX.sym(name) for name in ("v", "t", "m", "A"))
drive = m + A * ca.cos(t) - v / 2
system = ns.FilippovSystem(
    [v], surface=v, above=[drive - 1], below=[drive + 1], time=t, parameters={m: 0.3, A: 2.0}
)
names, plane = ("m", "A"), [(-3.0, 3.0), (0.05, 4.0)]
orbit = ns.periodic_orbit(system, ns.simulate(system, [0.0], 60.0))
events = ns.continue_orbit(orbit, "m", bounds=plane[0]).events
curves = [ns.continue_bifurcation(event, names, bounds=plane) for event in events]
points, waiting = [], [point for curve in curves for point in curve.special]
while waiting:
    point = waiting.pop(0)
    if any(np.abs(point.values - other.values).max() < 1e-6 for other in points):
        continue
    points.append(point)
    for curve in ns.continue_bifurcation(point, names, bounds=plane):
        curves.append(curve)
        waiting += curve.special


def attractor(push, amplitude):
    """The itinerary of one period of the motion at last, from a turn to s or to + on."""
    run = ns.simulate(system, [0.0], 80 * np.pi, parameters={"m": push, "A": amplitude})
    found = ns.periodic_orbit(system, run, parameters=run.parameters, multiplicity=1)
    modes = found.itinerary.split()
    return min(" ".join(modes[k:] + modes[:k]) for k in range(len(modes)))


figure = ns.plot.style.new_figure((6.2, 5.0))
ax = figure.subplots()
looks = {
    "grazing-sliding": (ns.plot.style.BLACK, "-"),
    "adding-sliding": (ns.plot.style.BLUE, "-"),
    "crossing-sliding": (ns.plot.style.ORANGE, "-"),
    "switching-sliding": (ns.plot.style.GREEN, "--"),
}
for kind, (color, dashes) in looks.items():
    label = kind
    for curve in curves:
        if curve.kind == kind:
            ax.plot(*curve.values.T, dashes, color=color, linewidth=1.8, label=label)
            label = None
ax.plot(
    *np.array([point.values for point in points]).T,
    "o",
    color=ns.plot.style.BLACK,
    ms=5.5,
    zorder=5,
)
positions = [(0.0, 0.4), (0.0, 1.6), (1.1, 1.0), (-1.1, 1.0), (2.4, 0.8), (-2.4, 0.8), (0.0, 3.2)]
positions += [(1.6, 3.3), (-1.6, 3.3)]
regions = {place: attractor(*place) for place in positions}
for (push, amplitude), itinerary in regions.items():
    ax.text(push, amplitude, itinerary, ha="center", va="center", fontsize=11, family="monospace")
ax.set(xlabel="steady push m", ylabel="amplitude A", xlim=plane[0], ylim=(0.0, 4.0))
ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.13), ncols=4, frameon=False, fontsize=8)

if __name__ == "__main__":
    for point in points:
        print(point)
    figure.savefig("pushed_block.png", dpi=110)
