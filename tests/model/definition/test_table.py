"""Tables beside scipy's interpolation, their surfaces, and runs beside those of the formula."""

import pickle
from dataclasses import fields, is_dataclass, replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import nonsmooth as ns
from nonsmooth.model import raised_of
from nonsmooth.model.definition.instruction_form import read_system, written
from nonsmooth.model.printing.instructions import instructions_of

x, v, t = (ca.SX.sym(s) for s in ("x", "v", "t"))


def random_table(seed, count=9):
    generator = np.random.default_rng(seed)
    return np.sort(generator.uniform(-2, 2, count)), generator.uniform(-1, 1, count)


def beside(xs, ys, order, outside, at):
    if order == 1:
        inner = np.interp(at, xs, ys)
        slopes = np.diff(ys)[[0, -1]] / np.diff(xs)[[0, -1]]
    else:
        spline = CubicSpline(xs, ys, bc_type="clamped" if outside == "constant" else "natural")
        inner, slopes = spline(np.clip(at, xs[0], xs[-1])), spline(xs[[0, -1]], 1)
    if outside == "linear":
        inner = (
            inner + slopes[0] * np.minimum(at - xs[0], 0) + slopes[1] * np.maximum(at - xs[-1], 0)
        )
    return inner


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("outside", ["constant", "linear"])
@pytest.mark.parametrize("order", [1, 3])
def test_values_are_those_of_scipy(order, outside, seed):
    xs, ys = random_table(seed)
    curve = ca.Function("curve", [x], [ns.table(x, xs, ys, order=order, outside=outside)])
    at = np.linspace(-3, 3, 401)
    found = np.array(curve(at[None, :])).ravel()
    np.testing.assert_allclose(found, beside(xs, ys, order, outside, at), atol=1e-11)


def test_a_table_of_a_table_that_is_constant_at_a_breakpoint():
    inner, outer = ([-2, 0, 2], [2, -1, 1]), ([-2, -1, 0, 1, 2], [0.0, 1.0, -1.0, 2.0, 0.0])
    table = ns.table(ns.table(x, *inner), *outer)
    system = ns.FilippovSystem.from_expression([x, v], [v, -x - table])
    run = ns.simulate(system, [1.7, 0.0], 5.0, tol=1e-11)
    value = lambda u: np.interp(np.interp(u, *inner), *outer)
    true = solve_ivp(
        lambda _, u: [u[1], -u[0] - value(u[0])],
        (0, 5),
        [1.7, 0.0],
        rtol=1e-10,
        atol=1e-12,
        method="DOP853",
        max_step=0.005,
    )
    assert np.abs(run.x[-1] - true.y[:, -1]).max() < 1e-7
    assert (np.diff([e.t for e in run.events]) > 1e-3).all()


@pytest.mark.parametrize(("order", "outside"), [(1, "constant"), (1, "linear"), (3, "linear")])
def test_breakpoints_have_the_class_that_they_have(order, outside):
    xs, ys = random_table(0, 5)
    system = ns.FilippovSystem.from_expression([x, v], [v, -ns.table(x, xs, ys, order, outside)])
    kinds = [system.switching(i) for i in range(system.surface_count)]
    assert {(k.kind, k.order) for k in kinds} == {("continuous", order)}
    kinks = {("constant", 1): 5, ("linear", 1): 3, ("linear", 3): 5}
    assert len(kinds) == kinks[outside, order]


@pytest.mark.parametrize("order", [1, 3])
def test_a_run_through_a_table_beside_scipy(order):
    xs, ys = np.linspace(-2, 2, 9), np.tanh(2 * np.linspace(-2, 2, 9))
    curve = ns.table(x, xs, ys, order=order)
    system = ns.FilippovSystem.from_expression([x, v], [v, -curve - 0.1 * v])
    run = ns.simulate(system, [1.7, 0.0], 20.0, tol=1e-12)

    spline = CubicSpline(xs, ys, bc_type="clamped")

    def smooth(s, u):
        y = np.interp(u[0], xs, ys) if order == 1 else spline(min(max(u[0], -2.0), 2.0))
        return [u[1], -float(y) - 0.1 * u[1]]

    other = solve_ivp(
        smooth, (0, 20), [1.7, 0.0], rtol=1e-10, atol=1e-12, method="DOP853", max_step=0.02
    )
    np.testing.assert_allclose(run.x[-1], other.y[:, -1], atol=1e-7)
    assert {e.kind for e in run.events} <= {"crossing", "end"}


def test_what_the_argument_cannot_pass_is_no_surface():
    xs, ys = [-1.0, 0.0, 0.5, 2.0], [5.0, 0.6, 0.4, 0.3]

    def count(argument):
        system = ns.FilippovSystem.from_expression([x, v], [v, -ns.table(argument, xs, ys)])
        return system.surface_count

    assert count(x) == 4
    assert count(x**2) == 2  # at 0.5 and 2
    assert count(ca.fabs(x)) == 1 + 2 * 2  # and where the absolute value has its kink
    assert count(1 + ca.tanh(x)) == 1  # at 0.5; it comes to 0 and 2 at infinity only
    assert count(3 + x**2) == 0
    at = ca.Function("at", [x], [ns.table(3 + x**2, xs, ys)])
    assert float(at(1.0)) == pytest.approx(0.3)


def test_the_measured_friction_of_the_examples():
    slip = np.array([0.0, 0.05, 0.1, 0.3, 1.0])
    measured = np.array([0.60, 0.45, 0.40, 0.36, 0.35])
    relative = v - 0.3
    friction = ns.table(ca.fabs(relative), slip, measured)
    system = ns.FilippovSystem.from_expression([x, v], [v, -x - friction * ca.sign(relative)])
    run = ns.simulate(system, [0.0, 0.0], t_end=50.0, tol=1e-11)
    exits = [event for event in run.events if event.kind == "exit"]
    # it sticks to the belt until the spring pulls with 0.6
    assert exits and exits[-1].x[0] == pytest.approx(
        -0.6 + 2 * 0.6 * (exits[-1].x[0] > 0), abs=1e-9
    )


@pytest.mark.parametrize(
    ("args", "words"),
    [
        ((x, [0.0], [1.0]), "at least two"),
        ((x, [0.0, 1.0], [1.0]), "as many xs as ys"),
        ((x, [1.0, 0.0], [1.0, 2.0]), "increase"),
        ((x, [0.0, 0.0], [1.0, 2.0]), "increase"),
        ((x, [0.0, np.nan], [1.0, 2.0]), "finite"),
        ((x, ["a", "b"], [1.0, 2.0]), "two lists of numbers"),
        ((x, [0.0, 1.0], [1.0, 2.0], 2), "straight lines"),
        ((x, [0.0, 1.0], [1.0, 2.0], 1, "nan"), "'error', received 'nan'"),
        (("x", [0.0, 1.0], [1.0, 2.0]), "argument of the table"),
    ],
)
def test_what_is_no_table_is_refused(args, words):
    with pytest.raises(ns.DefinitionError, match=words):
        ns.table(*args)


def test_kinks_beside_a_steep_piece_are_kept():
    xs, ys = [0.0, 1e-3, 1.0, 2.0, 3.0], [0.0, 1e3, 0.0, 5.0, 0.0]
    curve = ca.Function("curve", [x], [ns.table(x, xs, ys)])
    at = np.linspace(-0.5, 3.5, 401)
    found = np.array(curve(at[None, :])).ravel()
    np.testing.assert_allclose(found, np.interp(at, xs, ys), rtol=0, atol=1e-8)


NOISE = np.random.default_rng(0).normal(size=200)
CLOSE = ([0.0, 1e-9, 1.0], [0.0, 1e6, 0.0])


@pytest.mark.parametrize(("xs", "ys", "order"), [(np.linspace(0, 1, 200), NOISE, 3), (*CLOSE, 1)])
def test_values_that_a_sum_over_breakpoints_would_lose_are_kept(xs, ys, order):
    curve = ns.table(x, xs, ys, order)
    at = np.linspace(-0.2, 1.2, 301)
    found = np.array(ca.Function("curve", [x], [curve])(at[None, :])).ravel()
    np.testing.assert_allclose(found, beside(xs, ys, order, "constant", at), atol=1e-11)
    system = ns.FilippovSystem.from_expression([x, v], [v, -curve])
    with pytest.raises(ns.DefinitionError, match="added up breakpoint by breakpoint"):
        ns.classify(system, [0.5, 0.0])


def elements(rhs):
    """Tables of a system as elements, with the number of their curves and breakpoints."""
    system = ns.FilippovSystem.from_expression([x, v], [v, rhs])
    return [(len(t.curves), len(t.levels)) for t in system.written.tables]


def test_a_table_is_one_element_for_each_argument():
    one, two = ([0.0, 1.0, 2.0], [1.0, 0.0, 3.0]), ([-1.0, 1.0, 1.5], [1.0, 0.0, 3.0])
    assert elements(-ns.table(x, *one)) == [(1, 3)]
    assert elements(-ns.table(x, *one) * v - ns.table(x, *one)) == [(1, 3)]
    assert elements(-ns.table(x, *one) - ns.table(x, *two)) == [(2, 5)]
    assert elements(-ns.table(x, *one) - ns.table(-2 * x, *two)) == [(2, 6)]
    assert elements(-ns.table(x, *one) - ns.table(v, *two)) == [(1, 3), (1, 3)]
    assert elements(-ns.table(ca.fabs(v - 0.3), *one)) == [(2, 4)]
    assert elements(-ca.if_else(v > 0, ns.table(x, *one), ns.table(x, *two))) == [(2, 5)]
    assert elements(-ca.sign(ns.table(x, *one) - 0.5)) == []  # within a switch: surfaces
    assert elements(-ca.substitute(ns.table(v, *one), v, x * v)) == [(1, 3)]


@pytest.mark.parametrize("argument", [x, -x, 2 * x + 0.25, x * v, ca.fabs(x - 0.1), ca.fmax(x, v)])
@pytest.mark.parametrize("order", [1, 3])
def test_fields_of_modes_are_those_of_the_expression(argument, order):
    xs, ys = random_table(3, 6)
    rhs = [v, ns.table(argument, xs, ys, order, "linear") - v * ns.table(-x, xs, ys[::-1])]
    system = ns.FilippovSystem.from_expression([x, v], rhs)
    written = ca.Function("rhs", [x, v], [ca.vertcat(*rhs)])
    surfaces = ca.Function("h", [x, v], [system.definition.surfaces])
    for a, b in np.random.default_rng(4).uniform(-2, 2, (40, 2)):
        mode = "".join("+" if h > 0 else "-" for h in np.array(surfaces(a, b)).ravel())
        field = ca.Function("field", [x, v], [system.field(mode)])
        np.testing.assert_allclose(field(a, b), written(a, b), atol=1e-12)


def test_what_runs_of_a_table_evaluate_does_not_grow_with_it():
    sizes = set()
    for count in (10, 600):
        xs = np.linspace(-2, 2, count)
        system = ns.FilippovSystem.from_expression([x, v], [v, -ns.table(x, xs, np.sin(5 * xs), 3)])
        assert system.surface_count == count
        assert system.of_pieces.surface_count == 1
        lists = instructions_of(raised_of(system.of_pieces))
        sizes.add((len(lists.series.rule), len(lists.point.op), len(lists.surfaces.op)))
    assert len(sizes) == 1


def test_systems_with_tables_are_pickled_and_compared():
    system = ns.FilippovSystem.from_expression([x, v], [v, -ns.table(ca.fabs(x), *random_table(5))])
    copy = pickle.loads(pickle.dumps(system))
    assert copy == system and copy.written.tables == system.written.tables
    other = ns.FilippovSystem.from_expression([x, v], [v, -ns.table(ca.fabs(x), *random_table(6))])
    assert other != system


def damaged(value, wrong):
    """Copies of a value with another one in place of each of its parts."""
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            yield from (
                (*value[:i], own, *value[i + 1 :]) for own in [wrong, *damaged(part, wrong)]
            )
    elif is_dataclass(value):
        for name in [f.name for f in fields(value)]:
            own = [wrong, *damaged(getattr(value, name), wrong)]
            yield from (replace(value, **{name: part}) for part in own)


@pytest.mark.parametrize("wrong", [None, "a", (1,), np.zeros(3), float("nan"), 10**9, {}])
def test_damaged_tables_in_files_are_refused(wrong):
    rhs = -ns.table(ca.fabs(x), *random_table(5), outside="error") - ca.sign(x - 1)
    values = written(ns.FilippovSystem.from_expression([x, v], [v, rhs]))
    (table,) = values["plain"]["tables"]
    for name in ("element", "curves", "sides", "twins"):
        is_number = name == "curves" and type(wrong) is int  # as good as those of a curve
        for part in [wrong, *([] if is_number else damaged(getattr(table, name), wrong))]:
            plain = {**values["plain"], "tables": (replace(table, **{name: part}),)}
            with pytest.raises(ValueError):
                read_system({**values, "plain": plain})
