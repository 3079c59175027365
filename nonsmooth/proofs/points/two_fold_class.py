"""The class of a two-fold from enclosures of its second Lie derivatives.

Every decision is a sign of a polynomial in L11, L12, L21, L22, so that boundaries between classes are
decided at points that are known exactly: Delta = nu1 nu2 + sigma1 sigma2 has the sign of
L11 L22 - L12 L21, T = nu1 + nu2 that of L12 - L21, and g - 2 of mixed folds follows from squares.
The table itself is that of ``nonsmooth.two_folds``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..arithmetic.eigenvalues import roots
from ..arithmetic.flint import arb
from ..arithmetic.intervals import hull, sign

FOLDS = {(1, -1): "VV", (-1, 1): "II", (1, 1): "VI", (-1, -1): "IV"}


@dataclass(frozen=True)
class ProvenClass:
    """The class of a two-fold, or why it is undecided."""

    sigma: tuple[int, int]
    label: str
    why: str = ""
    numbers: dict[str, arb] = field(default_factory=dict)


def proven_class(second: Sequence[arb], coincident: bool = False) -> ProvenClass:
    """The class, from enclosures of L11, L12, L21, L22."""
    l11, l12, l21, l22 = second
    s = sign(l11), sign(l22)
    if 0 in s:
        return ProvenClass(
            s, "", f"L11 in {l11.str(5)}, L22 in {l22.str(5)}: a sign is undecided (a cusp-fold?)"
        )
    if coincident:
        l12, l21 = _both(l12, l22), _both(l21, l11)
    size = _product(abs(l11), abs(l22))
    root = size.sqrt()
    delta = arb(0) if coincident else l11 * l22 - l12 * l21
    trace = l12 - l21
    lean = s[0] * (-l21 - l12)  # g = lean/root
    gap = lean * lean - 4 * size
    # Where L1j = L2j, g = -(|L11| + |L22|)/root <= -2.
    above = -1 if coincident or lean < 0 or gap < 0 else 1 if lean > 0 and gap > 0 else 0
    jordan = not coincident and bool(lean > 0 and gap.is_zero())
    t = -s[0] if coincident and s[0] != s[1] else sign(trace)  # there that of L22 - L11
    label = _label(FOLDS[s], delta, t, above)
    if jordan:
        between = {-1: "mix-0|mix-C", 1: "mix-0|mix-F"}.get(sign(trace), "")
        label = f"boundary disc=0: {between}" if FOLDS[s] in ("VI", "IV") and between else label
    nu1, nu2 = l12 / root, -l21 / root
    if coincident:  # nu1 nu2 = -sigma1 sigma2, and both numbers follow from one ratio
        nu1 = s[1] * _ratio(abs(l22), abs(l11)).sqrt()
        nu2 = -s[0] * _ratio(abs(l11), abs(l22)).sqrt()
    numbers = _numbers(nu1, nu2, delta if coincident else delta / size, sign(trace))
    why = (
        ""
        if label
        else (
            f"Delta in {numbers['Delta'].str(5)}, T in {numbers['T'].str(5)}, g - 2 in "
            f"{(lean / root - 2).str(5)}: signs are undecided"
        )
    )
    return ProvenClass(s, label, why, numbers)


def _product(a: arb, b: arb) -> arb:
    """Product of positive numbers by their ends, so that wide ones stay positive."""
    return hull(a.lower() * b.lower(), a.upper() * b.upper())


def _ratio(a: arb, b: arb) -> arb:
    """Quotient of positive numbers by their ends."""
    return hull(a.lower() / b.upper(), a.upper() / b.lower())


def _both(a: arb, b: arb) -> arb:
    return a.intersection(b) if a.overlaps(b) else a


def _label(folds: str, delta: arb, t: int, above: int) -> str:
    d = sign(delta)
    if folds == "VV":
        if d < 0 or t < 0:
            return "VV-C1"
        return _either(delta, t > 0, "VV-F", "VV-C1|VV-F")
    if folds == "II":
        if d < 0 or t > 0:
            return "II-F"
        return _either(delta, t < 0, "II-C", "II-C|II-F")
    if above < 0:
        return "mix-0"
    if above == 0:
        return ""
    if d < 0:
        return "mix-S"
    node = {-1: "mix-C", 1: "mix-F"}.get(t, "")
    return _either(delta, bool(node), node, f"mix-S|{node}")


def _either(delta: arb, holds: bool, label: str, between: str) -> str:
    """A label where Delta > 0, a boundary where Delta = 0."""
    if not holds:
        return ""
    return label if delta > 0 else f"boundary Delta=0: {between}" if delta.is_zero() else ""


def _numbers(nu1: arb, nu2: arb, delta: arb, trace: int) -> dict[str, arb]:
    t = nu1 + nu2
    found = {"nu1": nu1, "nu2": nu2, "Delta": delta, "T": t}
    both = roots(t / 2, t * t / 4 - delta, delta, trace)
    if both is None:
        return found
    (low, left), (high, right) = both
    if left.is_zero():
        return found | {"eigenvalue_low": low, "eigenvalue_high": high}
    return found | {"eigenvalue_real": low, "eigenvalue_imaginary": right}
