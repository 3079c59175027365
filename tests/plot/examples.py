"""Examples of every public drawing function, as functions of its options."""

import dataclasses
from functools import cached_property

import casadi as ca
import numpy as np
import pytest

import bounce
import nonsmooth as ns
from nonsmooth.orbit import Basins

x, v, mu = (ca.SX.sym(name) for name in ("x", "v", "mu"))
BLOCK = ns.FilippovSystem(
    [x, v],
    surface=v - 0.5,
    above=[v, -x - 1 + 0.2 * (v - 0.5)],
    below=[v, -x + 1 + 0.2 * (v - 0.5)],
)
TURF = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5, G=1e-4)


def run():
    return ns.simulate(BLOCK, [0.3, 0.4], 30)


def fold_branch():
    system = ns.FilippovSystem(
        [x, v], surface=v, above=[mu - x**2, 1 - v], below=[1, 1], parameters={mu: 0.5}
    )
    return ns.continue_equilibrium(system, [0.7, 1.0], "mu", bounds=(-1, 1))


def many_events():
    """A branch with an event of every kind that has a marker, at places of its own."""
    from nonsmooth.plot.branches import MARKERS

    branch = fold_branch()
    (event,) = branch.events
    chosen = np.linspace(1, len(branch.solutions) - 2, len(MARKERS)).astype(int)
    events = [
        dataclasses.replace(
            event, kind=kind, parameter=float(branch.values[k]), solution=branch.solutions[k]
        )
        for kind, k in zip(MARKERS, chosen, strict=True)
    ]
    return dataclasses.replace(branch, events=events)


def basins(count):
    """Basins of as many attractors, in columns."""
    axis = np.linspace(-3.0, 3.0, 42)
    labels = np.broadcast_to(1 + np.arange(42)[:, None] * count // 42, (42, 42)).astype(np.int32)
    starts = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    well = ns.FilippovSystem(
        [x, v], surface=x, above=[v, 1 - x - 0.3 * v], below=[v, -1 - x - 0.3 * v]
    )
    (one, *_) = ns.basins(well, {"x": [1.0, 2.0], "v": [0.0, 0.5]}, t_end=100.0).attractors
    return Basins(labels, [one] * count, starts, {"x": axis, "v": axis}, ("x", "v"))


def cut():
    """What divides starts at a height above a two-fold: arcs of both kinds, on either side."""
    y, z = ca.SX.sym("y"), ca.SX.sym("z")
    system = ns.FilippovSystem([x, y, z], surface=x, above=[y, 1, 0.5], below=[z, 0.3, -1])
    fold = ns.find_two_fold(system, near=[0, 0, 0])
    plane = lambda a, b: [a, b, 0.6 - 0.3 * b]
    box = [(-0.8, 0.83), (-2.1, 1.07)]
    return ns.manifold(system, fold, starts=plane, box=box, duration=6.0, spacing=0.1)


def bifurcations():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    system = ns.FilippovSystem(
        [x, v],
        surface=v,
        above=[a + b * x - x**3, 1 - v],
        below=[1, 1],
        parameters={a: -1.0, b: 0.75},
    )
    found = ns.continue_equilibrium(system, [-1.5, 1.0], "a", bounds=(-2, 2))
    cusp = ns.continue_bifurcation(found.events[0], ("a", "b"), bounds=[(-1, 1), (-1, 1)])
    kinds = [f"kind {k}" for k in range(8)]
    return [
        dataclasses.replace(cusp, kind=kind, values=cusp.values * (1 + 0.3 * k), special=[])
        for k, kind in enumerate(kinds)
    ]


def saddle_manifold():
    system = ns.FilippovSystem([x, v], surface=v, above=[x + v, -1], below=[x, 1])
    saddle = ns.find_pseudo_equilibrium(system, [0.1, 0.0])
    return ns.manifold(system, saddle, stable=True, length=1.0)


def proof():
    pytest.importorskip("flint")
    y, z = ca.SX.sym("y"), ca.SX.sym("z")
    above, below = [-y, 1, -mu], [z, -1, 1 + 0.1 * y]
    system = ns.FilippovSystem([x, y, z], surface=x, above=above, below=below, parameters={mu: 2})
    fold = ns.find_two_fold(system, near=[0.0, 0.1, -0.1])
    return ns.certify(fold, parameters={"mu": (0.5, 3)}, max_pieces=32)


def harvest():
    return ns.textbook.harvested_prey_predator().system


def relays():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    system = ns.FilippovSystem(
        [x, v], field=[-a + 2 * b, -2 * a - b], multipliers=[a, b], surfaces=[x, v]
    )
    return ns.simulate(system, [1.0, 0.5], t_end=0.7)


GRID = {"xdot": np.linspace(-0.6, 0.6, 31), "omega": np.linspace(-0.6, 0.6, 31)}


def residuals():
    law, u = bounce.laws.RigidBounce(mu=0.3, restitution=0.5), np.linspace(1, 2, 5)
    data = dict(
        xdot=u, ydot=-u, omega=0 * u, lift_off_ydot=0.5 * u + np.array([0.01, 0, -0.01, 0, 0])
    )
    return bounce.golf.fit(law, data, parameters=["restitution"], starts=0)


def pair(spins=(3, 2)):
    """A map of slip directions."""
    lateral, axial = np.linspace(0.3, 0.8, spins[0]), np.linspace(-0.25, 0.2, spins[1])
    return bounce.slip_map(TURF, [0.2, 0.0], (lateral, axial), tol=1e-6)


def orbit():
    return ns.periodic_orbit(BLOCK, run())


class Example:
    """A call of a drawing function: its arguments, computed once, and its own options."""

    def __init__(self, *makers, **options):
        self.makers, self.options = makers, options

    @cached_property
    def arguments(self):
        return [make() if callable(make) else make for make in self.makers]

    def draw(self, name, **options):
        module = ns.plot if hasattr(ns.plot, name) else bounce.plot
        return getattr(module, name)(*self.arguments, **self.options, **options)


FOLDS = ns.textbook.TWO_FOLDS
MIXED = ns.textbook.two_fold("mix-S").system
#: Examples of every drawing function; the first is drawn in every style.
EXAMPLES = {
    "basins": [Example(lambda: basins(2)), Example(lambda: basins(7))],
    "bifurcation_curves": [Example(bifurcations)],
    "branch": [Example(fold_branch), Example(many_events)],
    "dividing_curves": [Example(cut, names=["y", "z"])],
    "manifold": [Example(saddle_manifold, names=["x", "v"])],
    "multipliers": [Example(orbit)],
    "periodic_orbit": [Example(orbit)],
    "phase_portrait": [Example(harvest, (0.0, 1.1, 0.5, 1.5))],
    "proof_map": [Example(proof)],
    "sliding_portrait": [Example(MIXED, (-1, 1, -1, 1))],
    "trajectory": [Example(run), Example(relays)],
    "two_fold": [Example(FOLDS[k]) for k in ("II-C", "mix-F", "VV-C1")],
    "two_fold_3d": [Example(FOLDS[k]) for k in ("II-C", "mix-C")],
    "two_fold_atlas": [Example(["II-C", "mix-S"], maps=False)],
    "two_fold_atlas_pages": [Example(["VV-C1"])],
    "two_fold_map": [Example(k) for k in ("VV", "II", "VI", "IV")],
    "friction_cone": [Example(lambda: bounce.simulate(TURF, xdot=0.3, ydot=-1.0, omega=0.1))],
    "outcome_map": [Example(lambda: bounce.outcome_map(TURF, over=GRID, tol=1e-6))],
    "proven_map": [
        Example(lambda: bounce.maps.proven_map(TURF, xdot=(0.1, 0.11), omega=(1.0, 1.02), depth=1))
    ],
    "residuals": [Example(residuals)],
    "slip_map": [Example(pair)],
}
#: Public functions of the modules of pictures that draw nothing.
OTHERS = {
    "Canvas",
    "ExplorerPage",
    "canvas",
    "direction_colours",
    "offline_page",
    "two_fold_explorer",
}
