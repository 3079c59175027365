"""Importing the packages is light: nothing heavy is loaded before it is used."""

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
