"""What tests and the examples of docstrings have in common: no display, and little to compile.

The fast tests compile the driver in C, once, and lanes and kernels without optimisation. Optimised lanes run
in the tests named in ``SHIPPED``, in the slow tests, and in all of ``tests/flow/engine`` where hypothesis
draws all its examples.
"""

import contextlib
import gc
import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from nonsmooth.flow.engine import interpreter
from nonsmooth.flow.engine import lanes as engine
from nonsmooth.flow.engine.building.build import CompilerError

os.environ["MPLBACKEND"] = "Agg"

HERE = Path(__file__).parent

#: Fast tests and files with optimised lanes: one runs every operation of the printer, one compares all of lanes, and
#: the worker processes of ensembles, which do not load this file, must give the same bits.
SHIPPED = {
    "test_every_operation",
    "test_random_landings_agree_with_the_interpreter",
    "ensembles/test_ensemble.py",
    "ensembles/test_store.py",
}
COMPILED = HERE / "tests" / "flow" / "engine"
WHOLE = os.environ.get("HYPOTHESIS_PROFILE", "quick") != "quick"

#: Bridges to libraries that are not installed.
collect_ignore = [
    f"nonsmooth/interop/{name}.py"
    for name in ("jax", "sympy", "torch")
    if importlib.util.find_spec(name) is None
]

# As often as Python collects garbage by default, it takes a twentieth of the time and finds little.
gc.set_threshold(50_000, 20, 100)


@pytest.hookimpl(trylast=True)  # after pytest-cov has begun to measure
def pytest_sessionstart() -> None:
    """Of several workers of pytest-xdist one compiles the driver in C while the others wait to load it."""
    if "PYTEST_XDIST_WORKER" not in os.environ or os.name == "nt":
        return
    import fcntl

    with open(__file__, "rb") as file, contextlib.suppress(CompilerError):
        fcntl.flock(file, fcntl.LOCK_EX)
        interpreter.library()


def pytest_collectstart(collector: pytest.Collector) -> None:
    """Import a package before its modules: collected alone, a module that is imported first would take
    the place, in the package, of the function that has its name."""
    path = collector.path
    if path.suffix == ".py" and (path.parent / "__init__.py").exists():
        importlib.import_module(".".join(path.parent.relative_to(HERE).parts))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the slow cases of tests, before ``-m`` selects."""
    for item in items:
        cases = {case for marker in item.iter_markers("slow_cases") for case in marker.args}
        if cases and item.callspec.id in cases:
            item.add_marker(pytest.mark.slow)


def pytest_collection_finish() -> None:
    """Exclude what has been collected from garbage collection: it stays."""
    gc.freeze()


@pytest.fixture(autouse=True)
def closed_figures() -> Iterator[None]:
    """Close the figures that pyplot knows after each test."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(autouse=True)
def few_compilations(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Compile lanes without optimisation."""
    slow = request.node.get_closest_marker("slow") is not None
    names = {"/".join(request.path.parts[-2:]), request.node.name}
    shipped = bool(names & SHIPPED) or (WHOLE and COMPILED in request.path.parents)
    if not (slow or shipped):
        monkeypatch.setattr(engine, "FLAGS", (*engine.FLAGS, "-O0"))
    yield
