"""HTML representations of results for notebooks: a title, rows, and a small picture as SVG.

Results without a representation of their own show their fields (:func:`shown_fields`). All text is escaped. Pictures need no other package.
"""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


#: Okabe & Ito 2008, without yellow, which is too pale for lines.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_WIDTH, _HEIGHT = 260, 88
_MOST = 300  # points of a drawn line
_LONGEST = 240  # characters of a cell
_MANY = 12  # numbers of an array, or entries of a list, that are written out
_NUMBER = "{:.4g}"


def representation(title: str, rows: Iterable[tuple[str, object]], picture: str = "") -> str:
    """Return HTML of a title and rows of a name and a value, beside a picture."""
    shown = [(name, _cell(value)) for name, value in rows]
    body = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{value}</td></tr>" for name, value in shown if value
    )
    return f"<div><b>{html.escape(title)}</b><table>{body}</table>{picture}</div>"


class Markup(str):
    """HTML that a representation shows as it is."""


def shown_fields(result: Any) -> str:
    """Representation of a result: its public fields."""
    shown = [field.name for field in dataclasses.fields(result) if not field.name.startswith("_")]
    return representation(
        type(result).__name__, [(name, _short(getattr(result, name))) for name in shown]
    )


def _short(value: Any) -> object:
    """A value of a field in a few words."""
    if callable(value) or value is None:
        return ""
    if isinstance(value, (bool, str, int)) or not isinstance(value, (float, complex, np.ndarray)):
        own = getattr(type(value), "_repr_html_", shown_fields)
        if own is not shown_fields:
            return Markup(own(value))
        if isinstance(value, (list, tuple, dict)) and len(value) > _MANY:
            return f"{len(value)} entries"
        return value if len(str(value)) > 0 and value != () and value != [] else ""
    array = np.asarray(value)
    if array.size > _MANY:
        return f"array {array.shape}"
    if array.dtype.kind not in "fc":
        return np.array2string(array, separator=", ")
    return np.array2string(array, precision=6, separator=", ") if array.ndim else f"{value:.6g}"


def _cell(value: object) -> str:
    if isinstance(value, Markup):
        return value
    text = str(value)
    cut = text if len(text) <= _LONGEST else text[: _LONGEST - 4] + " ..."
    return html.escape(cut).replace("\n", "<br>")


def lines(t: ArrayLike, columns: ArrayLike, names: Sequence[str]) -> str:
    """Draw values over time, each between its own extremes; SVG."""
    along, values = np.asarray(t, float), np.asarray(columns, float)
    keep = np.unique(np.linspace(0, len(along) - 1, min(len(along), _MOST)).astype(int))
    along, values = along[keep], values[keep]
    fine = np.isfinite(along) & np.isfinite(values).all(axis=1)
    along, values = along[fine], values[fine]
    if len(along) < 2:
        return ""
    drawn = []
    for k, name in list(enumerate(names))[: len(COLOURS)]:
        points = np.column_stack([_scaled(along, _WIDTH), _HEIGHT - _scaled(values[:, k], _HEIGHT)])
        drawn.append(_polyline(points, COLOURS[k]))
        low, high = (_NUMBER.format(v) for v in (values[:, k].min(), values[:, k].max()))
        text = html.escape(f"{name}: {low} to {high}")
        drawn.append(
            f'<text x="{_WIDTH + 14}" y="{12 + 15 * k}" font-size="12" fill="{COLOURS[k]}">{text}</text>'
        )
    ends = html.escape(" to ".join(_NUMBER.format(v) for v in (along[0], along[-1])))
    drawn.append(f'<text x="4" y="{_HEIGHT + 20}" font-size="11" fill="#777">{ends}</text>')
    return _svg(_WIDTH + 200, _HEIGHT + 26, drawn)


def circle(values: Iterable[complex]) -> str:
    """Draw multipliers beside the unit circle; SVG. Those far outside are at the edge."""
    size, unit = 104, 40
    drawn = [
        f'<circle cx="{size / 2}" cy="{size / 2}" r="{unit}" fill="none" stroke="#777"/>',
        f'<line x1="0" x2="{size}" y1="{size / 2}" y2="{size / 2}" stroke="#ccc"/>',
        f'<line y1="0" y2="{size}" x1="{size / 2}" x2="{size / 2}" stroke="#ccc"/>',
    ]
    for value in map(complex, values):
        if not np.isfinite(value):
            continue
        reach = 1.22 / max(1.22, abs(value))
        at = size / 2 + unit * np.array([value.real, -value.imag]) * reach
        colour = COLOURS[1] if abs(value) > 1 + 1e-9 else COLOURS[0]
        drawn.append(f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="3.5" fill="{colour}"/>')
    return _svg(size, size, drawn)


def quadrants(slopes: Iterable[float]) -> str:
    """Draw the sliding regions next to a two-fold with the eigenlines in them; SVG."""
    size = 104
    half = size / 2
    drawn = [
        f'<rect x="{half}" y="0" width="{half}" height="{half}" fill="#DCEBF5"/>',
        f'<rect x="0" y="{half}" width="{half}" height="{half}" fill="#EFCB8C"/>',
        f'<line x1="0" x2="{size}" y1="{half}" y2="{half}" stroke="#0072B2" stroke-width="2"/>',
        f'<line y1="0" y2="{size}" x1="{half}" x2="{half}" stroke="#D55E00" stroke-width="2"/>',
    ]
    for slope in slopes:
        if np.isfinite(slope):
            across = half * np.array([1.0, slope]) / max(1.0, abs(slope))
            sliding = slope > 0
            points = [(half - across[0], half + across[1]), (half + across[0], half - across[1])]
            drawn.append(_polyline(np.array(points), "#A8005C" if sliding else "#999"))
    drawn.append(f'<circle cx="{half}" cy="{half}" r="3" fill="#000"/>')
    return _svg(size, size, drawn)


def _scaled(values: Array, size: float) -> Array:
    low, high = float(values.min()), float(values.max())
    with np.errstate(over="ignore", invalid="ignore"):
        part = (values - low) / (high - low) if high > low else np.full(len(values), 0.5)
    return np.nan_to_num(4 + (size - 8) * part, nan=size / 2)


def _polyline(points: Array, colour: str) -> str:
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>'


def _svg(width: float, height: float, drawn: Iterable[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}">{"".join(drawn)}</svg>'
    )
