"""Figures of papers: what each shows, the look of print, and a check that it is legible."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.path import Path as MplPath
from matplotlib.text import Text
from matplotlib.transforms import Affine2D
from mpl_toolkits.mplot3d.art3d import Text3D
from numpy.typing import ArrayLike, NDArray

from nonsmooth.plot import style
from nonsmooth.plot.labels import Labels as Labels

_PRINT = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "pdf.fonttype": 42,
}


@dataclass(frozen=True)
class Picture:
    """A figure: the name of its files, the paper's label or a few words, a caption, and its program."""

    name: str
    label: str
    caption: str
    draw: Callable[[], Figure]

    def save(self, folder: Path) -> None:
        """Draw the figure and write it as PNG and PDF."""
        figure = self.draw()
        figure.savefig(folder / f"{self.name}.png", dpi=150)
        figure.savefig(folder / f"{self.name}.pdf", dpi=150, metadata={"CreationDate": None})


class Pictures(list[Picture]):
    """The figures of a paper, each drawn by a function, whose docstring is the caption."""

    def __call__(
        self, label: str, name: str = "", caption: str = ""
    ) -> Callable[[Callable[[], Figure]], Callable[[], Figure]]:
        """Register a function, which draws with the settings of print."""

        def register(draw: Callable[[], Figure]) -> Callable[[], Figure]:
            @wraps(draw)
            def drawn() -> Figure:
                with settings():
                    return draw()

            words = caption or " ".join((draw.__doc__ or "").split())
            self.append(Picture(name or draw.__name__, label, words, drawn))
            return drawn

        return register


@contextmanager
def settings() -> Iterator[None]:
    """Apply the library's style with the sizes of print inside a ``with`` block."""
    with style.settings(_PRINT):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure (inches) that is unknown to pyplot."""
    return style.new_figure((width, height))


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure with one axes of equal scales and no frame, for schematic drawings."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure, axes


def sampled(
    function: Callable[[float], ArrayLike], at: ArrayLike, turn: float = 4.0, most: int = 200
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample curves more densely where they bend: no angle above ``turn`` degrees, ``most`` points."""
    values = {float(x): np.atleast_1d(np.asarray(function(float(x)), float)) for x in np.ravel(at)}
    while len(values) < most:
        xs = np.array(sorted(values))
        ys = np.array([values[x] for x in xs])
        dx = np.diff(xs)[:, None] / np.ptp(xs)
        dy = np.diff(ys, axis=0) / np.where(np.ptp(ys, axis=0) > 0, np.ptp(ys, axis=0), 1.0)
        angle = np.degrees(np.arctan2(dy, dx))
        bends = np.abs(np.diff(angle, axis=0)) > turn
        long = np.hypot(dx, dy) > 2e-3
        near = np.zeros(len(dx), dtype=bool)
        near[:-1] |= np.any(bends & long[:-1], axis=1)
        near[1:] |= np.any(bends & long[1:], axis=1)
        new = [(a + b) / 2 for a, b, k in zip(xs[:-1], xs[1:], near, strict=True) if k]
        if not new:
            break
        for x in new[: most - len(values)]:
            values[float(x)] = np.atleast_1d(np.asarray(function(float(x)), float))
    xs = np.array(sorted(values))
    return xs, np.array([values[x] for x in xs])


#: The width of a page in inches, the smallest text in points, and the longest legend, of print.
PAGE, SMALLEST, LISTED = 7.0, 8.0, 6


def illegible(figure: Figure) -> list[str]:
    """Sentences on what is not legible in print: width, small, cut or overlapping texts, long legends."""
    width, found = figure.get_figwidth(), list[str]()
    if width > PAGE:
        found.append(f"it is {width:g} inches wide, more than the {PAGE:g} of a page.")
    for _ in range(2):  # as saving does: the first layout does not know how high titles are
        figure.draw_without_rendering()
    for legend in figure.findobj(Legend):
        entries = [text.get_text() for text in legend.get_texts()]
        if len(entries) > LISTED:
            found.append(f"a legend has {len(entries)} entries: label the things themselves.")
    found += _overlaps(figure) + _across_frames(figure)
    paper = figure.bbox.padded(1.0)  # pixel
    for text in _texts(figure):
        if text.get_fontsize() < SMALLEST - 0.01:
            found.append(f"{text.get_text()!r} is in {text.get_fontsize():g} point.")
        box = text.get_window_extent()
        inside = text.get_clip_on() and text.get_clip_box() is not None and text.axes is not None
        clipped = inside and not text.axes.bbox.overlaps(box)
        in_space = isinstance(text, Text3D)  # whose place is known only while it is drawn
        if not (clipped or in_space or (paper.contains(*box.p0) and paper.contains(*box.p1))):
            found.append(f"{text.get_text()!r} is cut off.")
    return found


def _overlaps(figure: Figure) -> list[str]:
    """Texts that lie on one another; a little is left for the empty room above and below letters."""
    texts = [t for t in _texts(figure) if not isinstance(t, Text3D)]
    shapes = [(text, _shape(text)) for text in texts]
    return [
        f"{one.get_text()!r} is on {other.get_text()!r}."
        for k, (one, a) in enumerate(shapes)
        for other, b in shapes[k + 1 :]
        if a.get_extents().overlaps(b.get_extents()) and a.intersects_path(b, filled=True)
    ]


def _across_frames(figure: Figure) -> list[str]:
    """Texts in axes that begin inside of the frame and end outside."""
    found = list[str]()
    for axes in figure.axes:
        framed = any(spine.get_visible() for spine in axes.spines.values())
        if not (axes.get_visible() and axes.axison and framed):
            continue
        within = [child for part in axes.artists for child in part.get_children()]
        for text in [*axes.texts, *(t for t in within if isinstance(t, Text))]:
            if isinstance(text, Text3D) or not (text.get_visible() and text.get_text().strip()):
                continue
            box = text.get_window_extent().padded(-2.0)
            inside = axes.bbox.contains(*box.p0) and axes.bbox.contains(*box.p1)
            if axes.bbox.overlaps(box) and not inside:
                found.append(f"{text.get_text()!r} is across the frame.")
    return found


def _shape(text: Text) -> MplPath:
    """The rectangle that a text fills, turned as it is; in pixels."""
    angle, where = text.get_rotation(), text.get_window_extent()
    middle = [(where.x0 + where.x1) / 2, (where.y0 + where.y1) / 2]
    text.set_rotation(0.0)
    box = text.get_window_extent()
    text.set_rotation(angle)
    half = max(box.width / 2 - 1.5, 0.1), max(box.height / 2 - 2.5, 0.1)
    corners = [
        (a * half[0], b * half[1]) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    turn = Affine2D().rotate_deg(angle).translate(*middle)
    return MplPath(turn.transform(corners))


def _texts(figure: Figure) -> list[Text]:
    """All texts that are seen."""
    unseen = set[int]()
    for axes in figure.axes:
        if not (axes.get_visible() and axes.axison):
            frame = [axes.xaxis, axes.yaxis, *([axes.zaxis] if hasattr(axes, "zaxis") else [])]
            unseen |= {id(text) for axis in frame for text in axis.findobj(Text)}
        for axis in (axes.xaxis, axes.yaxis, *([axes.zaxis] if hasattr(axes, "zaxis") else [])):
            low, high = sorted(axis.get_view_interval())
            ticks = [*axis.majorTicks, *axis.minorTicks]
            shown = {*axis.get_majorticklocs(), *axis.get_minorticklocs()}  # others are left over
            outside = [
                t for t in ticks if t.get_loc() not in shown or not low <= t.get_loc() <= high
            ]
            unseen |= {id(text) for tick in outside for text in tick.findobj(Text)}
    texts = [text for text in figure.findobj(Text) if isinstance(text, Text)]
    shown = [text for text in texts if text.get_visible() and text.get_text().strip()]
    return [text for text in shown if id(text) not in unseen]
