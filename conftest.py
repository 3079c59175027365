"""What every test and every example of a docstring runs under: no display, and few compilations.

What the fast suite compiles is the driver in C, once, and lanes without optimisation. A program of one
system has the same bits as that driver and takes seconds to compile: fast tests of ``test_special.py``
and the slow ones have it. Lanes as they are shipped are in ``tests/flow/compiled`` and the slow tests.
"""

import importlib
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from nonsmooth.flow.compiled import lanes, tape

os.environ["MPLBACKEND"] = "Agg"

HERE = Path(__file__).parent

#: Tests that are marked slow beside those that say so themselves.
DEAR = {
    line
    for line in (HERE / "tests" / "dear.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
}


def pytest_collectstart(collector: pytest.Collector) -> None:
    """Import a package before its modules: collected alone, a module that is imported first would take
    the place, in the package, of the function that has its name."""
    path = collector.path
    if path.suffix == ".py" and (path.parent / "__init__.py").exists():
        importlib.import_module(".".join(path.parent.relative_to(HERE).parts))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is dear."""
    for item in items:
        if item.nodeid in DEAR:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(autouse=True)
def few_compilations(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """The driver in C for what asks for ``engine="compiled"`` and for all but very long runs; lanes compiled at once."""
    slow = request.node.get_closest_marker("slow") is not None
    if not slow and request.path.name != "test_special.py":
        monkeypatch.setattr(tape.TapeEngine, "compile", lambda engine: tape.library())
        monkeypatch.setattr(tape, "_LONG", 500_000)
    if not slow and HERE / "tests" / "flow" / "compiled" not in request.path.parents:
        monkeypatch.setattr(lanes, "FLAGS", (*lanes.FLAGS, "-O0"))
    yield
