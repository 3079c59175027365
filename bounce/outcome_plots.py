"""Pictures of outcome maps (matplotlib; reached as ``bounce.plot.outcome_map``)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import nonsmooth as ns

from .dividing import DividingCurve
from .outcomes import OutcomeMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Regions of the paper's eight itineraries: warm where the ball leaves in forward slip, cold where
#: in reverse (Okabe & Ito 2008 and tints of it; neighbours differ in grey as well).
COLOURS = {
    "S+": "#F6C7A3",
    "S+ R S+": "#D55E00",
    "S- R S+": "#F0E442",
    "S- S+": "#A05A2C",
    "S-": "#BCDDF5",
    "S- R S-": "#0072B2",
    "S+ R S-": "#56B4E9",
    "S+ S-": "#0B3C5D",
}
#: For other itineraries, in the order in which they occur.
MORE = ("#CC79A7", "#009E73", "#999999", "#7A5195", "#B7E4C7", "#5F5F5F", "#EBC4DB", "#00573F")

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
#: How many regions without room for their name are listed, the largest first.
_LISTED = 16
_QUANTITIES = ("itinerary", "slip", "spin_reversal", "lift_off_angle")


def outcome_map(
    outcomes: OutcomeMap,
    quantity: str = "itinerary",
    *,
    curve: DividingCurve | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw a map of outcomes: regions by name, or a quantity at lift-off.

    Parameters
    ----------
    outcomes : OutcomeMap
    quantity : {"itinerary", "slip", "spin_reversal", "lift_off_angle"}
    curve : DividingCurve, optional
        Drawn over a map of xdot and omega instead of the contour H_F = 0 of the map.
    ax : matplotlib Axes, optional
        Draw here instead of in a new figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    nonsmooth.OptionError
        Another quantity, or a curve over other axes.

    Examples
    --------
    >>> import numpy as np, bounce
    >>> turf = bounce.KelvinVoigt(mu=0.3, d1=0.1, d2=0.1, eta=0.5)
    >>> over = {"xdot": np.linspace(-2, 2, 30), "omega": np.linspace(-4, 4, 30)}
    >>> figure = bounce.plot.outcome_map(bounce.outcome_map(turf, over))
    >>> sorted(text.get_text() for text in figure.axes[0].texts)[:3]
    ['S+', 'S+ R S+', 'S+ R S-']
    """
    from matplotlib.figure import Figure

    if quantity not in _QUANTITIES:
        raise ns.OptionError(f"quantity: expected one of {_QUANTITIES}, received {quantity!r}.")
    if curve is not None and outcomes.names not in (("xdot", "omega"), ("omega", "xdot")):
        raise ns.OptionError(
            f"curve: expected a map over xdot and omega, received one over {outcomes.names}."
        )
    if ax is None:
        figure = Figure(figsize=(7.2, 5.6), layout="constrained")
        ax = figure.add_subplot()
    else:
        parent = ax.get_figure(root=True)
        assert parent is not None
        figure = parent
    if quantity == "itinerary":
        _regions(ax, outcomes)
    else:
        _field(figure, ax, outcomes, quantity)
    if curve is not None:
        _curve(ax, outcomes, curve)
    else:
        _contour(ax, outcomes)
    for axis, name in zip((ax.xaxis, ax.yaxis), outcomes.names, strict=True):
        axis.set_label_text(_LABELS.get(name, name))
    ax.set_xlim(*_ends(outcomes.axes[0]))
    ax.set_ylim(*_ends(outcomes.axes[1]))
    ax.set_title(_title(outcomes), fontsize=9, loc="left", color="0.3")
    return figure


def _regions(ax: Axes, outcomes: OutcomeMap) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    spare = iter(MORE * (1 + len(outcomes.regions) // len(MORE)))
    colours = [COLOURS.get(name) or next(spare) for name in outcomes.regions]
    palette = ListedColormap(["#FFFFFF", *colours])
    limits: dict[str, Any] = dict(vmin=-1.5, vmax=len(colours) - 0.5)
    ax.pcolormesh(
        *outcomes.axes, outcomes.code, cmap=palette, shading="nearest", rasterized=True, **limits
    )
    narrow: list[tuple[int, Patch]] = []
    for code, (name, colour) in enumerate(zip(outcomes.regions, colours, strict=True)):
        inside = outcomes.code == code
        if not _named(ax, outcomes, inside, name, colour):
            patch = Patch(facecolor=colour, edgecolor="0.3", linewidth=0.6, label=_short(name))
            narrow.append((int(inside.sum()), patch))
    if narrow:
        handles = [patch for _, patch in sorted(narrow, key=lambda pair: -pair[0])[:_LISTED]]
        if len(narrow) > _LISTED:
            handles.append(Patch(alpha=0, label=f"and {len(narrow) - _LISTED} more"))
        ax.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8,
            frameon=False, title="narrow regions", title_fontsize=8, borderaxespad=0.0,
        )  # fmt: skip


def _short(name: str) -> str:
    """The first phases of a long itinerary and its last."""
    phases = name.split()
    return name if len(phases) <= 8 else " ".join([*phases[:6], "..", phases[-1]])


def _named(
    ax: Axes, outcomes: OutcomeMap, inside: NDArray[np.bool_], name: str, colour: str
) -> bool:
    """Write a region's name where it is widest, if there is room for it."""
    from scipy.ndimage import distance_transform_edt

    room = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(int(np.argmax(room)), room.shape)
    if room.max() < max(0.03, 0.006 * len(name)) * min(inside.shape):
        return False
    place = (outcomes.axes[0][column], outcomes.axes[1][row])
    text = "white" if _luminance(colour) < 0.2 else "black"
    style: dict[str, Any] = dict(ha="center", va="center", fontsize=9, fontweight="bold")
    ax.annotate(name, place, color=text, zorder=6, **style)
    return True


def _field(figure: Figure, ax: Axes, outcomes: OutcomeMap, quantity: str) -> None:
    values = np.asarray(getattr(outcomes, quantity), dtype=float)
    values = np.where(outcomes.lift_offs.complete, values, np.nan)
    options: dict[str, Any] = dict(cmap="viridis")
    label = "angle above +x at lift-off (rad)"
    if quantity == "slip":
        bound = float(np.abs(np.nan_to_num(values)).max()) or 1.0
        options, label = dict(cmap="PuOr_r", vmin=-bound, vmax=bound), "slip at lift-off $H_F$"
    elif quantity == "spin_reversal":
        options, label = dict(cmap="cividis", vmin=0, vmax=1), "spin reverses"
    mesh = ax.pcolormesh(*outcomes.axes, values, shading="nearest", rasterized=True, **options)
    bar = figure.colorbar(mesh, ax=ax, label=label)
    if quantity == "spin_reversal":
        bar.set_ticks([0, 1], labels=["no", "yes"])


def _contour(ax: Axes, outcomes: OutcomeMap) -> None:
    """The border between forward and reverse slip, from the map's last phases."""
    last = [{"+": 1.0, "-": -1.0}.get(name[-1], 0.0) for name in outcomes.regions]
    sign = np.array([*last, np.nan])[outcomes.code]
    if np.any(sign < 0) and np.any(sign > 0):
        ax.contour(*outcomes.axes, sign, levels=[0.0], colors="black", linewidths=1.6)


def _curve(ax: Axes, outcomes: OutcomeMap, curve: DividingCurve) -> None:
    from matplotlib.legend import Legend

    order = [("xdot", "omega").index(name) for name in outcomes.names]
    styles: dict[str, Any] = {"two-fold": "-", "slipping": (0, (4, 1.5))}
    lines: dict[str, Any] = {}
    for arc in (*curve.arcs, *curve.reverse):
        for sign in (1, -1) if curve.mirrored else (1,):
            u, v = sign * arc.points[:, order].T
            (line,) = ax.plot(u, v, color="black", linewidth=2.0, linestyle=styles[arc.kind])
            lines[f"$H_F=0$, {arc.kind}"] = line
    if curve.junction is not None:
        for sign in (1, -1) if curve.mirrored else (1,):
            point = sign * curve.junction[order]
            ax.plot(*point, "o", color="white", markeredgecolor="black", markersize=6, zorder=8)
    # An artist of its own: the axes' legend may hold the narrow regions.
    ax.add_artist(
        Legend(
            ax, list(lines.values()), list(lines), loc="lower right", fontsize=8, framealpha=0.95
        )
    )


def _title(outcomes: OutcomeMap) -> str:
    values = {**outcomes.model.values, **outcomes.fixed}
    unchanged = dict(x=0.0, y=0.0, G=0.0, slope=0.0, inertia=0.4)
    shown = {n: v for n, v in values.items() if n not in outcomes.names and unchanged.get(n) != v}
    return f"{type(outcomes.model).__name__}: " + ", ".join(
        f"{n} = {v:g}" for n, v in shown.items()
    )


def _ends(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def _luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.1."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    r, g, b = (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b
