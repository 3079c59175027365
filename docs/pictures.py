"""Draw the README's picture again: `python docs/pictures.py`.

It runs the program in the README, so the picture is what the text beside it draws.
"""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "images" / "two_fold.png"


def first_program() -> str:
    """Return the first Python block of README.md, which saves the picture."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.search(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    if found is None:
        raise LookupError("README.md: expected a ```python block that draws a two-fold, found none")
    return found.group(1)


def draw(folder: Path) -> Path:
    """Run the program in a folder and return the picture that it saves there."""
    here = Path.cwd()
    try:
        os.chdir(folder)
        exec(compile(first_program(), "README.md", "exec"), {"__name__": "readme"})
    finally:
        os.chdir(here)
    return folder / PICTURE.name


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        PICTURE.write_bytes(draw(Path(folder)).read_bytes())
    print(PICTURE.relative_to(ROOT))
