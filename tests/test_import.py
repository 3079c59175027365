"""Importing the packages is light: nothing heavy is loaded before it is used; the door shows no more
than is offered there."""

import importlib
import subprocess
import sys

import pytest

HEAVY = (
    "scipy",
    "matplotlib",
    "tqdm",
    "pandas",
    "multiprocessing.pool",
    "concurrent.futures.process",
)


@pytest.mark.parametrize("package", ["nonsmooth", "bounce"])
def test_heavy_libraries_are_not_imported(package):
    code = f"import sys, {package}; print(*sorted(m for m in {HEAVY!r} if m in sys.modules))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert loaded == []


@pytest.mark.parametrize("package", ["bounce"])
def test_what_completion_shows_is_what_is_offered(package):
    module = importlib.import_module(package)
    shown = [name for name in dir(module) if not name.startswith("__")]
    assert shown == sorted(module.__all__)
