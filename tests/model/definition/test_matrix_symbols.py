"""MX expressions and CasADi's dictionaries of DAEs give the systems of the same SX expressions."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

X, V, K, T = (ca.MX.sym(name) for name in ("x", "v", "k", "t"))
W = ca.MX.sym("w", 3)


def symbols(make, names):
    return [make(name) for name in names]


def oscillator(x, v, k):
    return ns.FilippovSystem.from_expression(
        [x, v], [v, -x - k * ca.fabs(v) * v - ca.if_else(x > 0, 1, 0.5)], parameters={k: 0.2}
    )


def room(x, q):
    on = ns.Reset(x - 18, {q: 1}, -1, level=True, when=q == 0, name="on")
    off = ns.Reset(ca.logic_and(x >= 22, q == 1), {q: 0}, level=True, name="off")
    return ns.FilippovSystem(
        [x], field=[30 * ca.if_else(q == 1, 1, 0) - x], discrete={q: (0, 1)}, resets=[on, off]
    )


def switched(x, q):
    relay = ns.Relay(x, on=22, off=18)
    return ns.FilippovSystem([x], field=[20 - x - 4 * q], surfaces=[relay], multipliers=[q])


def bouncing(x, v):
    return ns.FilippovSystem([x, v], field=[v, -9.8], impacts=ns.Impact(x, restitution=0.5))


def timed(x, t):
    return ns.FilippovSystem([x], field=[1.0], time=t, stops=ns.Stop(x - t / 2, name="late"))


@pytest.mark.parametrize(
    ("make", "names", "start"),
    [
        (oscillator, "xvk", [1.0, 0.5]),
        (room, "xq", [20.0, 0]),
        (switched, "xq", [20.0]),
        (bouncing, "xv", [1.0, 0.0]),
        (timed, "xt", [-0.5]),
    ],
)
def test_a_system_in_matrix_symbols_is_that_in_scalar_symbols(make, names, start):
    one, two = (
        ns.simulate(make(*symbols(kind, names)), start, 1.5) for kind in (ca.MX.sym, ca.SX.sym)
    )
    assert one.itinerary == two.itinerary
    assert [e.name for e in one.events] == [e.name for e in two.events]
    np.testing.assert_allclose(one.events.t, two.events.t, rtol=1e-13)
    np.testing.assert_allclose(one.x[-1], two.x[-1], rtol=1e-12)


def test_vectors_have_names_with_numbers():
    one = ns.FilippovSystem.from_expression(W, -W * ca.norm_2(W))
    assert one.state_names == ("w_0", "w_1", "w_2") and one.surface_count == 0
    mixed = ns.FilippovSystem([W, X], field=[ca.mtimes(ca.DM(np.diag([1, 2, 3])), -W), X])
    run = ns.simulate(mixed, [1, 1, 1, 1], 1.0)
    np.testing.assert_allclose(run.x[-1], np.exp([-1, -2, -3, 1]), rtol=1e-9)
    gains = ns.FilippovSystem([X], field=[-W[1] * X], parameters={W: [1, 2, 3]})
    assert gains.parameter_vector().tolist() == [1, 2, 3]


@pytest.mark.parametrize("make", [ca.SX.sym, ca.MX.sym])
def test_a_dae_without_algebraic_equations_is_a_system(make):
    x, p, t = make("x", 2), make("p", 2), make("t")
    ode = ca.vertcat(x[1], -x[0] - p[0] * ca.sign(x[1]) + p[1] * ca.sin(t))
    system = ns.FilippovSystem.from_dae(
        {"x": x, "p": p, "t": t, "ode": ode}, parameters={"p_0": 0.4}
    )
    assert system.surface_count == 1 and system.time_dependent
    a, b, c, d, e = (ca.SX.sym(n) for n in ("a", "b", "c", "d", "e"))
    same = ns.FilippovSystem.from_expression(
        [a, b], [b, -a - c * ca.sign(b) + d * ca.sin(e)], time=e, parameters={c: 0.4, d: 0.1}
    )
    found = ns.simulate(system, [1.0, 0.0], 5.0, parameters={"p_1": 0.1}).x[-1]
    assert found.tolist() == ns.simulate(same, [1.0, 0.0], 5.0).x[-1].tolist()


TABLE = ca.interpolant("table", "linear", [[0.0, 1.0, 2.0]], [0.0, 1.0, 4.0])


@pytest.mark.parametrize(
    ("make", "part"),
    [
        (lambda: ns.FilippovSystem([X], field=[-ca.fabs(X)]), "from_expression"),
        (lambda: ns.FilippovSystem.from_expression([X], [-TABLE(X)]), "nonsmooth.table"),
        (lambda: ns.FilippovSystem.from_expression([X], [-ca.SX.sym("x")]), "contains"),
        (lambda: ns.FilippovSystem.from_dae({"x": X}), "'x' and 'ode'"),
        (lambda: ns.FilippovSystem.from_dae({"x": X, "ode": -X, "z": V, "alg": V - X}), "'alg'"),
        (lambda: ns.FilippovSystem.from_dae({"x": X, "ode": -X}, parameters={"k": 1}), "'k'"),
        (lambda: ns.FilippovSystem.from_dae({"x": X, "ode": -X}, parameters=[1]), "a mapping"),
        (lambda: ns.FilippovSystem({"x": X, "ode": -X}), "from_dae"),
    ],
)
def test_what_is_no_graph_of_scalar_operations_is_refused_by_name(make, part):
    with pytest.raises(ns.DefinitionError, match=part):
        make()


def test_an_empty_entry_of_a_dae_does_not_matter():
    assert ns.FilippovSystem.from_dae({"x": X, "ode": -X, "z": ca.MX(), "alg": ca.MX()})


def test_refusals_name_the_construct_that_works():
    x, v, i, r = (ca.SX.sym(n) for n in "xvir")
    for make, part in (
        (lambda: ns.FilippovSystem([x], field=[-ca.fabs(x)]), "from_expression"),
        (
            lambda: ns.FilippovSystem([x], surface=ca.fabs(x) - 1, above=[0], below=[1]),
            "piece a surf",
        ),
        (lambda: ns.FilippovSystem([x], field=[1], stops=ns.Stop(ca.sign(x))), "fmin and fmax"),
        (
            lambda: ns.FilippovSystem([x, v], field=[v, -9], impacts=ns.Impact(ca.fabs(x))),
            "Impact of",
        ),
        (
            lambda: ns.FilippovSystem([i], field=[r - 1], impacts=ns.Impact(i, reaction=r)),
            "Complem",
        ),
        (lambda: ns.FilippovSystem.from_expression([x], [ca.fmod(v, 1)], time=v), "Clock"),
    ):
        with pytest.raises((ns.DefinitionError, ns.NotSmoothError), match=part):
            make()
