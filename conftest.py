"""What every test and every example of a docstring runs under: no display, and few compilations.

What the fast suite compiles is the driver in C, once, and lanes and kernels without optimisation. A program
of one system has the same bits as that driver and takes seconds to compile: fast tests of
``test_special.py`` and the slow ones have it. Lanes as they are shipped have the tests in ``SHIPPED``, the
slow ones, and where hypothesis draws all its examples those of ``tests/flow/compiled``.
"""

import contextlib
import gc
import importlib
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from nonsmooth.flow.compiled import tape
from nonsmooth.flow.compiled.building.build import CompilerError
from nonsmooth.flow.compiled.device import shim
from nonsmooth.flow.compiled.lanes import engine
from tests.halves import NAME, elsewhere

os.environ["MPLBACKEND"] = "Agg"

HERE = Path(__file__).parent

#: Tests that are marked slow beside those that say so themselves.
DEAR = {
    line
    for line in (HERE / "tests" / "dear.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
}


#: Tests and files of the fast suite with lanes as they are shipped, whatever the profile: what looks at every
#: rule of the printer, and where worker processes, which know nothing of this file, have the same bits.
SHIPPED = {
    "test_every_operation",
    "test_random_landings_agree_with_the_interpreter",
    "test_lanes.py",
}
COMPILED = HERE / "tests" / "flow" / "compiled"
WHOLE = os.environ.get("HYPOTHESIS_PROFILE", "quick") != "quick"

# As often as Python collects garbage by default, it takes a twentieth of the time and finds little.
gc.set_threshold(50_000, 20, 100)


def pytest_sessionstart() -> None:
    """Where two processes begin, one compiles the driver in C while the other waits to load it."""
    if not os.environ.get(NAME):
        return
    import fcntl

    with open(HERE / "tests" / "halves.py", "rb") as file, contextlib.suppress(CompilerError):
        fcntl.flock(file, fcntl.LOCK_EX)
        tape.library()


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Leave the files of the other half to the other process."""
    return True if collection_path.is_file() and elsewhere(collection_path) else None


def pytest_collectstart(collector: pytest.Collector) -> None:
    """Import a package before its modules: collected alone, a module that is imported first would take
    the place, in the package, of the function that has its name."""
    path = collector.path
    if path.suffix == ".py" and (path.parent / "__init__.py").exists():
        importlib.import_module(".".join(path.parent.relative_to(HERE).parts))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is dear; leave out what was asked for by name and is of the other half."""
    items[:] = [item for item in items if not elsewhere(item.path)]
    for item in items:
        if item.nodeid in DEAR:
            item.add_marker(pytest.mark.slow)


def pytest_collection_finish() -> None:
    """What is there now stays: the collector need not look at it again."""
    gc.freeze()


@pytest.fixture(autouse=True)
def few_compilations(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """The driver in C for what asks for ``engine="compiled"`` and for all but very long runs; lanes compiled at once."""
    slow = request.node.get_closest_marker("slow") is not None
    if not slow and request.path.name != "test_special.py":
        monkeypatch.setattr(tape.TapeEngine, "compile", lambda engine: tape.library())
        monkeypatch.setattr(tape, "_LONG", 500_000)
    names = {request.path.name, request.node.name}
    shipped = COMPILED in request.path.parents and (WHOLE or bool(names & SHIPPED))
    if not (slow or shipped):
        monkeypatch.setattr(engine, "FLAGS", (*engine.FLAGS, "-O0"))
        monkeypatch.setattr(shim, "_FLAGS", (*shim._FLAGS, "-O0"))
    yield
