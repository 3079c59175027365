"""Small systems (``tests/cases/runs.json``) end, switch and jump where the closed form says; many at once do as one."""

import numpy as np
import pytest

import nonsmooth as ns
from testset.problem import COMPARED, RUNS, Problem, cases

READ = {*COMPARED, "id", "about", "numbers", "let", "system", "start", "t_end", "options", "within"}
READ |= {"status", "method", "section", "slow", "many", "derivatives"}

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


def test_every_key_of_a_row_is_read():
    assert not [(own["id"], own.keys() - READ) for own in cases(RUNS) if own.keys() - READ]
