"""Tutorials as notebooks: the cells of a page, executed, with what they print and draw.

A tutorial is a Markdown page whose Python blocks run in order. A line `<!-- picture: what it shows -->`
after a block says that the variable `figure` is to be shown there. While the site is built the blocks
are executed once; the page gets the pictures, and a notebook with all outputs is offered beside it.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_PART = re.compile(
    r"^```python\n(?P<source>.*?)^```$(?:\n*^```text\n(?P<output>.*?)^```$)?"
    r"(?:\n*^<!-- picture: (?P<alt>.*?) -->$)?",
    re.MULTILINE | re.DOTALL,
)


@dataclass
class Cell:
    """A piece of a tutorial: Markdown or a program, with what it printed and its pictures by kind of file."""

    text: str
    program: bool
    alt: str = ""
    printed: str = ""
    pictures: dict[str, bytes] = field(default_factory=dict)


def cells(page: str) -> Iterator[Cell]:
    """Split a page; shown outputs are left out, for running the programs makes them again."""
    end = 0
    for found in _PART.finditer(page):
        if text := page[end : found.start()].strip():
            yield Cell(text, program=False)
        yield Cell(found["source"].rstrip("\n"), program=True, alt=found["alt"] or "")
        end = found.end()
    if text := page[end:].strip():
        yield Cell(text, program=False)


def run(page: str, name: str = "tutorial") -> list[Cell]:
    """Run the programs of a page in order and keep what they print and draw."""
    namespace: dict[str, Any] = {"__name__": name}
    done = list(cells(page))
    for k, cell in enumerate(done):
        if cell.program:
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile(cell.text, f"{name}[{k}]", "exec"), namespace)
            cell.printed = printed.getvalue()
            if cell.alt:
                cell.pictures = {kind: _drawn(namespace["figure"], kind) for kind in ("svg", "png")}
    return done


def _drawn(figure: Any, kind: str) -> bytes:
    stream = io.BytesIO()
    nothing = {"Date": None} if kind == "svg" else None
    figure.savefig(stream, format=kind, bbox_inches="tight", dpi=120, metadata=nothing)
    return stream.getvalue()


def with_pictures(page: str, name: str) -> str:
    """The page with its pictures, the files `name-1.svg` and so on."""
    numbers = iter(range(1, 1000))
    return re.sub(
        r"^<!-- picture: (.*?) -->$",
        lambda found: f"![{found[1]}](tutorials/{name}-{next(numbers)}.svg)",
        page,
        flags=re.MULTILINE,
    )


def files(done: list[Cell], name: str) -> dict[str, bytes]:
    """Pictures and the notebook of a tutorial, by address."""
    drawn = [cell.pictures["svg"] for cell in done if cell.pictures]
    found = {f"tutorials/{name}-{k}.svg": picture for k, picture in enumerate(drawn, 1)}
    found[f"tutorials/{name}.ipynb"] = (json.dumps(notebook(done), indent=1) + "\n").encode()
    return found


def notebook(done: list[Cell]) -> dict[str, Any]:
    """A notebook of format 4.5."""
    count = iter(range(1, 1000))
    made = []
    for k, cell in enumerate(done):
        common = {"id": f"cell-{k}", "metadata": {}, "source": cell.text.splitlines(keepends=True)}
        if cell.program:
            number = next(count)
            common |= {"execution_count": number, "outputs": _outputs(cell)}
        made.append({"cell_type": "code" if cell.program else "markdown", **common})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    version = ".".join(map(str, sys.version_info[:3]))
    language = {"name": "python", "version": version}
    return {
        "cells": made,
        "metadata": {"kernelspec": kernel, "language_info": language},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def _outputs(cell: Cell) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    if cell.printed:
        text = cell.printed.splitlines(keepends=True)
        found.append({"name": "stdout", "output_type": "stream", "text": text})
    if cell.pictures:
        data = {
            "image/png": base64.b64encode(cell.pictures["png"]).decode(),
            "text/plain": [f"<Figure: {cell.alt}>"],
        }
        found.append({"data": data, "metadata": {}, "output_type": "display_data"})
    return found


def refresh(path: Path) -> None:
    """Write what the blocks of a page print into the page: `python docs/tools/notebooks.py PAGE`."""
    page = path.read_text(encoding="utf-8")
    done = iter([cell for cell in run(page, path.stem) if cell.program])

    def block(found: re.Match[str]) -> str:
        cell = next(done)
        shown = f"```python\n{cell.text}\n```"
        if cell.printed:
            shown += f"\n\n```text\n{cell.printed.rstrip()}\n```"
        return shown + (f"\n\n<!-- picture: {cell.alt} -->" if cell.alt else "")

    path.write_text(_PART.sub(block, page), encoding="utf-8")


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        refresh(Path(argument))
