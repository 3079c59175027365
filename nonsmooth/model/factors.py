"""What is solved for while a surface slides: its multiplier, or its product with a common factor.

Where the field is affine in all multipliers and what multiplies lambda_i has a factor n_i(x), as the
normal force of a contact, the unknown is nu_i = n_i lambda_i, so that sliding goes on smoothly through
n_i = 0 (``cancel``).
"""

from __future__ import annotations

import casadi as ca

from .cancel import cancel_common_factor
from .system import FilippovSystem


def with_factors(system: FilippovSystem, lam: ca.SX) -> tuple[ca.SX, list[ca.SX], list[ca.SX]]:
    """Return the field in lambda, reactions and nu, with the factors taken out.

    Parameters
    ----------
    system : FilippovSystem
    lam : SX (m,)
        Symbols of the multipliers; lambda_i is 0 while its surface slides.

    Returns
    -------
    field : SX (N,)
    factors : list of SX (m,)
        n_i; 1 where there is none.
    unknowns : list of SX (m,)
        nu_i, or lambda_i where there is no factor.
    """
    x, p, reactions = system.extended_states, system.parameter_symbols, system.definition.reactions
    field = plain = system.field_with(lam, reactions)
    factors, unknowns = [ca.SX(1)] * system.surface_count, [*ca.vertsplit(lam)][: lam.numel()]
    known, variables = ca.vertcat(p, lam), ca.vertcat(x, reactions)
    columns = ca.jacobian(plain, lam)
    for members in system.entries:  # a set has one factor
        places = [(row, i) for i in members for row in columns[:, i].sparsity().row()]
        entries = [e for i in members for e in columns[:, i].nonzeros()]
        column = ca.vertcat(*entries)
        if ca.depends_on(column, lam) or not ca.depends_on(column, variables):
            continue  # products of multipliers, or hidden dynamics; a constant
        reduced, factor = cancel_common_factor(entries, variables, known)
        if ca.depends_on(factor, variables):
            field = ca.SX(field)
            for i in members:
                factors[i], unknowns[i] = factor, ca.SX.sym(f"nu{i}")
            for (row, i), entry in zip(places, reduced, strict=True):
                field[row] += unknowns[i] * entry  # lambda_i is 0 while the surface slides
    return field, factors, unknowns
