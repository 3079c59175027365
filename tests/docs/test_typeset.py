"""Formulas of the pages become MathML, whole, and cells of tables know their columns."""

import importlib.util
import re
from pathlib import Path

import pytest

pytest.importorskip("latex2mathml", reason="formulas are typeset with the docs extra")

DOCS = Path(__file__).parents[2] / "docs"
_spec = importlib.util.spec_from_file_location("docs_typeset", DOCS / "typeset.py")
typeset = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(typeset)

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


def test_pages_have_formulas():
    found = {page.stem: len(formulas(page)) for page in DOCS.glob("*.md")}
    assert min(found[name] for name in ("theory", "two_folds", "contact_model", "coming_from")) > 3


def test_a_command_that_is_not_understood_is_an_error():
    with pytest.raises(typeset.FormulaError, match="mystery"):
        typeset.formula(r"\mystery{x}")
    with pytest.raises(typeset.FormulaError, match="aligned"):
        typeset.formula(r"\begin{aligned} a &= b \\ c &= d \end{aligned}")


def test_inline_and_display():
    page = r'<p><span class="arithmatex">\(\nu_1 &lt; 0\)</span></p><div class="arithmatex">\[x\]</div>'
    made = typeset.mathematics(page)
    assert made.count("<math") == 2 and "arithmatex" not in made
    assert 'display="block"' in made and "&#x0003C;" in made


def test_cells_carry_the_heads_of_their_columns():
    page = (
        "<table><thead><tr><th>a</th><th>b <em>c</em></th></tr></thead>"
        '<tbody><tr><td>1</td><td style="x">2</td></tr><tr><td>3</td><td>4</td></tr></tbody></table>'
    )
    made = typeset.labelled(page)
    assert re.findall(r'<td data-label="([^"]*)"', made) == ["a", "b c", "a", "b c"]
    assert '<td data-label="b c" style="x">' in made
