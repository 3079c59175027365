"""Functions that CasADi does not inline: written out where they are SX operations, else refused."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.flow import follow
from nonsmooth.model.expressions.graph import instructions

x, v, t, p, lam = (ca.SX.sym(s) for s in ("x", "v", "t", "p", "lam"))
m = ca.MX.sym("m")
KNOTS = np.linspace(-2.0, 2.0, 9)


class Cube(ca.Callback):
    """A Function of which CasADi knows no operations, as an external one."""

    def __init__(self):
        ca.Callback.__init__(self)
        self.construct("my_table")

    def eval(self, arguments):
        return [arguments[0] ** 3]


CUBE = Cube()
ROOT = ca.rootfinder("my_table", "newton", {"x": x, "p": p, "g": x**3 + x - p})
TABLES = {
    "linear": ca.interpolant("my_table", "linear", [KNOTS], KNOTS**3),
    "bspline": ca.interpolant("my_table", "bspline", [KNOTS], KNOTS**3),
    "a table inside": ca.Function(
        "outer",
        [x],
        [ca.interpolant("my_table", "linear", [KNOTS], KNOTS)(x)],
        {"never_inline": True},
    ),
    "a root": ca.Function("outer", [x], [ROOT(0, x)], {"never_inline": True}),
    "MX": ca.Function("my_table", [m], [ca.sin(m)], {"never_inline": True}),
    "callback": CUBE,
}


SMOOTH = ns.FilippovSystem([x, v], field=[v, -x], parameters={p: 0.3})
CORNER = ns.FilippovSystem([x, v], field=[-lam, -t], multipliers=[lam, t], surfaces=[x, v])


def mapped(**more):
    return ns.FilippovSystem([x, v], field=[v, -x], parameters={p: 0.3}, **more)


#: Every argument that takes expressions, with its name in the message.
ARGUMENTS = {
    "field": lambda e: ns.FilippovSystem([x, v], field=[v, e], parameters=p),
    "field ": lambda e: ns.FilippovSystem(
        [x, v], field=[v, -x - lam * e], multipliers=lam, surface=v, parameters=p
    ),
    "above": lambda e: ns.FilippovSystem([x, v], surface=v, above=[v, e], below=[v, 1], parameters=p),
    "below": lambda e: ns.FilippovSystem([x, v], surface=v, above=[v, 1], below=[v, e], parameters=p),
    "surface": lambda e: ns.FilippovSystem(
        [x, v], surface=v - e, above=[v, -1], below=[v, 1], parameters=p
    ),
    "surface 0": lambda e: ns.FilippovSystem(
        [x, v], surfaces=[ca.vertcat(x, v + e)], multipliers=[ca.SX.sym("l", 2)], field=[v, -x],
        parameters=p,
    ),
    "surface 1": lambda e: ns.FilippovSystem(
        [x, v], surfaces=[x, v + e], multipliers=[lam, t], field=[v - lam, -x - t], parameters=p
    ),
    "rhs": lambda e: ns.FilippovSystem.from_expression([x, v], [v, -x - e * ca.sign(v)], parameters=p),
    "rhs ": lambda e: ns.FilippovSystem.from_expression([x, v], [v, ca.sign(e)], parameters=p),
    "rhs  ": lambda e: ns.FilippovSystem.from_expression(
        [x, v], [v, e], parameters=p, clocks=ns.Clock(1.0)
    ),
    "stop": lambda e: mapped(stops=ns.Stop(e - 1)),
    "reset": lambda e: mapped(resets=ns.Reset(e - 1, [x, v])),
    "map of reset": lambda e: mapped(resets=ns.Reset(x, [x, e])),
    "gap": lambda e: mapped(impacts=ns.Impact(e, 0.5)),
    "restitution": lambda e: mapped(impacts=ns.Impact(x, ca.substitute(e, x, p))),
    "period": lambda e: ns.Clock(ca.substitute(e, x, p)),
    "map of 'clock'": lambda e: mapped(clocks=ns.Clock(1.0, map=[x, e])),
    "at": lambda e: ns.simulate(SMOOTH, [1.0, 0.2], 1.0, at=ns.Section(e)),
    "at ": lambda e: ns.orbit.poincare(SMOOTH, e, [1.0, 0.2], count=1),
    "watched function 0": lambda e: follow(SMOOTH, [1.0, 0.2], 1.0, mode="", until=e),
    "watched function 0 ": lambda e: follow(SMOOTH, [1.0, 0.2], 1.0, mode="", watch=[e]),
    "cost": lambda e: ns.gradient(ns.simulate(SMOOTH, [1.0, 0.2], 1.0), e),
    "transition": lambda e: ns.regularise(
        ns.FilippovSystem([x, v], surface=v, above=[v, -1], below=[v, 1]),
        0.1, transition=lambda s: ca.substitute(e, x, s),
    ),
    "of": lambda e: ns.local.intersection_range(CORNER, [0.0, 0.0], of=e),
    "expression": lambda e: SMOOTH.gradient(e),
    "expression ": lambda e: SMOOTH.parameter_gradient(e),
}  # fmt: skip


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("argument", ARGUMENTS)
def test_a_table_is_refused_by_name(argument, table):
    with pytest.raises(ns.DefinitionError) as caught:
        ARGUMENTS[argument](TABLES[table](x))
    assert argument.strip() in str(caught.value) and "'my_table'" in str(caught.value)


def test_a_function_that_is_not_inlined_is_the_same_as_written_out():
    """Nested, with several inputs and outputs, sparse ones among them; bit by bit."""
    options = {"never_inline": True}
    inner = ca.Function("inner", [x, v], [ca.sin(x) * v, x + v], options)
    swap = ca.diag(ca.vertcat(v, x))
    outer = ca.Function("outer", [ca.vertcat(x, v)], [inner(x, 2)[0] + v, swap], options)

    def system(out, into):
        first, second = out(ca.vertcat(x, v))
        entry, other = into(v, first)
        return ns.FilippovSystem(
            [x, v],
            surface=into(x, v)[1] - 0.2,
            above=[second[0, 0] + second[1, 0], -first],
            below=[other, 1 - entry + second[1, 1]],
            resets=ns.Reset(into(v, x)[0] - 0.5, [into(x, v)[1], out(ca.vertcat(x, v))[0]]),
        )

    written = system(
        lambda u: (ca.sin(u[0]) * 2 + u[1], ca.diag(ca.vertcat(u[1], u[0]))),
        lambda a, b: (ca.sin(a) * b, a + b),
    )
    given = system(outer, inner)
    for name in ("field", "surfaces", "guards", "maps"):
        assert ca.is_equal(
            getattr(given.definition, name),
            ca.substitute(
                getattr(written.definition, name),
                written.definition.multipliers, given.definition.multipliers,
            ),
            99,
        )  # fmt: skip
    runs = [ns.simulate(s, [0.7, -0.3], 2.0) for s in (written, given)]
    np.testing.assert_array_equal(runs[0].x, runs[1].x)


@pytest.mark.parametrize("switch", [ca.sign(v - 0.3), ca.if_else(v > 0.3, 1, -1)])
def test_switches_inside_a_function_that_is_not_inlined_are_found(switch):
    friction = ca.Function("friction", [v], [switch], {"never_inline": True})
    system = ns.FilippovSystem.from_expression([x, v], [v, -x - 0.5 * friction(v)])
    assert system == ns.FilippovSystem.from_expression([x, v], [v, -x - 0.5 * switch])
    with pytest.raises(ns.NotSmoothError):
        ns.FilippovSystem([x, v], field=[v, -friction(v)])


@pytest.mark.parametrize("knots", [KNOTS, KNOTS**3 / 4])
def test_a_table_as_the_message_says(knots):
    """Against the same broken line between its knots, where the motion is known."""
    values = np.cos(knots)
    system = ns.FilippovSystem.from_expression([x], [ca.pw_lin(x, knots, values)])
    run, t_end, position = ns.simulate(system, [-1.3], 2.0, tol=1e-12), 0.0, -1.3
    for k in range(np.searchsorted(knots, -1.3), len(knots)):
        slope = (values[k] - values[k - 1]) / (knots[k] - knots[k - 1])
        here = np.interp(position, knots, values)
        needed = np.log(values[k] / here) / slope
        if values[k] <= 0 or t_end + needed > 2.0:
            position += here * np.expm1(slope * (2.0 - t_end)) / slope
            break
        position, t_end = knots[k], t_end + needed
    assert run(2.0)[0] == pytest.approx(position, abs=1e-11)


def test_what_casadi_itself_evaluates_is_right():
    """Values and symbolic derivatives of tables need no series."""
    table = TABLES["bspline"]
    point = [0.3, 0.7]
    assert SMOOTH.evaluate(table(x), point).item() == pytest.approx(float(table(0.3)))
    rate = SMOOTH.lie_derivative([""], of=table(x))
    slope = float(ca.Function("slope", [x], [ca.jacobian(table(x), x)])(0.3))
    assert SMOOTH.evaluate(rate, point).item() == pytest.approx(0.7 * slope)
    run = ns.simulate(SMOOTH, [1.0, 0.2], 5.0, at=2 + table(p))
    period = 2 + float(table(0.3))
    np.testing.assert_allclose(run.sample_t, np.arange(1, len(run.sample_t) + 1) * period)


def test_a_message_inside_an_expression_changes_no_value():
    """CasADi's printme is its first argument."""
    run, plain = (
        ns.simulate(ns.FilippovSystem([x, v], field=[v, -e]), [1.0, 0.2], 1.0)
        for e in (ca.sin(x).printme(v), ca.sin(x))
    )
    np.testing.assert_array_equal(run.x, plain.x)


def test_no_graph_is_walked_past_a_call():
    """What has not been read as an argument is refused where graphs are read."""
    with pytest.raises(ns.DefinitionError, match="'my_table'"):
        instructions([x], [TABLES["linear"](x)])
