"""Terms that a mode multiplies by zero are zero, and nothing else changes."""

import casadi as ca
import numpy as np
import pytest

import nonsmooth as ns
from nonsmooth.model import coupled_of
from nonsmooth.model.expressions.unused_terms import without_unused_terms

X, Y, LAM, MU, P = (ca.SX.sym(name) for name in ("x", "y", "lam", "mu", "p"))
INPUTS = [ca.vertcat(X, Y, LAM, MU), P]
HELD = {2: (1.0, -1.0), 3: (1.0, -1.0, 0.0)}

#: Each vanishes at lam = -1, mu = 0 and x = -3, y = -2, p = 2 with functions that have no value there.
LEFT_OUT = [
    (1 + LAM) / 2 * ca.log(X),
    (X * (1 + LAM) / 2) * ca.sqrt(Y),
    ca.sqrt(Y) * (0.5 + 0.5 * LAM) * P,
    (1 + LAM) * Y / ca.log(X),
    MU * ca.log(X),
    (1 + LAM) * (MU + 1) * X**0.3 / 4,
    (1 + LAM) / 2 * (1 - MU) / 2 * ca.sqrt(X),
    (1 + LAM) * ca.exp(1e3 * P),
    (LAM * X + X) * ca.log(X) - X * (1 + LAM) * ca.log(Y),
]
AS_THEY_WERE = [
    LAM * X + MU * Y,
    (1 + LAM) / 2 * ca.sin(X) * Y,
    ca.log(X) * LAM,
    ca.log(X) + 2 * MU * X,
    ca.exp(LAM * X),
]


def at(e, x, y, lam, mu, p=2.0):
    return float(ca.Function("f", INPUTS, [e])([x, y, lam, mu], p))


@pytest.mark.parametrize("e", LEFT_OUT[:-1], ids=str)
def test_what_is_left_out_is_zero(e):
    assert not at(e, -3.0, -2.0, -1.0, 0.0) == 0.0
    (found,) = without_unused_terms(INPUTS, [e], HELD)
    assert at(found, -3.0, -2.0, -1.0, 0.0) == 0.0


@pytest.mark.parametrize("e", LEFT_OUT[:7], ids=str)
def test_elsewhere_nothing_changes(e):
    (found,) = without_unused_terms(INPUTS, [e], HELD)
    for lam, mu in ((1.0, 0.4), (0.3, 0.7), (-0.9, -0.2)):
        assert at(found, 3.0, 2.0, lam, mu) == at(e, 3.0, 2.0, lam, mu)
        assert np.isnan(at(found, -3.0, -2.0, lam, mu)) == np.isnan(at(e, -3.0, -2.0, lam, mu))


@pytest.mark.parametrize("e", AS_THEY_WERE, ids=str)
def test_what_is_never_left_out_stays_as_it_is(e):
    (found,) = without_unused_terms(INPUTS, [e], HELD)
    assert found is e


def test_the_program_of_all_modes_has_values_where_the_mode_has():
    system = ns.FilippovSystem(
        [X, Y],
        field=[(1 + LAM) / 2 * ca.log(X) - (1 - LAM) / 2, MU * ca.sqrt(1 + Y * Y)],
        surfaces=[X - 1, Y],
        multipliers=[LAM, MU],
    )
    coupled, none = coupled_of(system), np.zeros(0)
    field, layer, *_ = coupled.values(np.array([-2.0, 0.5]), [-1.0, 1.0], np.zeros(2), none)
    assert field == pytest.approx([-1.0, np.sqrt(1.25)]) and layer == pytest.approx(field)
    at = coupled.layer_at(np.array([-2.0, 0.5]), np.array([-1.0, 1.0]), np.zeros(2), none)
    assert at.layer == pytest.approx(field) and np.all(np.isfinite(at.slope))
    gradient = ca.Function("g", [coupled.moving], coupled.awake([coupled.gradients[0]]))
    inputs = [-2.0, 0.5, -1.0, 1.0, *np.zeros(coupled.moving.numel() - 4)]
    assert np.all(np.isfinite(np.array(gradient(inputs))))
