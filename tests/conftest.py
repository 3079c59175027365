"""What every test runs under: no display, and property tests that repeat.

The default hypothesis profile draws the same examples every time, so a clone passes or fails like
any other: 30 of each property, or as many as hypothesis finds good (100) with
`HYPOTHESIS_PROFILE=whole`, which `make check` and CI take. `HYPOTHESIS_PROFILE=explore` draws new
ones, and many more, to look for a counterexample.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from nonsmooth.flow.compiled import tape
from tests.browser import opened

os.environ["MPLBACKEND"] = "Agg"

settings.register_profile("quick", derandomize=True, deadline=None, max_examples=30)
settings.register_profile("whole", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=2000, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


#: Tests that are marked slow beside those that say so themselves.
DEAR = {
    line
    for line in Path(__file__).with_name("dear.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is dear."""
    for item in items:
        if item.nodeid in DEAR:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium (tests/browser.py); tests without it are skipped with the reason."""
    yield from opened()


@pytest.fixture(autouse=True)
def in_c(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What asks for ``engine="compiled"`` gets the driver in C; the program of the system, which has the same
    bits (test_special) and takes seconds to compile, among the slow tests only."""
    slow = request.node.get_closest_marker("slow") is not None
    if not slow and request.module.__name__.rpartition(".")[2] != "test_special":
        monkeypatch.setattr(tape.TapeEngine, "compile", lambda engine: tape.library())
    yield
