"""Titles, line styles and names in pictures of two-folds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ...local import TwoFold
from ...local.two_folds import Classification, ReducedFlow, classify_two_fold
from ...local.two_folds.reduced_flow import Sector, eigenlines
from ...model import Array, DefinitionError
from .. import style
from ..labels import Labels

#: An eigenvalue that the decision table counts as zero.
ZERO = 1e-9
#: Of the regions, by the signs of z2 and z3.
TINTS = {
    (1, 1): style.TINT_ATTRACTING,
    (-1, -1): style.TINT_REPELLING,
    (-1, 1): style.TINT_CROSSING,
    (1, -1): style.TINT_CROSSING,
}
_SIGNS = {1: "+", -1: "−"}


@dataclass(frozen=True)
class Portrait:
    """The reduced flow of a two-fold and its class."""

    flow: ReducedFlow
    classification: Classification
    coincident: bool = False


def portrait_of(fold: object, caller: str) -> Portrait:
    """The flow and class of a two-fold, or of a pair (sigma, nu)."""
    if isinstance(fold, TwoFold):
        return Portrait(fold.form.flow, fold.classification, fold.coincident_fields)
    try:
        pair: Any = fold
        (s1, s2), (n1, n2) = pair
        sigma, nu = (int(s1), int(s2)), (float(n1), float(n2))
    except (TypeError, ValueError) as error:
        raise DefinitionError(
            f"{caller} cannot draw {type(fold).__name__} {str(fold)[:60]!r}. Give a two-fold from "
            "find_two_fold, or a pair (sigma, nu) such as ((1, -1), (-2.0, -0.5))."
        ) from error
    return Portrait(ReducedFlow(sigma, nu), classify_two_fold(sigma, nu))


def title_of(portrait: Portrait) -> str:
    """Class, signs and numbers in one or two lines."""
    flow, found = portrait.flow, portrait.classification
    numbers = ", ".join(number(v) for v in flow.nu)
    signs = ", ".join(_SIGNS[s] for s in flow.sigma)
    name = found.label.removeprefix("boundary ").replace("Delta", "Δ")
    extra = [b.name.replace("Delta", "Δ").replace("nu", "ν") for b in found.boundaries]
    if portrait.coincident:
        extra = ["coincident fields"]
    elif not found.label.startswith("boundary") and extra:
        extra = [f"on {e}" for e in extra]
    else:
        extra = []
    first = f"{name} ({', '.join([f'{flow.kind} two-fold', *extra])})"
    return f"{first}\nσ = ({signs}), ν = ({numbers})"


def line_style(value: float, flow: ReducedFlow) -> tuple[str, str, Any]:
    """Colour, name and dashes of an eigenline of Da by its eigenvalue."""
    if abs(value) < ZERO:
        return style.BLACK, "pseudo-equilibria", ":"
    color, name = (style.CANARD, "canard") if value < 0 else (style.FAUX_CANARD, "faux canard")
    values = [v for v, _ in eigenlines(flow)]
    if len(values) == 2 and values[0] * values[1] > 0:
        strength = "strong" if abs(value) == max(map(abs, values)) else "weak"
        name = f"{strength} {name}"
    return color, name, "-" if value < 0 else style.LONG_DASH


def label_points(parts: list[Sector]) -> dict[str, Array]:
    """Points of the names of the regions in the z2-z3 plane, away from the eigenlines."""
    widest = max(parts, key=lambda part: part.high - part.low)
    middle = 0.84 * to_box((widest.low + widest.high) / 2)
    return {
        r"$D_a$": middle,
        r"$D_r$": -middle,
        r"$C_1$": np.array([-0.85, 0.85]),
        r"$C_2$": np.array([0.85, -0.85]),
    }


def to_box(angle: float) -> Array:
    """Point of the unit square's edge at an angle."""
    direction = np.array([math.cos(angle), math.sin(angle)])
    return direction / np.max(np.abs(direction))


def number(value: float) -> str:
    return f"{value:.4g}".replace("-", "−")


def line_names(ax: Axes, portrait: Portrait, passages: bool = True) -> None:
    """Name the folds, the lines outside of sliding and the parts of crossing orbits."""
    labels, flow, along = Labels(ax), portrait.flow, np.linspace(0.1, 0.98, 23)
    both = np.concatenate([-along[::-1], along])
    for k, (name, color) in enumerate((("F_1", style.ABOVE), ("F_2", style.BELOW))):
        seen = "visible" if flow.folds[k] == "V" else "invisible"
        points = np.zeros((len(both), 2))
        points[:, 1 - k] = both
        labels.name(f"fold of ${name}$,\n{seen}", points, color)
    names = {"diabolo 0": "diabolo,\nflights grow", "diabolo 1": "diabolo,\nflights shrink"}
    names["virtual eigenline"] = "virtual\neigenline"
    for gid, text in names.items():
        lines = [line for line in ax.lines if line.get_gid() == gid]
        if lines:
            ends = np.vstack([line.get_xydata() for line in lines])
            points = np.vstack([end * along[:, None] for end in ends if np.any(end)])
            labels.name(text, points, lines[0].get_color(), keep=_crossing)
    if not passages:
        return
    before, after = (
        [line for line in ax.lines if line.get_gid() == f"crosses {n}"] for n in (0, 1)
    )
    for lines, text in ((before, "below"), (after, "above")):  # those of C1
        middles = [np.mean(np.asarray(line.get_xydata()), axis=0) for line in lines]
        labels.name(text, middles, lines[0].get_color(), keep=_crossing)


def _crossing(points: Array) -> Array:
    """Whether points of the z2-z3 plane are where orbits cross."""
    return np.asarray(points[:, 0] * points[:, 1] <= 0.0)
