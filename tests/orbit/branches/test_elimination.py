"""Elimination from leg to leg solves the same bordered equations as a dense solver."""

import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.orbit.periodic.boundary_value_problem import eliminated
from tests.orbit.periodic_cases import forced_friction, relay, walker


def problems():
    """Orbits with many legs, with a symmetry, with one leg."""
    system = relay()
    run = ns.simulate(system, [0.0, -0.001, -0.02], t_end=40.0)
    yield ns.periodic_orbit(system, run, symmetry="odd")
    system = forced_friction()
    yield ns.periodic_orbit(system, ns.simulate(system, [1.5, 0.0], 100.0))
    yield ns.periodic_orbit(
        walker(), [0.2003, -0.1998, 0.4006, -0.0158], itinerary=[("", "heelstrike")]
    )


@pytest.mark.parametrize("borders", [1, 2])
def test_the_solution_is_that_of_a_dense_solver(borders):
    rng = np.random.default_rng(0)
    for orbit in problems():
        problem, p = orbit.problem, orbit.parameter_vector
        free = tuple(range(min(borders, p.size))) if p.size >= borders else (0,)
        at = problem.evaluate(orbit.unknowns, p, free)
        k = len(free)
        matrix = np.vstack(
            [np.hstack([at.jacobian, at.by_parameters]), rng.normal(size=(k, problem.size + k))]
        )
        matrix = matrix * rng.uniform(0.5, 2.0, matrix.shape[1])  # scaled columns
        right = rng.normal(size=len(matrix))
        expected = np.linalg.solve(matrix, right)
        small = eliminated(problem, matrix, right)
        assert np.abs(small.solution() - expected).max() < 1e-9 * np.abs(expected).max()
        assert small.matrix.shape == (problem.dimension + k,) * 2


def test_the_determinant_changes_its_sign_with_that_of_the_whole_matrix():
    rng = np.random.default_rng(1)
    for orbit in problems():
        problem, p = orbit.problem, orbit.parameter_vector
        at = problem.evaluate(orbit.unknowns, p, (0,))
        upper = np.hstack([at.jacobian, at.by_parameters])
        ratios = []
        for _ in range(4):
            matrix = np.vstack([upper, rng.normal(size=problem.size + 1)])
            sign = np.linalg.slogdet(matrix)[0]
            small = eliminated(problem, matrix, np.zeros(len(matrix)))
            ratios.append(sign * np.sign(small.determinant()))
        assert len(set(ratios)) == 1


def test_an_event_that_is_grazed_to_all_digits_is_no_pivot():
    orbit = ns.periodic_orbit(relay(), ns.simulate(relay(), [0.0, -0.001, -0.02], t_end=40.0))
    problem, at = orbit.problem, orbit.evaluation
    count, n = len(problem.legs), problem.dimension
    matrix = at.jacobian.copy()
    matrix[count * n + 3, count * n + 3] = 0.0
    with pytest.raises(np.linalg.LinAlgError, match="leg 4"):
        eliminated(problem, matrix, at.residual)
