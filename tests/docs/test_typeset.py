"""Every formula of the pages becomes MathML."""

import re
from pathlib import Path

import pytest

pytest.importorskip("latex2mathml", reason="formulas are typeset with the docs extra")

from docs.tools import typeset

DOCS = Path(__file__).parents[2] / "docs"

CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"\$\$(.+?)\$\$|\$([^$]+?)\$", re.DOTALL)


def formulas(page):
    """The LaTeX of a page, programs and outputs left out."""
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    return [display or inline for display, inline in FORMULA.findall(text)]


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.stem)
def test_every_formula_of_a_page_is_typeset(page):
    for latex in formulas(page):
        made = typeset.formula(latex.strip())
        assert made.startswith("<math") and made.count("<mrow>") == made.count("</mrow>")


def test_a_mark_stays_on_the_line_of_its_formula():
    page = "<p>so (<math>x</math>), and <math>y</math> too</p>"
    held = '<span class="unbroken">(<math>x</math>),</span>'
    assert typeset.unbroken(page) == f"<p>so {held} and <math>y</math> too</p>"
