"""Forced dry friction: Den Hartog's amplitudes and Shaw's sticking

An oscillator with Coulomb friction under a sinusoidal drive. Den Hartog (1931) found its symmetric motion
without a stop in closed form (dots); with more friction, or slower, it stops twice a period, first at the
triangles. Left: the largest displacement, continued in the frequency through its resonance and through the
first stop. Right: where it stops for the first time, in the plane of frequency and friction, beside the
closed form.
"""

import numpy as np

import nonsmooth as ns

system = ns.textbook.forced_dry_friction().system
shares = (0.2, 0.6, 0.75)
families = []
for friction in shares:
    for W, bounds in ((0.7, (0.5, 0.97)), (1.3, (1.02, 1.8))):  # the resonance has no bound
        at = {"f": friction, "W": W}
        run = ns.simulate(system, [1.5, 0.0], 260.0, parameters=at)
        orbit = ns.periodic_orbit(system, run, symmetry="odd", parameters=at)
        families.append(ns.continue_orbit(orbit, "W", bounds=bounds, step=0.03))
events = [event for family in families for event in family.events]
plane = [(0.55, 1.8), (0.05, 1.0)]
curves = [
    ns.continue_bifurcation(event, ("W", "f"), bounds=plane)
    for event in (events[0], events[-1])
    if event.kind == "crossing-sliding"
]


def response(W):
    """Den Hartog's V = 1/(1 - W^2) and U = sin(pi/W)/(W (1 + cos(pi/W)))."""
    return 1 / (1 - W**2), np.sin(np.pi / W) / (W * (1 + np.cos(np.pi / W)))


def amplitude(W, friction):
    """The largest displacement of the motion without a stop."""
    V, U = response(W)
    return np.sqrt(V**2 - (friction * U) ** 2)


def first_stop(W):
    """The friction at which the acceleration at a turn is zero."""
    V, U = response(W)
    c = (V - 1) / V * U
    return np.abs(V - 1) / np.sqrt(1 + c**2)


def largest(orbit):
    """The largest displacement."""
    return float(np.abs([leg.start[0] for leg in orbit.legs]).max())


figure = ns.plot.style.new_figure((6.6, 4.2))
left, right = figure.subplots(1, 2)
for family in families:
    ns.plot.branch(family, against=largest, ax=left, legend=False)
for friction, W, height in ((0.2, 1.3, 1.65), (0.6, 1.5, 1.2), (0.75, 0.55, 0.95)):
    grid = np.concatenate([np.arange(0.5, 0.95, 0.03), np.arange(1.06, 1.8, 0.06)])
    grid = grid[friction < first_stop(grid)]
    left.plot(grid, amplitude(grid, friction), "o", markersize=2.4, color="black", zorder=4)
    left.text(W, height, f"f = {friction:g}")
left.plot([1.305, 1.49], [0.79, 1.2], color="0.4", linewidth=0.6)
left.set(
    xlim=(0.5, 1.8), ylim=(0.0, 4.0), xlabel="frequency W", ylabel="largest x", title="response"
)
ns.plot.bifurcation_curves(curves, ax=right, legend=False)
grid = np.concatenate([np.arange(0.56, 0.96, 0.04), np.arange(1.04, 1.8, 0.05)])
right.plot(grid, first_stop(grid), "o", markersize=2.4, color="black", zorder=4)
right.set(xlabel="frequency W", ylabel="friction f", title="the first stop")
right.set(xlim=(0.55, 1.8), ylim=(0.3, 0.95))
right.text(1.2, 0.45, "never stops", ha="center")
right.text(1.4, 0.8, "stops twice a period", ha="center")

if __name__ == "__main__":
    for curve in curves:
        W, friction = curve.values.T
        print(curve.kind, np.abs(friction - first_stop(W)).max())
    figure.savefig("friction_drive.png", dpi=110)
