"""Derivatives of runs are differences of neighbouring runs: rows of ``tests/cases/runs.json`` with ``derivatives``."""

import numpy as np
import pytest

from tests.differences import require
from testset.problem import RUNS, Problem, cases


@pytest.mark.parametrize(
    "data", [own for own in cases(RUNS) if "derivatives" in own], ids=lambda own: own["id"]
)
def test_derivatives_are_differences_of_runs(data):
    problem, options = Problem(data), dict(data["derivatives"])
    start, t_end, rank = problem.start, problem.t_end, options.pop("rank", None)
    times = np.sort([0.0, t_end, *np.random.default_rng(1).uniform(0.0, t_end, 6)])
    if not (options.get("ends") or data.get("status") == "STOPPED"):
        options["times"] = times
    options["t_start"] = problem.options.get("t_start", 0.0)
    s = require(problem.system, start, t_end, data.get("itinerary"), **options)
    assert rank is None or np.linalg.matrix_rank(s.dx_dx0, tol=1e-10) == rank
