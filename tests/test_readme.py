"""The Python code blocks of README.md run as written, in order, as one program."""

import re
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)


def python_blocks(text):
    """Return the source of each Python block, moved down to the lines it has in the text."""
    return ["\n" * text[: m.start(1)].count("\n") + m.group(1) for m in BLOCK.finditer(text)]


def test_blocks_run_in_order_in_one_namespace(tmp_path, monkeypatch):
    blocks = python_blocks(README.read_text(encoding="utf-8"))
    assert blocks, "README.md has no ```python block"
    monkeypatch.chdir(tmp_path)  # what the blocks save stays out of the repository
    namespace = {"__name__": "readme"}
    for source in blocks:
        exec(compile(source, "README.md", "exec"), namespace)


def test_blocks_are_found_with_their_lines():
    text = "# T\n\n```python\na = 1\n```\n\n```sh\nmake\n```\n\n```python\nb = a\n```\n"
    assert python_blocks(text) == ["\n" * 3 + "a = 1\n", "\n" * 11 + "b = a\n"]
