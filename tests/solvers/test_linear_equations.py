import numpy as np
import pytest

from nonsmooth.solvers import linear_equations


@pytest.mark.parametrize("n", [3, 120, 300])
@pytest.mark.parametrize("seed", range(4))
def test_sparse_factors_give_the_solution_and_the_determinant(n, seed):
    rng = np.random.default_rng([n, seed])
    matrix = np.where(rng.random((n, n)) < 6 / n, rng.normal(size=(n, n)), 0.0)
    matrix += rng.normal(size=n) * np.eye(n)[rng.permutation(n)]
    right = rng.normal(size=n)
    sign, size = np.linalg.slogdet(matrix)
    found = linear_equations.determinant(matrix)
    assert np.sign(found) == sign
    assert np.log(abs(found)) == pytest.approx(size, abs=1e-9)
    solution = linear_equations.solve(matrix, right)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, right), rtol=1e-7, atol=1e-7)


def test_a_singular_sparse_matrix_is_refused():
    singular = np.diag(np.arange(150.0))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        linear_equations.solve(singular, np.ones(150))
    assert linear_equations.determinant(singular) == 0.0
