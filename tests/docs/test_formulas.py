"""Formulas in plain text become MathML; words, labels and numbers of a text stay as they are."""

from __future__ import annotations

import ast
import html
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

pytest.importorskip("latex2mathml", reason="formulas are typeset with the docs extra")

from docs.tools.formulas import among_words, formula, page


def bare(made: str) -> str:
    """MathML without attributes, entities read."""
    return html.unescape(re.sub(r"<(\w+) [^>]*?(/?)>", r"<\1\2>", made)).replace("\xa0", " ")


def seen(text: str) -> str:
    """What a reader sees, formulas in brackets."""
    made = bare(among_words(text)).replace("</math><wbr><math>", "")
    made = made.replace("<math>", "[").replace("</math>", "]")
    return re.sub(r"</?m\w+/?>|<wbr>", "", made)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("the product nu1 nu2 is 1", "the product [ν1ν2] is 1"),
        ("r ~ exp(-pi d/2)", "[r~exp(−πd/2)]"),
        ("(F1.grad)^2 H at s", "[(F1·∇)2H] at s"),
        ("abs(X' A_X) < mu Y'", "[|X′AX|<μY′]"),
        ("true as eta -> 0; else not", "true as [η→0]; else not"),
        ("error 2.2e-16 at mu = .3", "error 2.2e-16 at [μ=0.3]"),
        ("|H_F| = 5.4e-05", "[|HF|=5.4×10−5]"),
        ("dLambda_N/dY < 0", "[dΛN/dY<0]"),
        ("dv_N/dt = lambda_N - g", "[dvN/dt=λN−g]"),
        ("lambda~ of the force", "[λ~] of the force"),
        ("dv/dt~ = m^-1 lambda~", "[dv/dt~=m−1λ~]"),
        ("Sec. 3.2, alpha made explicit", "Sec. 3.2, [α] made explicit"),
        ("1.53 m/s -> 71.1", "1.53 m/s [→71.1]"),
    ],
)
def test_formulas(text, expected):
    assert seen(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        "a class of its own, mix-0 or VV-C1",
        "12 of 12 starts behave as stated",
        "find_boundary_equilibrium, classify",
        "Sec. 2.2, case I",
        "",
        "- a list - with dashes",
    ],
)
def test_words_stay(text):
    assert among_words(text) == text


def test_it_is_well_formed_and_keeps_its_order():
    text = "nu1 nu2 = 1 + (20/7) (d_X' upsilon X')/(d_Y' Lambda_N Y') g eps^3 + O(eps^4) < 1 & more"
    made = among_words(text)
    ElementTree.fromstring(f"<p>{made}</p>".replace("<wbr>", "<wbr/>"))
    made = bare(made)
    assert made.count("<math>") > 2  # a long formula may be broken
    assert made.index("ν") < made.index("<mfrac>") < made.index("υ") < made.index("Λ")
    assert made.endswith("& more")


def test_formulas_of_docstrings_are_typeset_whole():
    root = Path(__file__).parents[2]
    paths = [path for name in ("nonsmooth", "bounce") for path in (root / name).rglob("*.py")]
    nodes = (node for path in paths for node in ast.walk(ast.parse(path.read_text("utf-8"))))
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = [ast.get_docstring(node) or "" for node in nodes if isinstance(node, kinds)]
    found = {text for doc in docs for text in re.findall(r"\$([^$`\n\\{]+)\$", doc)}
    assert len(found) > 300
    for text in found:
        made = formula(text).replace("<wbr>", "")
        ElementTree.fromstring(f"<p>{made}</p>")
        assert not re.search(
            r"[\^$\\_*]|sqrt|abs\(|[<>]=|->", re.sub(r"<[^>]+>", "", bare(made))
        ), text


def test_unbalanced_brackets_lose_nothing():
    made = among_words("sign(u_x' < 0)) = sign(x'")
    ElementTree.fromstring(f"<p>{made}</p>")
    made = bare(made)
    assert made.count(">(</mo>") + made.count(">)</mo>") == 4


def test_pages_keep_their_tags_code_and_links():
    made = page("<p title='a = b'>mu = 3 <code>mu = 3</code> <a href='x'>mu = 3</a></p>")
    assert made.count("<math ") == 1
    assert "<code>mu = 3</code> <a href='x'>mu = 3</a>" in made and "title='a = b'" in made


def test_a_number_of_very_many_digits_can_be_broken():
    digits = "160312829551350695582723492917747382636"
    made = bare(among_words(f"X' = -0.{digits}"))
    pieces = re.findall(r"<mn>([\d.]*)</mn>", made)
    assert "".join(pieces) == f"0.{digits}" and max(map(len, pieces)) <= 20
    assert made.count("<wbr>") >= 2


def test_a_long_row_of_a_matrix_can_be_broken_but_nothing_under_a_root():
    made = formula("A = [[-(2 xi w + 1), 1, 0], [-(2 xi w + w^2), 0, 1], [-w^2, 0, 0]]")
    assert made.count("<wbr>") == 2
    assert "<wbr>" not in formula("f(sqrt(aa + bb, cc + dd, ee + ff + gg))")


def test_a_marked_formula_keeps_its_words_upright():
    made = formula("x'' = tangential_force - mu load, lambda in Sgn(H)")
    ElementTree.fromstring(f"<p>{made}</p>".replace("<wbr>", "<wbr/>"))
    made = bare(made)
    assert "<mtext>tangential force</mtext>" in made and "<mtext>load</mtext>" in made
    assert "<mo>∈</mo>" in made and "<mo>Sgn</mo>" in made


def test_a_block_has_a_formula_on_each_line():
    made = formula("turn = int_0^T f dt\n\nW' = F / inertia", "block")
    assert made.count("<div") == 1 and made.count('display="block"') == 2 and "∫" in bare(made)


@pytest.mark.parametrize("word", ["F_1", "D_att", "D_C1", "F_s"])
def test_a_letter_with_an_index_is_mathematics_among_words(word):
    letter, index = word.split("_")
    shown = bare(among_words(f"the tip of {word}, which is there"))
    assert f"<mi>{letter}</mi>" in shown and f">{index}<" in shown and word not in shown
