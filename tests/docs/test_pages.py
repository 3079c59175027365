"""The Python blocks of every page and of README.md run, in order, as one program, and print what the page says."""

import ast
import builtins
import contextlib
import doctest
import importlib
import io
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(DOCS.glob("*.md"))

# An optional comment, a block of Python, and the text it prints, if it is shown.
BLOCK = re.compile(
    r"(?:^<!-- (?P<note>not run|needs): (?P<what>.*?) -->\n)?"
    r"^```python[^\n]*\n(?P<source>.*?)^```[ ]*$"
    r"(?:\n*^```text\n(?P<output>.*?)^```[ ]*$)?",
    re.MULTILINE | re.DOTALL,
)
SAME = doctest.NORMALIZE_WHITESPACE


def check_block(name, line, source, required, namespace):
    """Run one block and compare what it prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile("\n" * (line - 1) + source, name, "exec"), namespace)
    if required is not None:
        agrees = doctest.OutputChecker().check_output(required, printed.getvalue(), SAME)
        assert agrees, f"{name}:{line}: expected\n{required}\nprinted\n{printed.getvalue()}"


@pytest.mark.slow_cases("branches", "coming_from", "golf", "recipes", "start", "trades")
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.slow) if page.stem.startswith("tutorial_") else page
        for page in [*PAGES, DOCS.parent / "README.md"]
    ],
    ids=lambda page: page.stem,
)
def test_blocks_run_and_print_what_the_page_says(page, tmp_path, monkeypatch):
    text = page.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)  # what a block saves stays out of the repository
    namespace = {"__name__": page.stem}
    for found in BLOCK.finditer(text):
        if found["note"] == "not run" or (found["note"] == "needs" and not present(found["what"])):
            continue
        line = text[: found.start("source")].count("\n") + 1
        check_block(page.name, line, found["source"], found["output"], namespace)


def test_programs_run_by_themselves():
    """Each of the README, and with the imports of the page each section of the recipes by trade, has all its names."""
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    programs = [found["source"] for found in BLOCK.finditer(text)]
    imports, *sections = re.split(
        "^###? ", (DOCS / "trades.md").read_text(encoding="utf-8"), flags=re.M
    )
    head = "".join(found["source"] for found in BLOCK.finditer(imports))
    programs += [head + "".join(f["source"] for f in BLOCK.finditer(part)) for part in sections]
    for source in programs:
        nodes = [*ast.walk(ast.parse(source))]
        names = [n for n in nodes if isinstance(n, ast.Name)]
        own = {n.id for n in names if isinstance(n.ctx, ast.Store)} | set(dir(builtins))
        own |= set(re.findall(r"^import (?:\w+ as )?(\w+)", source, re.MULTILINE))
        assert {n.id for n in names} <= own


def present(module):
    """Whether a module can be imported."""
    try:
        importlib.import_module(module)
    except ImportError:
        return False
    return True


def test_every_page_is_in_the_navigation():
    navigation = (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8")
    assert PAGES
    assert [p.name for p in PAGES if f": {p.name}\n" not in navigation] == []
