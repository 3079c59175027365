"""The driver in C reads and writes where it may, and does nothing that C leaves undefined."""

from pathlib import Path

import pytest

from nonsmooth.flow.engine import find_compiler

from ..instrumented import main, preloaded

FLOW = Path(__file__).parents[1]


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_runs_under_sanitizers(tmp_path):
    if not preloaded(tmp_path):
        pytest.skip("no library of the address sanitizer")
    files = [
        "test_runs.py",
        "outside/test_random_hybrid.py",
        "events/test_impacts.py",
        "outside/test_reviews.py",
    ]
    assert main("sanitize", ["-m", "not slow", *[str(FLOW / file) for file in files]]) == 0
