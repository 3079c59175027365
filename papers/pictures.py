"""A figure of a paper: what it is called, what it shows, and how to draw it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure


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
