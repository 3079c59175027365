"""Small systems (``tests/cases/runs.json``) end, switch and jump where the closed form says; many at once do as one."""

import numpy as np
import pytest

import nonsmooth as ns
from testset.problem import RUNS, Problem, cases

every = pytest.mark.parametrize(
    "data",
    [
        pytest.param(own, id=own["id"], marks=[pytest.mark.slow] * own.get("slow", False))
        for own in cases(RUNS)
    ],
)


@every
def test_a_run_is_as_known(data):
    problem = Problem(data)
    run = problem.run()
    problem.check(run)
    if data.get("many"):
        starts, work = np.tile(problem.start, (70, 1)), ns.Work(progress=False)
        many = ns.ensemble(problem.system, starts, problem.t_end, **problem.options, work=work)
        problem.check_many(run, many)
