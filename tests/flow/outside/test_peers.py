"""Problems of other tools' collections (``testset/problems.json``): closed forms and integrators of their own."""

import json
import sys

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from testset.__main__ import OVER, solve
from testset.problem import Problem, cases

from ..independent.contacts import Mechanism, follow


def mechanism(problem):
    """The same mechanism for an integrator that shares no code with the package."""
    given = {name: problem.read(text) for name, text in problem.data["mechanism"].items()}
    q, v = ca.vertcat(*given["q"]), ca.vertcat(*given["v"])
    gaps, slips = ca.vertcat(*given["gaps"]), ca.vertcat(*given["slips"])
    rates = ca.vertcat(ca.mtimes(ca.jacobian(gaps, q), v), slips)

    def values(expression, *arguments):
        made = ca.Function("f", list(arguments), [ca.densify(ca.SX(expression))])
        flat = expression.is_column()
        return lambda *at: np.array(made(*at)).ravel() if flat else np.array(made(*at))

    return Mechanism(
        mass=values(given["mass"], q),
        force=values(ca.vertcat(*given["force"]), q, v),
        gaps=values(gaps, q),
        normals=values(ca.jacobian(gaps, q), q),
        tangents=values(ca.jacobian(slips, v), q),
        bias=values(ca.mtimes(ca.jacobian(rates, q), v), q, v),
        restitution=given["restitution"],
        friction=given["friction"],
    )


every = pytest.mark.parametrize(
    "data",
    [
        pytest.param(own, id=own["id"], marks=[pytest.mark.slow] * own.get("slow", False))
        for own in cases()
    ],
)


@every
def test_a_problem_is_as_known(data):
    problem = Problem(data)
    problem.check(problem.run())


@pytest.mark.slow
@every
def test_an_ensemble_ends_as_known(data):
    problem = Problem(data)
    if "end" not in problem.data or data.get("slow"):
        pytest.skip("nothing is known of its end, or it takes long")
    many = ns.ensemble(
        problem.system,
        np.tile(problem.start, (5, 1)),
        problem.t_end,
        **{"tol": 1e-10, **problem.options},
        work=ns.Work(threads=1, progress=False),
    )
    assert ns.Status(int(many.status[2])).name == data.get("status", "REACHED_END")
    assert problem.error(many.x[2], problem.data["end"]) <= problem.within("x")


@pytest.mark.slow
@pytest.mark.parametrize(
    "data", [own for own in cases() if "mechanism" in own], ids=lambda own: own["id"]
)
def test_an_integrator_of_contacts_ends_there_too(data):
    problem, start = Problem(data), np.array(Problem(data).start)
    half = len(start) // 2
    step = problem.t_end / 150
    end = follow(mechanism(problem), start[:half], start[half:], problem.t_end, step)
    assert problem.error(end, problem.data["end"]) < 1e-6


@pytest.mark.parametrize(
    "data", [own for own in cases() if "orbit" in own], ids=lambda own: own["id"]
)
def test_an_orbit_has_its_period_and_multipliers(data):
    problem = Problem(data)
    run = ns.simulate(problem.system, problem.start, 3 * problem.t_end)
    found = ns.periodic_orbit(problem.system, run)
    assert abs(found.period - problem.t_end) < 1e-9
    true = [problem.number(text) for text in data["orbit"]["multipliers"]]
    assert np.allclose(found.multipliers, true, rtol=0, atol=1e-9)


def test_time_does_not_run_backward():
    u = ca.SX.sym("u")
    with pytest.raises(ns.OptionError, match="t_end"):
        ns.simulate(ns.FilippovSystem([u], field=[u]), [5.0], t_start=2.0, t_end=0.0)


def test_derivatives_of_a_bounce():
    """SciML test/AD/autodiff_events.jl: one bounce within 1; derivatives by gravity and restitution."""
    y, v, g, e = (ca.SX.sym(name) for name in "yvge")
    floor = ns.Reset(y, {v: -e * v}, direction=-1)
    system = ns.FilippovSystem([y, v], field=[v, -g], parameters={g: 9.8, e: 0.8}, resets=floor)
    found = ns.sensitivity(ns.simulate(system, [1.0, 0.0], t_end=1.0, tol=1e-12))
    speed = np.sqrt(2 * 9.8)
    expected = [[1.8 / speed - 0.5, speed - 2], [1.8 / speed - 1, speed]]
    assert np.allclose(found.dx_dp, expected, rtol=0, atol=1e-10)


def test_results_of_a_tool_are_kept_and_a_problem_has_a_limit(tmp_path):
    tool, path, problems = "scipy, modes by hand", tmp_path / "scipy.json", cases()[:2]
    solve(sys.executable, tool, problems, path, "a")
    kept = {name: own["seconds"] for name, own in json.loads(path.read_text()).items()}
    assert [*kept] == [own["id"] for own in problems]
    solve("none", tool, problems[1:], path, "a")  # nothing is left to do
    found = json.loads(path.read_text())
    assert {name: own["seconds"] for name, own in found.items()}.items() <= kept.items()
    solve(sys.executable, tool, problems[1:], path, "b", limit=1e-3)
    assert [own["failed"] for own in json.loads(path.read_text()).values()] == [OVER]
