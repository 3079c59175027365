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
from .keys import below, is_narrow

style = ns.plot.style
Array = NDArray[np.float64]
Units = Mapping[str, tuple[str, str, float]]

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

#: Regions of the paper's eight itineraries: warm where the ball leaves in forward slip, cold where
#: in reverse (colours of the style and tints of them; neighbours differ in grey as well).
COLOURS = {
    "S+": "#F6C7A3",
    "S+ R S+": style.VERMILLION,
    "S- R S+": style.YELLOW,
    "S- S+": "#A05A2C",
    "S-": "#BCDDF5",
    "S- R S-": style.BLUE,
    "S+ R S-": style.SKY,
    "S+ S-": "#0B3C5D",
    # of the laws: slip throughout in the same colours, rolling at lift-off in those of its own side
    "I+": "#F6C7A3",
    "II+": style.GREEN,
    "III+": style.SKY,
    "III-": style.VERMILLION,
    "II-": "#B7E4C7",
    "I-": "#BCDDF5",
}
#: For other itineraries: each has one meaning on a map.
MORE = (
    style.PURPLE,
    "#999999",
    "#7A5195",
    "#5F5F5F",
    "#EBC4DB",
    "#00573F",
)

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
#: How many regions without room for their name are listed, the largest first, and the colour of the others.
_LISTED, _REST = 5, "#E4E4E4"
#: What the layout leaves of the height and the width of axes to the map, at least: keys need the rest.
_LEFT, _LEFT_COLUMN = np.array([1.0, 0.8]), np.array([0.8, 1.0])
_POINTS = 9.0  # of the names of regions
_TITLE = 9.0  # points
_JOINED = "\N{NO-BREAK SPACE}"
_NO_YES = ("#00224E", "#FEE838")  # the ends of cividis
_QUANTITIES = ("itinerary", "slip", "omega", "spin_reversal", "lift_off_angle")


def outcome_map(
    outcomes: OutcomeMap,
    quantity: str = "itinerary",
    *,
    curve: DividingCurve | None = None,
    speeds: str = "m/s",
    ax: Axes | None = None,
) -> Figure:
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

    Returns
    -------
    matplotlib.figure.Figure
        The figure, with ``savefig``; notebooks show it.

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
    with style.settings():
        figure, ax = style.axes_for(ax, (7.0, 5.4))
        size = _TITLE * (0.6 if is_narrow(ax) else 0.53)  # of a letter, on average
        letters = int(ax.bbox.width * 72 / figure.dpi / size)
        if quantity != "itinerary":
            _field(figure, ax, outcomes, quantity, x, y, units)
        lines = (
            _contour(ax, outcomes, x, y) if curve is None else draw_curve(ax, outcomes.names, curve)
        )
        patches: list[Patch] = []
        if quantity == "itinerary":
            room = _LISTED - len(lines) if is_narrow(ax) else _LISTED
            patches = _regions(ax, outcomes, x, y, room)
            lines |= _cases(ax, outcomes)
        _keys(ax, patches, lines)
        for axis, name in zip((ax.xaxis, ax.yaxis), outcomes.names, strict=True):
            what, unit, _ = units.get(name, (_LABELS.get(name, name), "", 1.0))
            axis.set_label_text(f"{what} ({unit})" if unit else what)
        ax.set_xlim(*_ends(x))
        ax.set_ylim(*_ends(y))
        title = textwrap.fill(_title(outcomes, units), letters)
        ax.set_title(title.replace(_JOINED, " "), fontsize=_TITLE, loc="left", color="0.3")
    return figure


def _regions(ax: Axes, outcomes: OutcomeMap, x: Array, y: Array, room: int) -> list[Patch]:
    """Colour the regions and name them; a key of those without room for their name.

    The key lists at most ``room`` of them, the largest; the others have one colour, so that each colour
    has one meaning.
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    clear = ~_turns(outcomes.slip)
    inside = [outcomes.code == code for code in range(len(outcomes.regions))]
    places = [
        _place(ax, x, y, cells & clear, name)
        for cells, name in zip(inside, outcomes.regions, strict=True)
    ]
    named = [code for code, place in enumerate(places) if place is not None]
    narrow = [code for code, place in enumerate(places) if place is None]
    narrow.sort(key=lambda code: -np.count_nonzero(inside[code]))
    listed = narrow if len(narrow) <= room + 1 else narrow[:room]  # not "and 1 more"
    spare = iter(MORE)
    colours = [_REST] * len(outcomes.regions)
    for code in (*listed, *named):
        colours[code] = COLOURS.get(outcomes.regions[code]) or next(spare, _REST)
    palette = ListedColormap(["#FFFFFF", *colours])
    limits: dict[str, Any] = dict(vmin=-1.5, vmax=len(colours) - 0.5)
    ax.pcolormesh(x, y, outcomes.code, cmap=palette, shading="nearest", rasterized=True, **limits)
    for code in named:
        place = places[code]
        assert place is not None
        ink = "white" if _luminance(colours[code]) < 0.2 else "black"
        look: dict[str, Any] = dict(color=ink, fontsize=_POINTS, fontweight="bold")
        style.write(ax, place, outcomes.regions[code], zorder=6, **look)
    column = is_narrow(ax)
    key = [(_short(outcomes.regions[code], column), colours[code]) for code in listed]
    if rest := narrow[len(listed) :]:
        key.append((f"and {len(rest)} more", _REST))
        _borders(ax, outcomes.code, rest, x, y)
    frame: dict[str, Any] = dict(edgecolor="0.3", linewidth=0.6)
    return [Patch(facecolor=colour, label=name, **frame) for name, colour in key]


def _turns(slip: Array) -> NDArray[np.bool_]:
    """Cells at which the slip changes its sign: a line is there."""
    sign = np.sign(slip)
    found = np.zeros(sign.shape, dtype=bool)
    found[1:] |= sign[1:] * sign[:-1] < 0
    found[:, 1:] |= sign[:, 1:] * sign[:, :-1] < 0
    return found


def _keys(ax: Axes, patches: list[Patch], lines: dict[str, Any]) -> None:
    """Say what lines are, below the map, and which regions are narrow, beside it."""
    if is_narrow(ax):  # beside a legend little of the map would be left
        labels = [str(patch.get_label()) for patch in patches]
        below(ax, [*lines.values(), *patches], [*lines, *labels])
        return
    if patches:
        ax.legend(
            handles=patches, loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8,
            frameon=False, title="narrow regions", title_fontsize=8, borderaxespad=0.0,
        )  # fmt: skip
    below(ax, list(lines.values()), list(lines))


def _cases(ax: Axes, outcomes: OutcomeMap) -> dict[str, Any]:
    """What the cases of a law on the map mean, for the key; in a column there is no room for it."""
    from matplotlib.patches import Patch

    met = {case for name in outcomes.regions for case in name.rstrip("+-").split("/")}
    said = [f"{case}: {CASES[case]}" for case in CASES if case in met]
    if is_narrow(ax) or not said:
        return {}
    said.append("+, −: sign of the slip at touch-down")
    return {text: Patch(alpha=0) for text in said}


def _short(name: str, column: bool) -> str:
    """The first phases of a long itinerary, its last and how many they are; fewer in a column."""
    phases, most = name.split(), 5 if column else 8
    if len(phases) <= most:
        return name
    return " ".join([*phases[: most // 2], "..", phases[-1], f"({len(phases)})"])


def _borders(ax: Axes, code: NDArray[Any], rest: Sequence[int], x: Array, y: Array) -> None:
    """Thin lines between regions that have the same colour."""
    from matplotlib.collections import LineCollection

    left, low = ([axis[0], *((axis[1:] + axis[:-1]) / 2), axis[-1]] for axis in (x, y))
    shared = np.isin(code, rest)
    lines = []
    for row, col in np.argwhere((code[:, 1:] != code[:, :-1]) & shared[:, 1:] & shared[:, :-1]):
        lines.append([(left[col + 1], low[row]), (left[col + 1], low[row + 1])])
    for row, col in np.argwhere((code[1:] != code[:-1]) & shared[1:] & shared[:-1]):
        lines.append([(left[col], low[row + 1]), (left[col + 1], low[row + 1])])
    ax.add_collection(
        LineCollection(lines, colors="0.72", linewidths=0.4, zorder=1, rasterized=True)
    )


def _place(
    ax: Axes, x: Array, y: Array, inside: NDArray[np.bool_], name: str
) -> tuple[float, float] | None:
    """Where a region is widest, if its name has room there."""
    from scipy.ndimage import distance_transform_edt, minimum_filter

    room = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    letters = np.array([1.3, 0.72 * len(name)]) * _POINTS  # height and width of the name
    left = _LEFT_COLUMN if is_narrow(ax) else _LEFT
    frame = np.array([ax.bbox.height, ax.bbox.width]) * left * 72 / ax.figure.dpi
    cells = np.ceil(letters / frame * inside.shape).astype(int)
    fits = minimum_filter(inside, size=tuple(cells), mode="constant", cval=0)
    room = np.where(fits, room, 0.0)
    row, column = np.unravel_index(int(np.argmax(room)), room.shape)
    if room.max() < 0.03 * min(inside.shape):
        return None
    return float(x[column]), float(y[row])


def _field(
    figure: Figure,
    ax: Axes,
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
        from matplotlib.colors import ListedColormap

        options = dict(cmap=ListedColormap(_NO_YES), vmin=-0.5, vmax=1.5)
        label = "spin reverses"
    mesh = ax.pcolormesh(x, y, values, shading="nearest", rasterized=True, **options)
    bar = figure.colorbar(mesh, ax=ax, label=label)
    if quantity == "spin_reversal":
        bar.set_ticks([0, 1], labels=["no", "yes"])


def _contour(ax: Axes, outcomes: OutcomeMap, x: Array, y: Array) -> dict[str, Any]:
    """Where the slip at lift-off changes its sign; what rolls at lift-off has none."""
    slip = np.where(outcomes.lift_offs.complete, outcomes.slip, np.nan)
    rolls = np.array([*(name.endswith("R") for name in outcomes.regions), False])[outcomes.code]
    size = np.abs(np.nan_to_num(slip)).max()
    slip = np.where(rolls | (np.abs(slip) < 1e-12 * size), 0.0, slip)
    if not (np.any(slip < 0) and np.any(slip > 0)):
        return {}
    lines = ax.contour(x, y, slip, levels=[0.0], colors="black", linewidths=1.6)
    lines.set(path_effects=style.halo(3.0))
    return {"slip at lift-off $H_F=0$": lines.legend_elements()[0][0]}


def draw_curve(ax: Axes, names: Sequence[str], curve: DividingCurve) -> dict[str, Any]:
    """Draw a dividing curve over axes that show xdot and omega, in the order of ``names``.

    Returns
    -------
    dict of str: Artist
        What is to be said of its lines and points, with one of each.
    """
    order = [("xdot", "omega").index(name) for name in names]
    styles: dict[str, Any] = {"two-fold": "-", "slipping": (0, (4, 1.5))}
    key: dict[str, Any] = {}
    for arc in (*curve.arcs, *curve.reverse):
        for sign in (1, -1) if curve.mirrored else (1,):
            u, v = sign * arc.points[:, order].T
            (line,) = ax.plot(u, v, color="black", linewidth=2.0, linestyle=styles[arc.kind])
            key[f"$H_F=0$, {arc.kind}"] = line
    if curve.junction is not None:
        look: dict[str, Any] = dict(color="white", markeredgecolor="black", markersize=6, zorder=8)
        for sign in (1, -1) if curve.mirrored else (1,):
            point = sign * curve.junction[order]
            (dot,) = ax.plot(*point, "o", **look)
            key["their junction"] = dot
    return key


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


def _luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.1."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    r, g, b = (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b
