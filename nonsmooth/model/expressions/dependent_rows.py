"""Functions that are linear combinations of the rows of a field and of an affine function.

A step whose field was checked need not be checked with them; normal forces and Lie derivatives are
such combinations.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from .cancel import Forms, Monomial, NormalForms, Sum
from .graph import NOT_SMOOTH, instructions

#: Part of a function that may be left over by rounding.
_LEFT = 1e-9


def in_span(
    functions: Sequence[ca.SX], rows: Sequence[ca.SX], variables: ca.SX, others: ca.SX
) -> list[bool]:
    """Whether each function is found to be a combination of rows and an affine function."""
    # The coefficients may depend on ``others``, smoothly.
    nodes, _ = instructions([variables, others], [ca.vertcat(*rows, *functions)])
    if any(node.op in NOT_SMOOTH for node in nodes):
        return [False for _ in functions]  # other values of ``others`` have other combinations
    numbers = np.random.default_rng(1).uniform(0.3, 1.7, others.numel())
    fixed = [ca.substitute(ca.SX(e), others, ca.DM(numbers)) for e in [*rows, *functions]]
    normal = NormalForms([variables, others])
    bent = [_nonlinear(row[0], normal.forms) for row in normal.rows(fixed)]
    monomials = sorted({m for form in bent for m in form})
    table = np.array([[form.get(m, 0.0) for m in monomials] for form in bent])
    table = table.reshape(len(bent), len(monomials))
    known = table[: len(rows)]
    basis, result = known[np.isfinite(known).all(axis=1)].T, []
    for function, target in zip(functions, table[len(rows) :], strict=True):
        unseen = not target.any() and not ca.is_linear(function, variables)
        if unseen or not np.isfinite(target).all():
            result.append(False)
            continue  # coefficients below the least number, or none for these ``others``
        weights = np.linalg.lstsq(basis, target, rcond=None)[0] if basis.size else np.zeros(0)
        left = target - basis @ weights if basis.size else target
        result.append(bool(np.abs(left).max(initial=0.0) <= _LEFT * np.abs(target).max(initial=0)))
    return result


def _nonlinear(form: Sum, forms: Forms) -> dict[Monomial, float]:
    """Leave out the constant and multiples of one variable."""
    linear = lambda m: len(m) == 1 and m[0][1] == 1 and forms.atoms[m[0][0]].is_symbolic()
    return {m: c for m, c in form.items() if m and not linear(m)}
