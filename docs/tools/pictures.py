"""Draw the README's pictures again: `python docs/tools/pictures.py`.

It runs the programs in the README, so the pictures are what the text beside them draws.
"""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "images"


def program() -> str:
    """Return the Python blocks of README.md as one program; it saves the pictures."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    if not blocks:
        raise LookupError("README.md: expected ```python blocks that draw, found none")
    return "\n".join(blocks)


def names() -> list[str]:
    """Names of the pictures that the program saves."""
    return re.findall(r'savefig\("(\w+\.png)"\)', program())


def draw(folder: Path) -> list[Path]:
    """Run the program in a folder and return the pictures that it saves there."""
    here = Path.cwd()
    try:
        os.chdir(folder)
        exec(compile(program(), "README.md", "exec"), {"__name__": "readme"})
    finally:
        os.chdir(here)
    return [folder / name for name in names()]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for path in draw(Path(folder)):
            (FOLDER / path.name).write_bytes(path.read_bytes())
            print(f"docs/images/{path.name}")
