"""Gradients through JAX and PyTorch are those of the library."""

import sys

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns

x, v, mu, w = (ca.SX.sym(name) for name in ("x", "v", "mu", "w"))
BELT = ns.FilippovSystem.from_expression(
    [x, v], [v, -x - mu * ca.sign(v - 0.3) + w * (v - 0.3)], parameters={mu: 0.5, w: 0.2}
)
BALL = ns.FilippovSystem(
    [x, v], field=[v, -w], parameters={mu: 0.8, w: 9.8}, resets=ns.Reset(x, {v: -mu * v}, -1)
)
STARTS = np.array([[1.0, 0.0], [0.4, -0.5], [1.7, 0.2]])
TIMES = [0.1, 0.3, 0.7]
CASES = [(BELT, 4.0, {"mu": 0.45, "w": 0.2}), (BALL, 1.3, {"mu": 0.7, "w": 9.8})]


class Jax:
    """Values and gradients of a cost in JAX."""

    def __init__(self):
        self.library = pytest.importorskip("jax")
        self.library.config.update("jax_enable_x64", True)
        self.np, self.interop = self.library.numpy, ns.interop.jax

    def gradient(self, cost, x0, p):
        cost = self.library.jit(cost)
        return (cost(x0, p), *self.library.grad(cost, argnums=(0, 1))(x0, p))


class Torch:
    """Values and gradients of a cost in PyTorch."""

    def __init__(self):
        self.np = pytest.importorskip("torch")
        self.interop = ns.interop.torch

    def gradient(self, cost, x0, p):
        x0 = self.np.tensor(x0, dtype=self.np.float64, requires_grad=True)
        p = {k: self.np.tensor(v, dtype=self.np.float64, requires_grad=True) for k, v in p.items()}
        value = cost(x0, p)
        value.backward()
        return value.detach(), x0.grad, {name: own.grad for name, own in p.items()}


@pytest.fixture(params=[Jax, Torch], ids=["jax", "torch"])
def bridge(request):
    return request.param()


def expected(system, x0, p, t_end, t_eval):
    """The value of sum(cos(x)) over ends or samples, and its gradient by vjp."""
    run = ns.simulate(system, x0, t_end, parameters=p, t_eval=t_eval)
    if t_eval is None:
        return np.cos(run.x[-1]).sum(), *ns.vjp(run, -np.sin(run.x[-1]))
    return np.cos(run.sample_x).sum(), *ns.vjp(run, samples=-np.sin(run.sample_x))


@pytest.mark.parametrize("t_eval", [None, TIMES], ids=["end", "samples"])
@pytest.mark.parametrize(("system", "t_end", "p"), CASES, ids=["belt", "ball"])
def test_a_run_has_the_gradient_of_vjp(bridge, system, t_end, p, t_eval):
    cost = lambda x0, p: bridge.np.cos(
        bridge.interop.simulate(system, x0, t_end, p, t_eval=t_eval)
    ).sum()
    value, by_start, by_parameters = bridge.gradient(cost, STARTS[0], p)
    true = expected(system, STARTS[0], p, t_end, t_eval)
    assert abs(value - true[0]) < 1e-12
    assert np.allclose(by_start, true[1], rtol=1e-12, atol=1e-12)
    assert np.allclose([by_parameters[name] for name in p], true[2], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("t_eval", [None, TIMES], ids=["end", "samples"])
@pytest.mark.parametrize(("system", "t_end", "p"), CASES, ids=["belt", "ball"])
def test_an_ensemble_has_the_gradients_of_its_runs(bridge, system, t_end, p, t_eval):
    many = {**p, "mu": np.array([0.4, 0.5, 0.6])}  # one value for each run, and one w for all
    cost = lambda x0, p: bridge.np.cos(
        bridge.interop.ensemble(system, x0, t_end, p, t_eval=t_eval)
    ).sum()
    value, by_start, by_parameters = bridge.gradient(cost, STARTS, many)
    true = [
        expected(system, start, {**p, "mu": mu}, t_end, t_eval)
        for start, mu in zip(STARTS, many["mu"], strict=True)
    ]
    assert abs(value - sum(own[0] for own in true)) < 1e-10
    assert np.allclose(by_start, [own[1] for own in true], rtol=1e-12, atol=1e-12)
    assert np.allclose(by_parameters["mu"], [own[2][0] for own in true], rtol=1e-12, atol=1e-12)
    assert np.allclose(by_parameters["w"], sum(own[2][1] for own in true), rtol=1e-12, atol=1e-12)


def test_an_end_that_is_not_unique_has_no_gradient(bridge):
    pushed = ns.FilippovSystem([x], surface=x, above=[1], below=[-1])
    with pytest.raises(Exception, match="NON_UNIQUE"):
        bridge.interop.simulate(pushed, [0.0], 1.0)
    cost = lambda x0, p: bridge.interop.ensemble(pushed, x0, 1.0, p).sum()
    value, by_start, _ = bridge.gradient(cost, [[0.0], [0.5]], {})
    assert np.isnan(value) and np.array_equal(by_start, [[np.nan], [1.0]], equal_nan=True)


def test_unknown_parameters_and_wrong_shapes_are_named(bridge):
    with pytest.raises(ns.ParameterError, match="nu"):
        bridge.interop.simulate(BELT, [0.0, 0.0], 1.0, {"nu": 1.0})
    for run, x0, p in (
        ("simulate", STARTS, None),
        ("ensemble", 1.0, None),
        ("simulate", STARTS[0], [1.0]),
    ):
        with pytest.raises(ns.NonsmoothError, match=r"has shape .*Give one of"):
            getattr(bridge.interop, run)(BELT, x0, 1.0, p)


def test_vmap_of_a_run_is_its_ensemble():
    jax = Jax()
    one = lambda x0: jax.interop.simulate(BELT, x0, 4.0)
    assert np.allclose(
        jax.library.vmap(one)(STARTS), jax.interop.ensemble(BELT, STARTS, 4.0), atol=1e-9
    )


def test_parameters_may_be_an_array_and_starts_of_one_shape_with_them(bridge):
    p = np.array([[0.4, 0.2], [0.6, 0.1]])
    found = bridge.interop.ensemble(BELT, STARTS[0], 4.0, p)
    true = [ns.simulate(BELT, STARTS[0], 4.0, parameters={"mu": m, "w": k}).x[-1] for m, k in p]
    assert np.allclose(found, true, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["jax", "torch", "sympy"])
def test_a_library_that_is_missing_is_named(monkeypatch, name):
    monkeypatch.setitem(sys.modules, name, None)
    own = getattr(ns.interop, name)
    with pytest.raises(ns.OptionError, match=rf"needs {name}.*dynamics\[{name}\]"):
        own.system({}) if name == "sympy" else own.simulate(BELT, [0.0, 0.0], 1.0)


def test_an_unknown_bridge_is_an_error():
    assert dir(ns.interop) == ["jax", "sympy", "torch"]
    with pytest.raises(AttributeError, match="matlab"):
        getattr(ns.interop, "mat" + "lab")
