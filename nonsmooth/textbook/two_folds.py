"""The normal form of the generic two-fold, for any class of the decision table."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ..model import FilippovSystem, OptionError
from .problem import RELATIVE, Problem, Reference, problem

#: One example (sigma, nu) of each class of the decision table.
TWO_FOLDS: dict[str, tuple[tuple[int, int], tuple[float, float]]] = {
    "VV-C1": ((1, -1), (-2.0, -1.0)),
    "VV-F": ((1, -1), (2.0, 1.0)),
    "II-C": ((-1, 1), (-2.0, -1.0)),
    "II-F": ((-1, 1), (-0.5, -0.5)),
    "mix-0": ((1, 1), (0.0, 0.5)),
    "mix-S": ((1, 1), (-1.5, 1.5)),
    "mix-C": ((1, 1), (-3.0, -0.5)),
    "mix-F": ((1, 1), (0.5, 3.0)),
}


def two_fold(
    label: str | Sequence[int] = "II-C",
    nu: Sequence[float] | None = None,
    *,
    sigma: Sequence[int] | None = None,
) -> Problem:
    """Normal form of a two-fold: of a class by its label, or from its numbers.

    The field is $(-z2, -sigma1, nu1)$ where $z1 > 0$, and $(z3, nu2, sigma2)$ where $z1 < 0$. The two-fold
    is the origin; sliding is attracting where $z2, z3 > 0$, with the orbits of $z' = [[nu2, -sigma1], [sigma2, nu1]] z$.

    Parameters
    ----------
    label : str or (int, int)
        ``"VV-C1"``, ``"VV-F"``, ``"II-C"``, ``"II-F"``, ``"mix-0"``, ``"mix-S"``, ``"mix-C"`` or
        ``"mix-F"``; or the two signs ``sigma``.
    nu : (float, float), optional
        The two numbers of the two-fold, where the signs are given.
    sigma : (int, int), optional
        The signs by name, in place of the first argument.

    Returns
    -------
    Problem
        Its parameters are $nu1$ and $nu2$; its references are trace, determinant and discriminant of
        the sliding flow.

    Raises
    ------
    OptionError
        No class of that label; signs that are no signs, or without their numbers.

    Notes
    -----
    Source: Filippov 1988; Teixeira 1990; Colombo & Jeffrey 2011, SIAM J. Appl. Dyn. Syst. 10,
    423-451.

    Examples
    --------
    >>> two_fold("II-C").parameters == two_fold((-1, 1), (-2, -1)).parameters
    True
    >>> two_fold(sigma=(1, -1), nu=(0.5, 0.5)).system
    FilippovSystem(3 states: z1, z2, z3; 1 surface; parameters: nu1, nu2)
    """
    chosen = label if sigma is None else sigma
    if isinstance(chosen, str):
        name = chosen
        signs, numbers = _by_label(chosen, nu)
    else:
        signs, numbers = _checked(chosen, nu)
        name = f"sigma = {signs}, nu = {numbers}"
    z1, z2, z3, nu1, nu2 = (ca.SX.sym(s) for s in ("z1", "z2", "z3", "nu1", "nu2"))
    system = FilippovSystem(
        [z1, z2, z3],
        surface=z1,
        above=[-z2, -signs[0], nu1],
        below=[z3, nu2, signs[1]],
        parameters={nu1: numbers[0], nu2: numbers[1]},
    )
    product = signs[0] * signs[1]
    values = {
        "trace": (sum(numbers), "nu1 + nu2"),
        "determinant": (numbers[0] * numbers[1] + product, "nu1 nu2 + sigma1 sigma2"),
        "discriminant": (
            (numbers[0] - numbers[1]) ** 2 - 4 * product,
            "(nu1 - nu2)^2 - 4 sigma1 sigma2",
        ),
    }
    references = tuple(
        Reference(quantity, float(value), RELATIVE, f"of the sliding matrix: {how}")
        for quantity, (value, how) in values.items()
    )
    return problem(
        two_fold,
        system,
        (0.0, 1.0, 0.6),
        2.0,
        *references,
        title=f"Normal form of the two-fold, {name}",
    )


def _by_label(
    label: str, nu: Sequence[float] | None
) -> tuple[tuple[int, int], tuple[float, float]]:
    if label not in TWO_FOLDS:
        raise OptionError(
            f"label: expected one of {', '.join(TWO_FOLDS)}, or two signs with nu=, received "
            f"{label!r}. The labels are the classes of the two-fold's decision table."
        )
    if nu is not None:
        raise OptionError(
            f"nu: received {nu!r}, but the label {label!r} already fixes nu. Give the signs sigma to "
            "choose nu."
        )
    return TWO_FOLDS[label]


def _checked(
    sigma: Sequence[int], nu: Sequence[float] | None
) -> tuple[tuple[int, int], tuple[float, float]]:
    signs = tuple(sigma) if isinstance(sigma, (Sequence, np.ndarray)) else ()
    if len(signs) != 2 or any(s not in (-1, 1) for s in signs):
        raise OptionError(f"sigma: expected two signs, +1 or -1, received {sigma!r}.")
    numbers = np.asarray(nu, dtype=float) if nu is not None else np.zeros(0)
    if numbers.shape != (2,) or not np.all(np.isfinite(numbers)):
        raise OptionError(f"nu: expected two finite numbers, received {nu!r}.")
    return (int(signs[0]), int(signs[1])), (float(numbers[0]), float(numbers[1]))
