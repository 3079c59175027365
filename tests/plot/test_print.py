"""Every picture is fit for print: at most as wide as a page, text of 8 points, none cut off or
overlapping, and no legend of more than six entries."""

import dataclasses
import io

import casadi as ca
import numpy as np
import pytest
from matplotlib.image import imread

import bounce
import nonsmooth as ns
from nonsmooth.orbit import Basins
from nonsmooth.plot.style import PrintFigure
from papers.pictures import faults

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


DRAWN = {
    "basins": [lambda: ns.plot.basins(basins(2)), lambda: ns.plot.basins(basins(7))],
    "bifurcation_curves": [lambda: ns.plot.bifurcation_curves(bifurcations())],
    "branch": [lambda: ns.plot.branch(fold_branch()), lambda: ns.plot.branch(many_events())],
    "dividing_curves": [lambda: ns.plot.dividing_curves(cut(), names=["y", "z"])],
    "manifold": [lambda: ns.plot.manifold(saddle_manifold(), names=["x", "v"])],
    "multipliers": [lambda: ns.plot.multipliers(ns.periodic_orbit(BLOCK, run()))],
    "periodic_orbit": [lambda: ns.plot.periodic_orbit(ns.periodic_orbit(BLOCK, run()))],
    "phase_portrait": [lambda: ns.plot.phase_portrait(harvest(), (0.0, 1.1, 0.5, 1.5))],
    "proof_map": [lambda: ns.plot.proof_map(proof())],
    "sliding_portrait": [
        lambda: ns.plot.sliding_portrait(ns.textbook.two_fold("mix-S").system, (-1, 1, -1, 1))
    ],
    "trajectory": [lambda: ns.plot.trajectory(run()), lambda: ns.plot.trajectory(relays())],
    "two_fold": [
        lambda k=k: ns.plot.two_fold(ns.textbook.TWO_FOLDS[k]) for k in ("II-C", "mix-F", "VV-C1")
    ],
    "two_fold_3d": [
        lambda k=k: ns.plot.two_fold_3d(ns.textbook.TWO_FOLDS[k]) for k in ("II-C", "mix-C")
    ],
    "two_fold_atlas": [lambda: ns.plot.two_fold_atlas(["II-C", "mix-S"], maps=False)],
    "two_fold_atlas_pages": [lambda: ns.plot.two_fold_atlas_pages(["VV-C1"])[-1]],
    "two_fold_map": [lambda k=k: ns.plot.two_fold_map(k) for k in ("VV", "II", "VI", "IV")],
}
GRID = {"xdot": np.linspace(-0.6, 0.6, 31), "omega": np.linspace(-0.6, 0.6, 31)}


def residuals():
    law, u = bounce.laws.RigidBounce(mu=0.3, restitution=0.5), np.linspace(1, 2, 5)
    data = dict(
        xdot=u, ydot=-u, omega=0 * u, lift_off_ydot=0.5 * u + np.array([0.01, 0, -0.01, 0, 0])
    )
    return bounce.golf.fit(law, data, parameters=["restitution"], starts=0)


BALLS = {
    "friction_cone": [
        lambda: bounce.plot.friction_cone(bounce.simulate(TURF, xdot=0.3, ydot=-1.0, omega=0.1))
    ],
    "outcome_map": [lambda: bounce.plot.outcome_map(bounce.outcome_map(TURF, over=GRID, tol=1e-6))],
    "proven_map": [
        lambda: bounce.plot.proven_map(
            bounce.maps.proven_map(TURF, xdot=(0.1, 0.11), omega=(1.0, 1.02), depth=1)
        )
    ],
    "residuals": [lambda: bounce.plot.residuals(residuals())],
    "slip_map": [
        lambda: bounce.plot.slip_map(
            bounce.slip_map(
                TURF, [0.2, 0.0], (np.linspace(0.3, 0.8, 3), np.linspace(-0.25, 0.2, 2)), tol=1e-6
            )
        )
    ],
}


def drawing(module):
    """Names of the functions of a module that return figures."""
    return {
        name
        for name in module.__all__
        if "Figure" in str(getattr(getattr(module, name), "__annotations__", {}).get("return", ""))
    }


def test_every_function_that_draws_is_here():
    assert set(DRAWN) == drawing(ns.plot)
    assert set(BALLS) == drawing(bounce.plot)


@pytest.mark.slow_cases(
    "bifurcation_curves",
    "branch1",
    "dividing_curves",
    "phase_portrait",
    "sliding_portrait",
    "two_fold0",
    "two_fold1",
    "two_fold2",
    "two_fold_3d0",
    "two_fold_3d1",
    "two_fold_atlas",
    "two_fold_atlas_pages",
    "outcome_map",
    "proven_map",
)
@pytest.mark.parametrize(
    "draw",
    [pytest.param(d, id=name) for name, cases in {**DRAWN, **BALLS}.items() for d in cases],
)
def test_picture_is_fit_for_print(draw):
    figure = draw()
    assert isinstance(figure, PrintFigure)  # whose fonts are TrueType (test_palette.py)
    assert faults(figure) == []


COLUMN = (3.4, 4.4)


@pytest.mark.parametrize(
    "draw",
    [
        pytest.param(
            lambda: ns.plot.phase_portrait(harvest(), (0.0, 1.1, 0.5, 1.5), size=COLUMN),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda: ns.plot.two_fold(ns.textbook.TWO_FOLDS["VV-C1"], size=COLUMN),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda: ns.plot.two_fold_3d(ns.textbook.TWO_FOLDS["mix-C"], size=COLUMN),
            marks=pytest.mark.slow,
        ),
        lambda: ns.plot.trajectory(run(), size=COLUMN),
        lambda: ns.plot.basins(basins(2), size=COLUMN),
        pytest.param(
            lambda: ns.plot.dividing_curves(cut(), size=(3.4, 2.9)), marks=pytest.mark.slow
        ),
        pytest.param(
            lambda: ns.plot.dividing_curves(cut(), size=(7.0, 4.4)), marks=pytest.mark.slow
        ),
    ],
    ids=[
        "phase_portrait",
        "two_fold",
        "two_fold_3d",
        "trajectory",
        "basins",
        "dividing",
        "dividing, page",
    ],
)
def test_picture_as_wide_as_a_column_is_fit_for_print_too(draw):
    """The legend is below the picture there, which fills the column."""
    figure = draw()
    assert faults(figure) == []
    assert max(ax.bbox.width for ax in figure.axes) > 0.3 * figure.bbox.width  # two side by side


@pytest.mark.slow
def test_no_title_is_cut_in_a_file():
    """Square axes of a narrow figure need more than one layout."""
    stream = io.BytesIO()
    ns.plot.two_fold(ns.textbook.TWO_FOLDS["II-C"], size=COLUMN).savefig(stream, dpi=150)
    stream.seek(0)
    assert imread(stream)[0].min() == 1.0  # the uppermost row of pixels is white


@pytest.mark.parametrize(
    ("count", "size"), [(2, COLUMN), (3, None), pytest.param(6, COLUMN, marks=pytest.mark.slow)]
)
def test_names_of_24_letters_do_not_meet(count, size):
    names = ["displacement_of_the_block", "tip_velocity_of_the_bow_", "temperature_of_the_spring"]
    names = [f"{names[k % 3]}{k // 3 or ''}" for k in range(count)]
    assert min(map(len, names)) >= 24
    states = [ca.SX.sym(name) for name in names]
    field = [states[1], -400 * states[0], *(-state for state in states[2:])]
    above, below = ([f - s * (k == 1) for k, f in enumerate(field)] for s in (100, -100))
    system = ns.FilippovSystem(states, surface=states[1] - 0.7, above=above, below=below)
    figure = ns.plot.trajectory(ns.simulate(system, np.ones(count), 0.5), size=size)
    assert faults(figure) == []


def test_names_of_narrow_basins_are_about_their_middles():
    found = basins(7)
    figure = ns.plot.basins(found, size=COLUMN)
    figure.draw_without_rendering()
    (axes,) = figure.axes
    texts = [text for artist in axes.artists for text in artist.get_children()]
    assert len(texts) == 7
    for text in texts:
        box = text.get_window_extent()
        middle = axes.transData.inverted().transform((box.p0 + box.p1) / 2)
        k = int(text.get_text().split(":")[0].split()[1])
        inside = found.axes["x"][np.any(found.labels == k, axis=1)]
        assert inside.min() <= middle[0] <= inside.max()
