"""Tolerances of the texts in C are in ``flow/constants.py``, not in the texts."""

import re
from pathlib import Path

import pytest

import nonsmooth

FOLDER = Path(nonsmooth.__file__).parent / "flow"
FILES = [*sorted((FOLDER / "core").rglob("*.[ch]"))]

#: Functions that are approximations by coefficients.
_FITTED = re.compile(r"static (?:inline )?double (?:rough_\w+|ns_erfinv)\(.*?\n}", re.DOTALL)
_SMALL = re.compile(r"(?<![\w.])\d+\.?\d*e[+-]?\d+")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_text_has_no_tolerance_of_its_own(file):
    text = _FITTED.sub("", file.read_text(encoding="utf-8"))
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    assert _SMALL.findall(text) == []
