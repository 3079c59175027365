"""The driver in C reads and writes where it may, and does nothing that C leaves undefined."""

from pathlib import Path

import pytest

from nonsmooth.flow.engine import find_compiler

from .instrumented import main, preloaded

HERE = Path(__file__).parent


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_runs_under_sanitizers(tmp_path):
    if not preloaded(tmp_path):
        pytest.skip("no library of the address sanitizer")
    files = [
        "test_contract.py",
        "test_random_hybrid.py",
        "test_impacts.py",
        *HERE.glob("test_reviews_*.py"),
    ]
    assert main("sanitize", ["-m", "not slow", *[str(HERE / file) for file in files]]) == 0
