"""A two-fold in words: what ``print(fold)`` shows."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

if TYPE_CHECKING:
    from .two_fold import TwoFold

_WIDTH = 98


def _count(number: float) -> str:
    if math.isnan(number):
        return "not decided at leading order"
    return {0.0: "none", 1.0: "one", math.inf: "infinitely many"}[number]


def _numbers(values: NDArray[Any]) -> str:
    def one(value: complex) -> str:
        if value.imag:
            return f"{value.real:.6g}{value.imag:+.6g}i"
        return f"{value.real:.6g}"

    return ", ".join(one(complex(v)) for v in values)


def _point(fold: TwoFold) -> str:
    size = max(1.0, *(abs(v) for v in fold.point))
    rounded = (0.0 if abs(v) < 1e-14 * size else v for v in fold.point)
    text = f"[{', '.join(f'{v:.10g}' for v in rounded)}]"
    return text + (f", t = {fold.t:.10g}" if fold.system.time_dependent else "")


def two_fold_in_words(fold: TwoFold) -> str:
    """Write the paragraph for a two-fold."""
    c = fold.classification
    title = f"{fold.kind.capitalize()} two-fold at {_point(fold)}"
    lines = [f"{title}, {'' if c.label.startswith('boundary') else 'class '}{c.label}."]
    (s1, s2), (n1, n2) = fold.sigma, fold.nu
    lines.append(f"sigma = ({s1:+d}, {s2:+d}), nu = ({n1:.6g}, {n2:.6g})")
    slopes = _numbers(fold.slopes)
    lines.append(f"eigenvalues {_numbers(fold.eigenvalues)} with slopes z3/z2 = {slopes}")
    lines.append(
        f"canards (Da -> s -> Dr): {_count(fold.canards)}; "
        f"faux canards (Dr -> s -> Da): {_count(fold.faux_canards)}"
    )
    if fold.coincident_fields:
        lines.append(
            "The two fields coincide at s: Delta = 0, the sliding flow is smooth through s and a "
            "run along it goes on."
        )
    lines.append(c.determinism)
    if fold.system.dimension > 3 and 1.0 in (c.canards, c.faux_canards):
        lines.append(
            f"With {fold.system.dimension} states two-folds form a set of dimension "
            f"{fold.system.dimension - 3}; one orbit reads a set of codimension one."
        )
    for boundary in c.boundaries:
        if boundary.harmless and not (fold.coincident_fields and boundary.name == "Delta=0"):
            lines.append(
                f"On the boundary {boundary.name} ({boundary.meaning}); the class is "
                f"{boundary.between[0]} on both sides."
            )
    if fold.iterations:
        plural = "" if fold.iterations == 1 else "s"
        lines.append(
            f"Found {fold.distance:.3g} from the start in {fold.iterations} iteration{plural}, "
            f"residual {fold.residual:.2g}."
        )
    wrapped = [textwrap.fill(line, _WIDTH, subsequent_indent="  ") for line in lines[:1]]
    wrapped += [
        textwrap.fill(line, _WIDTH, initial_indent="  ", subsequent_indent="  ")
        for line in lines[1:]
    ]
    return "\n".join(wrapped)
