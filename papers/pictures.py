"""A figure of a paper: what it is called, what it shows, and how to draw it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.path import Path as MplPath
from matplotlib.text import Text
from matplotlib.transforms import Affine2D
from mpl_toolkits.mplot3d.art3d import Text3D


@dataclass(frozen=True)
class Picture:
    """A figure of the paper.

    Attributes
    ----------
    name : str
        Of the files.
    label : str
        The paper's, or a few words.
    caption : str
    draw : callable
    """

    name: str
    label: str
    caption: str
    draw: Callable[[], Figure]


def save(picture: Picture, folder: Path) -> list[Path]:
    """Draw a figure and write it as PNG and PDF.

    Returns
    -------
    list of Path
    """
    figure = picture.draw()
    paths = [folder / f"{picture.name}.{kind}" for kind in ("png", "pdf")]
    for path in paths:
        figure.savefig(
            path, dpi=150, metadata={"CreationDate": None} if path.suffix == ".pdf" else None
        )
    return paths


#: The width of a page in inches, the smallest text in points, and the longest legend, of print.
PAGE, SMALLEST, LISTED = 7.0, 8.0, 6


def faults(figure: Figure) -> list[str]:
    """What would not do in print: the width, texts too small, cut off or on others, long legends.

    Parameters
    ----------
    figure : matplotlib Figure

    Returns
    -------
    list of str
        A sentence for each fault.
    """
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
