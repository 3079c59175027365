"""Systems written in SymPy are those written in CasADi."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

sp = pytest.importorskip("sympy")
x, v, mu, t = sp.symbols("x v mu t")
X, V, MU, T = (ca.SX.sym(name) for name in ("x", "v", "mu", "t"))

#: Right-hand sides of v in SymPy and in CasADi.
PAIRS = {
    "friction": (-x - mu * sp.sign(v - 0.3), -X - MU * ca.sign(V - 0.3)),
    "wall": (-x - 5 * sp.Max(x - 1, 0), -X - 5 * ca.fmax(X - 1, 0)),
    "steps": (
        sp.Piecewise((-1, v > sp.Rational(1, 2)), (2, v < -mu), (-x, True)),
        ca.if_else(V > 0.5, -1, ca.if_else(V < -MU, 2, -X)),
    ),
    "and": (
        sp.Piecewise((-1, sp.And(x > 0, v > 0)), (1, sp.Or(x < -1, sp.Not(v > -1))), (0, True)) - x,
        ca.if_else(
            ca.logic_and(X > 0, V > 0),
            -1,
            ca.if_else(ca.logic_or(X < -1, ca.logic_not(V > -1)), 1, 0),
        )
        - X,
    ),
    "functions": (
        sp.sin(x) * sp.exp(-v) / 3 + sp.sqrt(x**2 + 1) - sp.pi * sp.atan2(v, 2) - 3 * x,
        ca.sin(X) * ca.exp(-V) / 3 + ca.sqrt(X**2 + 1) - np.pi * ca.atan2(V, 2) - 3 * X,
    ),
    "forcing": (
        sp.cos(t) - sp.Abs(x) - sp.Heaviside(v),
        ca.cos(T) - ca.fabs(X) - (1 + ca.sign(V)) / 2,
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_the_same_run(name):
    own, true = PAIRS[name]
    made = ns.interop.sympy.system({x: v, v: own}, {mu: 0.5}, time=t)
    clock = {"time": T} if ca.depends_on(true, T) else {}
    written = ns.FilippovSystem.from_expression([X, V], [V, true], parameters={MU: 0.5}, **clock)
    runs = [ns.simulate(s, [0.3, 1.0], 5.0) for s in (made, written)]
    times = [[event.t for event in run.events] for run in runs]
    assert len(times[1]) > 1 or name == "functions"
    assert np.allclose(*times, rtol=1e-12, atol=1e-12)
    assert np.allclose(runs[0].x[-1], runs[1].x[-1], rtol=1e-12, atol=1e-12)
    assert made.state_names == ("x", "v") and made.parameter_names == ("mu",)


def test_functions_of_time_are_states():
    y = sp.Function("y")(t)
    system = ns.interop.sympy.system({y.diff(t): -y + sp.sin(t)})
    end = ns.simulate(system, [0.0], 2.0).x[-1, 0]
    assert system.state_names == ("y",)
    assert abs(end - (np.exp(-2) + np.sin(2) - np.cos(2)) / 2) < 1e-10


def test_states_and_parameters_may_be_named_by_strings():
    system = ns.interop.sympy.system({"x": v, "v": -x - mu}, {"mu": 0.5})
    assert system.state_names == ("x", "v") and system.parameter_names == ("mu",)
    with pytest.raises(ns.DefinitionError, match="expected a mapping"):
        ns.interop.sympy.system([sp.Eq(x, v)])


def test_expressions_make_stops():
    symbols = {x: X, v: V}
    stop = ns.Stop(ns.interop.sympy.expression(x - 1, symbols), 1, "end")
    system = ns.FilippovSystem([X, V], field=[V, 0], stops=[stop])
    assert abs(ns.simulate(system, [0.0, 0.5], 5.0).t[-1] - 2.0) < 1e-12


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (sp.Symbol("q") * x, "q is no state"),
        (sp.gamma(x), "no counterpart"),
        (sp.Piecewise((x, x > 0)), "True"),
        (sp.I * x, "I has"),
        (sp.oo * x, "oo"),
    ],
)
def test_what_cannot_be_read_is_named(value, words):
    with pytest.raises(ns.DefinitionError, match=words):
        ns.interop.sympy.system({x: value})
