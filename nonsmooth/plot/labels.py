"""Placement of names beside the things they name, without overlap and hiding little."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform
from numpy.typing import ArrayLike

from ..model import Array
from . import style

_CELL = 1.5  # points, of the grid of occupied cells
_GAPS = (4.0, 9.0, 16.0, 25.0, 36.0)  # points, from a thing to its name
_LEADER = 8.0  # points: over a longer gap a thin line leads to the thing
_MARK = 3.5  # points: from the middle of a mark to where that line ends
_ANCHORS = 24  # points along a thing that are tried
_TEXT = 40.0  # the cost of lying on other texts, in shares of a name's area
_FAR = 0.02  # the same for a point of distance
_APART = 5.0  # points, between names
_HEAD = 14.0  # points: arrowheads are shorter
_OWN = 7.5  # points: as far from the middle of a mark may be its corner
_CROSSED = 6.0  # the cost of a line to the thing that lies on other marks or names
_CONFUSED = 1.0  # the cost of a name that is closer to another named point
_ASTRAY = 4.0  # the cost of a name that is nowhere where it may be
_SPOTS = np.array([(a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 1.0)] + [(0.0, 0.0)])
_DIRECTIONS = np.array(
    [(a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0) if (a, b) != (0.0, 0.0)]
    + [(a, b) for a in (-0.5, 0.5) for b in (-1.0, 1.0)]
)


#: Whether points (m, 2), in data coordinates, are where a name may be.
Keep = Callable[[Array], Any]


@dataclass
class _Name:
    text: Text
    leader: Line2D
    anchors: Array
    inside: bool
    keep: Keep | None


@dataclass
class _Spot:
    """A position of a name, its cost, and the ends of a leader line if it has one."""

    name: _Name
    cost: float = 0.0
    position: tuple[float, float] | None = None
    leader: Array | None = None

    def use(self) -> None:
        """Put the name there; hide it if it has no position."""
        for part in (self.name.text, self.name.leader):
            part.set_visible(self.position is not None)
        if self.position is not None:
            self.name.text.set_position(self.position)
            self.name.leader.set_data(*([], []) if self.leader is None else self.leader.T)


class Labels(Artist):
    """Names of things in axes, placed anew each time the figure is drawn."""

    def __init__(self, ax: Axes):
        super().__init__()
        self.home = ax
        self.names: list[_Name] = []
        self.seen: object = None  # for what the names are placed
        self.set_zorder(9.0)
        self.set_in_layout(False)
        ax.add_artist(self)

    def name(
        self,
        text: str,
        anchors: ArrayLike,
        color: Any = style.BLACK,
        *,
        inside: bool = False,
        keep: Keep | None = None,
        **options: Any,
    ) -> None:
        """Name a thing."""
        points = np.atleast_2d(np.asarray(anchors, dtype=float))
        step = max(1, -(-len(points) // _ANCHORS))
        look = {
            "fontsize": style.points(8.0),
            "ha": "center",
            "va": "center",
            "color": color,
            "linespacing": 1.0,
        }
        artist = Text(0, 0, text, **{**look, **options})
        leader = Line2D([], [], linewidth=0.6)
        for part in (artist, leader):
            part.axes = self.home
            part.set_figure(self.home.figure)
            part.set_transform(IdentityTransform())
            part.set_in_layout(False)
        self.names.append(_Name(artist, leader, points[step // 2 :: step], inside, keep))

    def get_children(self) -> list[Artist]:
        """The texts."""
        return [name.text for name in self.names]

    def draw(self, renderer: Any, *args: Any, **options: Any) -> None:
        """Place the names and draw them."""
        if not self.get_visible() or not self.names:
            return
        self._arrange(renderer)
        paper = style.paper_of(self.home)
        halo = style.halo(2.5, paper)[:1]
        for name in self.names:
            name.leader.set(color=name.text.get_color(), path_effects=style.halo(1.6, paper))
            name.leader.draw(renderer)
        for name in self.names:  # a line of text over the halo of the next one, not under it
            for effects in (halo, []):
                name.text.set_path_effects(effects)
                name.text.draw(renderer)
        self.stale = False

    def _arrange(self, renderer: Any) -> None:
        axes = self.home
        point = renderer.points_to_pixels(1.0)
        box = axes.get_window_extent(renderer).bounds
        seen = (point, box, axes.viewLim.bounds, len(axes.lines), len(axes.texts), len(self.names))
        if seen == self.seen:
            return
        self.seen = seen
        room = _Room(axes, renderer, _CELL * point, self)
        free, found = room.texts, list[tuple[float, list[_Spot]]]()
        for order in _orders(self.names):
            room.texts = free.copy()
            spots = [self._best(name, room, renderer) for name in order]
            found.append((sum(spot.cost for spot in spots), spots))
        for spot in min(found, key=lambda tried: tried[0])[1]:
            spot.use()

    def _best(self, name: _Name, room: _Room, renderer: Any) -> _Spot:
        """The best position of a name, which is then occupied."""
        point = room.point
        name.text.set_position((0.0, 0.0))
        box = name.text.get_window_extent(renderer)
        size = np.array([box.width, box.height]) + 2.0 * point
        anchors = self.home.transData.transform(name.anchors)
        anchors = anchors[room.contains(anchors)]
        if not len(anchors):
            return _Spot(name)
        gaps: Sequence[float] = (0.0,) if name.inside else _GAPS
        offsets = [_DIRECTIONS * (size / 2 + gap * point) for gap in gaps]
        offset = np.zeros((1, 2)) if name.inside else np.vstack(offsets)
        far = np.repeat(gaps, len(offset) // len(gaps))
        target = (anchors[:, None] + offset).reshape(-1, 2)
        tried = room.within(target, size)
        moved = np.linalg.norm(tried - target, axis=1) / point
        cost = room.cost(tried, size) + _FAR * (np.tile(far, len(anchors)) + moved)
        if not name.inside:
            own = np.repeat(anchors, len(offset), 0)
            cost += _CROSSED * room.crossed(own, tried, size)
            cost += _CONFUSED * self._confused(name, own, tried, size)
        if name.keep is not None:
            cost += _ASTRAY * self._astray(tried, size, name.keep)
        k = int(np.argmin(cost))
        room.take(tried[k], size + _APART * point)
        anchor = anchors[k // len(offset)]
        near = np.clip(anchor, tried[k] - size / 2, tried[k] + size / 2)
        mark = anchor + (near - anchor) * min(
            1.0, _MARK * point / np.hypot(*(near - anchor) + 1e-9)
        )
        ends = np.array([mark, near]) if far[k % len(offset)] > _LEADER else None
        middle = np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2
        return _Spot(name, float(cost[k]), tuple(tried[k] - middle), ends)

    def _confused(self, name: _Name, own: Array, middles: Array, size: Array) -> Array:
        """Whether rectangles (m, 2) are closer to the point of another name than to their own (m, 2)."""
        others = [n.anchors for n in self.names if n is not name and len(n.anchors) == 1]
        others = [at for at in others if not np.array_equal(at, name.anchors)]
        if not others:
            return np.zeros(len(middles))
        points = self.home.transData.transform(np.vstack(others))
        gaps = _gaps(middles[:, None], points, size).min(axis=1)
        return np.asarray(gaps < _gaps(middles, own, size) - 1e-6, dtype=float)

    def _astray(self, middles: Array, size: Array, keep: Keep) -> Array:
        """Share of corners and middles of rectangles (m, 2) where a name may not be."""
        spots = middles[:, None] + _SPOTS * size / 2
        data = self.home.transData.inverted().transform(spots.reshape(-1, 2))
        return np.mean(~np.asarray(keep(data), dtype=bool).reshape(len(middles), -1), axis=1)


def _orders(names: list[_Name]) -> list[list[_Name]]:
    """Orders in which names are tried: names of points first, in several directions."""
    few = sorted(names, key=lambda name: len(name.anchors))
    points = [name for name in few if len(name.anchors) == 1]
    rest = few[len(points) :]
    if len(points) < 2:
        return [few]
    across = [sorted(points, key=lambda name: float(name.anchors[0, k])) for k in (0, 1)]
    ways = [points, points[::-1], *across, *(way[::-1] for way in across)]
    return [[*way, *rest] for way in ways]


class _Room:
    """Occupancy of axes on a grid of cells: lines, and texts and marks."""

    def __init__(self, ax: Axes, renderer: Any, cell: float, mine: Labels):
        box = ax.get_window_extent(renderer)
        self.corner, self.cell = np.array([box.x0, box.y0]), cell
        self.point = cell / _CELL
        self.size = np.array([box.width, box.height])
        nx, ny = np.maximum(np.ceil(self.size / cell).astype(int), 1)
        self.lines, self.texts = np.zeros((nx, ny)), np.zeros((nx, ny))
        for line in ax.lines:
            self._line(line, renderer)
        for patch in ax.patches:
            if isinstance(patch, FancyArrowPatch):
                self._arrow(patch, renderer)
        for text in ax.texts:
            if text.get_visible():
                frame = text.get_bbox_patch()
                extent = (frame or text).get_window_extent(renderer)
                self.take(np.mean(extent.get_points(), axis=0), np.array(extent.size))
        for other in ax.artists:
            if isinstance(other, Labels) and other is not mine:
                self._names(other, renderer)
        legend = ax.get_legend()
        if legend is not None:
            extent = legend.get_window_extent(renderer)
            self.take(np.mean(extent.get_points(), axis=0), np.array(extent.size))

    def contains(self, points: Array) -> Array:
        """Whether points (m, 2) are in the axes, in pixels."""
        share = (points - self.corner) / self.size
        return np.all((share >= -1e-9) & (share <= 1 + 1e-9), axis=1)

    def within(self, middles: Array, size: Array) -> Array:
        """Middles (m, 2) of rectangles of a size, moved so that they are in the axes."""
        low = self.corner + size / 2 + self.cell / 2
        high = np.maximum(self.corner + self.size - size / 2 - self.cell / 2, low)
        return np.clip(middles, low, high)

    def _line(self, line: Line2D, renderer: Any) -> None:
        if not line.get_visible():
            return
        points = line.get_transform().transform(line.get_xydata())
        points = points[np.all(np.isfinite(points), axis=1)]
        if not len(points):
            return
        if line.get_linestyle() not in ("None", "none", "", " ") and len(points) > 1:
            limit = self.size.max()
            low, high = self.corner - limit, self.corner + self.size + limit
            dense = _dense(np.clip(points, low, high), self.cell)
            weight = max(1.0, (float(line.get_linewidth()) / 1.5) ** 3)
            i, j = self._cells(dense[self.contains(dense)])
            self.lines[i, j] = np.maximum(self.lines[i, j], weight)
        if line.get_marker() not in ("None", "none", "", " ", None):
            side = renderer.points_to_pixels(line.get_markersize() + 2.0)
            for point in points[self.contains(points)]:
                self.take(point, np.full(2, side))

    def _names(self, other: Labels, renderer: Any) -> None:
        """Names that were placed before."""
        for name in other.names:
            if name.text.get_visible():
                extent = name.text.get_window_extent(renderer)
                self.take(np.mean(extent.get_points(), axis=0), np.array(extent.size))

    def _arrow(self, patch: FancyArrowPatch, renderer: Any) -> None:
        """An arrowhead; long arrows are lines, which have their own."""
        extent = patch.get_window_extent(renderer)
        middle = np.mean(extent.get_points(), axis=0)
        if max(extent.width, extent.height) > renderer.points_to_pixels(_HEAD):
            return
        if self.contains(middle[None])[0]:
            (a, b), (c, d) = (np.array(self._cells(p[None])).T[0] for p in extent.get_points())
            self.lines[a : c + 1, b : d + 1] = 2.0

    def _cells(self, points: Array) -> tuple[Any, Any]:
        at = ((points - self.corner) / self.cell).astype(int)
        i, j = np.clip(at, 0, np.array(self.lines.shape) - 1).T
        return i, j

    def take(self, middle: Array, size: Array) -> None:
        """Keep names off a rectangle."""
        low = np.floor((middle - size / 2 - self.corner) / self.cell).astype(int)
        high = np.ceil((middle + size / 2 - self.corner) / self.cell).astype(int)
        (a, b), (c, d) = np.maximum(low, 0), np.maximum(high, 0)
        self.texts[a:c, b:d] = 1.0

    def crossed(self, anchors: Array, middles: Array, size: Array) -> Array:
        """Share of lines from anchors (m, 2) to rectangles (m, 2) that is on texts and marks of others."""
        ways = np.clip(anchors, middles - size / 2, middles + size / 2) - anchors
        points = anchors[:, None] + np.linspace(0.0, 1.0, 12)[:, None] * ways[:, None]
        others = np.linalg.norm(points - anchors[:, None], axis=2) > _OWN * self.point
        i, j = self._cells(points.reshape(-1, 2))
        return np.asarray(
            np.mean((self.texts[i, j] * others.ravel()).reshape(len(ways), -1), axis=1)
        )

    def cost(self, middles: Array, size: Array) -> Array:
        """Hidden share of the area of rectangles (m, 2); infinite outside of the axes."""
        low = np.round((middles - size / 2 - self.corner) / self.cell).astype(int)
        high = np.round((middles + size / 2 - self.corner) / self.cell).astype(int)
        shape = np.array(self.lines.shape)
        outside = np.any((low < 0) | (high > shape), axis=1)
        low, high = np.clip(low, 0, shape), np.clip(high, 0, shape)
        area = np.maximum(np.prod(size) / self.cell**2, 1.0)
        found = np.where(outside, 1e6, 0.0)
        for weight, layer in ((1.0, self.lines), (_TEXT, self.texts)):
            total = np.zeros(shape + 1)
            total[1:, 1:] = layer.cumsum(axis=0).cumsum(axis=1)
            (a, b), (c, d) = low.T, high.T
            found += weight * (total[c, d] - total[a, d] - total[c, b] + total[a, b]) / area
        return found


def _gaps(middles: Array, points: Array, size: Array) -> Array:
    """Distances of rectangles of a size from points, in pixels."""
    away = np.maximum(np.abs(points - middles) - size / 2, 0.0)
    return np.asarray(np.linalg.norm(away, axis=-1))


def _dense(points: Array, step: float) -> Array:
    """Points along a polyline, no further apart than a step."""
    parts = np.maximum(np.ceil(np.linalg.norm(np.diff(points, axis=0), axis=1) / step), 1).astype(
        int
    )
    index = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(index)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[index]
    return np.asarray(points[index] + share[:, None] * np.diff(points, axis=0)[index])
