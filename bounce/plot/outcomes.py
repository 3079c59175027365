"""Pictures of outcome maps (matplotlib; reached as ``bounce.plot.outcome_map``)."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from ..errors import require
from ..laws.law import CASES
from ..maps.dividing import DividingCurve
from ..maps.outcomes import OutcomeMap
from ..units import UNITS
from .keys import is_narrow, keys
from .regions import LISTED, regions

style = ns.plot.style
Canvas = ns.plot.Canvas
canvas = ns.plot.canvas
Array = NDArray[np.float64]
Units = Mapping[str, tuple[str, str, float]]

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

#: Axes of landings in SI units as golfers read them: name, unit, and the unit in SI.
_GOLF = {
    "speed": ("landing speed", "m/s", 1.0),
    "angle": ("angle of descent", "deg", math.pi / 180),
    "spin": ("backspin", "rpm", math.pi / 30),
}
_LABELS = {
    "xdot": r"speed $\dot X_0$",
    "ydot": r"normal speed $\dot Y_0$",
    "omega": r"spin $\Omega_0$",
    "x": r"$X_0$",
    "y": r"$Y_0$",
    "mu": r"friction $\mu$",
    "eta": r"frequency ratio $\eta$",
    "d1": r"$d_1$",
    "d2": r"$d_2$",
    "G": r"gravity $G$",
}
_TITLE = 9.0  # points
_JOINED = "\N{NO-BREAK SPACE}"
_NO_YES = {"no": "#00224E", "yes": "#FEE838"}  # the ends of cividis
_QUANTITIES = ("itinerary", "slip", "omega", "spin_reversal", "lift_off_angle")


def outcome_map(
    outcomes: OutcomeMap,
    quantity: str = "itinerary",
    *,
    curve: DividingCurve | None = None,
    speeds: str = "m/s",
    ax: Axes | None = None,
    size: tuple[float, float] | None = None,
    legend: bool = True,
    title: str | None = None,
    colors: Mapping[str, Any] | None = None,
    **look: Any,
) -> Any:
    """Draw a map of outcomes: regions by name, or a quantity at lift-off.

    Parameters
    ----------
    outcomes : OutcomeMap
        The map, from :func:`bounce.outcome_map`.
    quantity : {"itinerary", "slip", "omega", "spin_reversal", "lift_off_angle"}
        ``omega`` is the spin at lift-off.
    curve : DividingCurve, optional
        Drawn over a map of ``xdot`` and ``omega`` instead of the contour $H_F = 0$ of the map.
    speeds : {"m/s", "km/h", "mph", "ft/s"}
        Unit of speeds on a map of golfers' landings.
    ax : matplotlib Axes, optional
        Draw here instead of in a new figure.
    size : (width, height), optional
        Of a new figure, in inches.
    legend : bool, optional
        Whether a legend is drawn.
    title : str, optional
        Title of the picture.
    colors : mapping, optional
        Colours by the names of regions, such as ``{"S+": "tab:red"}``.
    **look
        Properties of ``matplotlib.lines.Line2D``, such as ``linestyle``, for the dividing curve.

    Returns
    -------
    matplotlib Figure or Axes
        The new figure, which pyplot knows; the axes if they were given.

    Raises
    ------
    nonsmooth.OptionError
        Another quantity or unit, or a curve over other axes.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> over = {"xdot": np.linspace(-2, 2, 30), "omega": np.linspace(-4, 4, 30)}
    >>> figure = bounce.plot.outcome_map(bounce.outcome_map(turf, over))
    >>> sorted(text.get_text() for text in figure.axes[0].texts)[:3]
    ['S+', 'S+ R S+', 'S+ R S-']
    """
    if quantity not in _QUANTITIES:
        raise ns.OptionError(f"quantity: expected one of {_QUANTITIES}, received {quantity!r}.")
    require(outcomes, OutcomeMap, "outcomes", "bounce.outcome_map returns one.")
    if curve is not None and outcomes.names not in (("xdot", "omega"), ("omega", "xdot")):
        raise ns.OptionError(
            f"curve: expected a map over xdot and omega, received one over {outcomes.names}."
        )
    units = _golfers(speeds)
    x, y = _axes(outcomes, units)
    with canvas(ax, size, (7.0, 5.4), colors=colors, look=look, title=title) as page:
        ax = page.ax
        if title is None:
            size_ = style.points(_TITLE)
            width = size_ * (0.6 if is_narrow(ax) else 0.53)  # of a letter, on average
            letters = int(ax.bbox.width * 72 / page.figure.dpi / width)
            text = textwrap.fill(_title(outcomes, units), letters)
            ax.set_title(text.replace(_JOINED, " "), fontsize=size_, loc="left")
        if quantity != "itinerary":
            _field(page, outcomes, quantity, x, y, units)
        lines = (
            _contour(page, outcomes, x, y)
            if curve is None
            else draw_curve(page, outcomes.names, curve, (_ends(x), _ends(y)))
        )
        lines |= _without_lift_off(page, outcomes) | _outside(page, outcomes, x, y)
        patches: list[Patch] = []
        if quantity == "itinerary":
            room = LISTED - len(lines) if is_narrow(ax) else LISTED
            patches = regions(page, outcomes, x, y, room)
            lines |= _cases(ax, outcomes)
        if legend:
            keys(ax, patches, lines, "narrow regions")
        for axis, name in zip((ax.xaxis, ax.yaxis), outcomes.names, strict=True):
            what, unit, _ = units.get(name, (_LABELS.get(name, name), "", 1.0))
            axis.set_label_text(f"{what} ({unit})" if unit else what)
        ax.set_xlim(*_ends(x))
        ax.set_ylim(*_ends(y))
    return page.drawn


def _without_lift_off(page: Canvas, outcomes: OutcomeMap) -> dict[str, Any]:
    """Hatch what lies behind the map, where landings without lift-off leave it open; its entry of the key."""
    from matplotlib.patches import Patch

    if outcomes.lift_offs.complete.all():
        return {}
    hatched: Any = {"hatch": "////", "linewidth": 0.0}
    page.ax.patch.set(facecolor=page.paper, edgecolor=page.on_paper("0.45"), **hatched)
    return {"no lift-off": Patch(facecolor="white", edgecolor="0.45", **hatched)}


def _outside(page: Canvas, outcomes: OutcomeMap, x: Array, y: Array) -> dict[str, Any]:
    """Hatch the landings that are outside those that the law was fitted to; their entry of the key."""
    if outcomes.extrapolated is None or not outcomes.extrapolated.any():
        return {}
    from contourpy import contour_generator
    from matplotlib.patches import Patch, PathPatch
    from matplotlib.path import Path

    look: Any = {"facecolor": "none", "edgecolor": "0.25", "hatch": "...", "linewidth": 0.0}
    mask = outcomes.extrapolated.astype(float)
    areas: Any = contour_generator(x, y, mask, fill_type="OuterCode").filled(0.5, 1.5)
    for points, codes in zip(*areas, strict=True):
        page.ax.add_patch(PathPatch(Path(points, codes), zorder=2, gid="extrapolated", **look))
    return {"outside the landings of the fit": Patch(**look)}


def _cases(ax: Axes, outcomes: OutcomeMap) -> dict[str, Any]:
    """Meanings of the cases of a law on the map, for the key, if there is room."""
    from matplotlib.patches import Patch

    cases = {case for name in outcomes.regions for case in name.rstrip("+-").split("/")}
    texts = [f"{case}: {CASES[case]}" for case in CASES if case in cases]
    if is_narrow(ax) or not texts:
        return {}
    texts.append("+, −: sign of the slip at touch-down")
    return {text: Patch(alpha=0) for text in texts}


def _field(
    page: Canvas,
    outcomes: OutcomeMap,
    quantity: str,
    x: Array,
    y: Array,
    units: Units,
) -> None:
    from_lift_off = outcomes.lift_offs.omega if quantity == "omega" else None
    values = from_lift_off if from_lift_off is not None else getattr(outcomes, quantity)
    values = np.asarray(values, dtype=float)
    values = np.where(outcomes.lift_offs.complete, values, np.nan)
    options: dict[str, Any] = dict(cmap="viridis")
    label = "angle above +x at lift-off (rad)"
    if quantity == "lift_off_angle" and _golf(outcomes):
        values, label = np.degrees(values), "angle above +x at lift-off (deg)"
    if quantity in ("slip", "omega"):
        spin = (
            r"spin at lift-off $R\,\omega_F$" if _golf(outcomes) else r"spin at lift-off $\Omega_F$"
        )
        label = "slip at lift-off $H_F$" if quantity == "slip" else spin
        if _golf(outcomes):
            _, unit, size = units["speed"]
            values, label = values / size, f"{label} ({unit})"
        bound = float(np.abs(np.nan_to_num(values)).max()) or 1.0
        options = dict(cmap="PuOr_r", vmin=-bound, vmax=bound)
    elif quantity == "spin_reversal":
        options = dict(
            cmap=page.palette(page.color(*pair) for pair in _NO_YES.items()), vmin=-0.5, vmax=1.5
        )
        label = "spin reverses"
    mesh = page.ax.pcolormesh(x, y, values, shading="nearest", rasterized=True, **options)
    bar = page.figure.colorbar(mesh, ax=page.ax, label=label)
    if quantity == "spin_reversal":
        bar.set_ticks([0, 1], labels=["no", "yes"])


def _contour(page: Canvas, outcomes: OutcomeMap, x: Array, y: Array) -> dict[str, Any]:
    """Curves on which the slip at lift-off changes its sign; a rolling ball has none."""
    slip = np.where(outcomes.lift_offs.complete, outcomes.slip, np.nan)
    rolls = np.array([*(name.endswith("R") for name in outcomes.regions), False])[outcomes.code]
    size = np.abs(np.nan_to_num(slip)).max()
    slip = np.where(rolls | (np.abs(slip) < 1e-12 * size), 0.0, slip)
    if not (np.any(slip < 0) and np.any(slip > 0)):
        return {}
    from contourpy import contour_generator
    from matplotlib.lines import Line2D

    look = page.look("dividing curve", color="black", linewidth=1.6)
    curves: Any = contour_generator(x, y, np.ma.masked_invalid(slip)).lines(0.0)
    for curve in curves:
        page.ax.plot(*curve.T, path_effects=style.halo(3.0), **look)
    return {"slip at lift-off $H_F=0$": Line2D([], [], **look)}


def draw_curve(
    page: Canvas, names: Sequence[str], curve: DividingCurve, view: Sequence[Sequence[float]]
) -> dict[str, Any]:
    """Draw a dividing curve within ``view``, and return a label and an artist for each kind of line."""
    order = [("xdot", "omega").index(name) for name in names]
    styles: dict[str, Any] = {"two-fold": "-", "slipping": (0, (4, 1.5))}
    key: dict[str, Any] = {}
    for arc in (*curve.arcs, *curve.reverse):
        for sign in (1, -1) if curve.mirrored else (1,):
            u, v = sign * arc.points[:, order].T
            look = page.look(arc.kind, color="black", linewidth=2.0, linestyle=styles[arc.kind])
            (line,) = page.ax.plot(u, v, **look)
            if _in_view(u, v, view):
                key[f"$H_F=0$, {arc.kind}"] = line
    if curve.junction is not None:
        mark: dict[str, Any] = dict(color="white", markeredgecolor="black", markersize=6, zorder=8)
        for sign in (1, -1) if curve.mirrored else (1,):
            point = sign * curve.junction[order]
            (dot,) = page.ax.plot(*point, "o", **mark)
            if _in_view(point[0], point[1], view):
                key["their junction"] = dot
    return key


def _in_view(u: Any, v: Any, view: Sequence[Sequence[float]]) -> bool:
    """Whether a point is within limits."""
    (left, right), (low, high) = view
    return bool(np.any((u >= left) & (u <= right) & (v >= low) & (v <= high)))


def _title(outcomes: OutcomeMap, units: Units) -> str:
    options = {n: v for n, v in outcomes.model.options().items() if isinstance(v, float)}
    values = {**outcomes.model.values, **options, **outcomes.fixed}
    unchanged = dict(x=0.0, y=0.0, G=0.0, slope=0.0, inertia=0.4)
    shown = {n: v for n, v in values.items() if n not in outcomes.names and unchanged.get(n) != v}
    parts = []
    for name, value in shown.items():
        _, unit, size = units.get("angle" if name == "tilt" else name, ("", "", 1.0))
        parts.append(f"{name} = {_digits(value, size)} {unit}".rstrip().replace(" ", _JOINED))
    return f"{type(outcomes.model).__name__}: " + ", ".join(parts)


def _digits(value: float, size: float) -> str:
    """A value in a unit; one that was converted to four digits, which is what the landing was typed with."""
    shown = value / size
    if size == 1.0:
        return f"{shown:g}"
    return f"{shown:.0f}" if abs(shown) >= 1e4 else f"{shown:.4g}"


def _golf(outcomes: OutcomeMap) -> bool:
    """Whether the landings are in SI units."""
    return bool({*outcomes.names, *outcomes.fixed} & set(_GOLF))


def _golfers(speeds: str) -> Units:
    """Golfers' axes with speeds in a unit."""
    known = UNITS["speed"]
    if speeds not in known:
        raise ns.OptionError(f"speeds: expected one of {tuple(known)}, received {speeds!r}.")
    return {**_GOLF, "speed": (_GOLF["speed"][0], speeds, known[speeds])}


def _axes(outcomes: OutcomeMap, units: Units) -> list[Array]:
    """Axes in the units of their labels."""
    sizes = [units.get(name, ("", "", 1.0))[2] for name in outcomes.names]
    return [values / size for values, size in zip(outcomes.axes, sizes, strict=True)]


def _ends(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if low < high else (low - 0.5, high + 0.5)
