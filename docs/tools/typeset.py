"""Typeset LaTeX formulas as MathML, and label the cells of tables, in the HTML of a page.

MathML is made while the site is built, so a page needs neither a script nor a network. Cells carry the
heads of their columns, so that a narrow screen can show each row as a list.
"""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from functools import cache

from latex2mathml.converter import convert

_FORMULA = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)
_MARKED = re.compile(r"\(?<math\b(?:(?!</math>).)*</math>[).,;:]+", re.DOTALL)
_TABLE = re.compile(r"<table>.*?</table>", re.DOTALL)
_HEAD = re.compile(r"<th(?:\s[^>]*)?>(.*?)</th>", re.DOTALL)
_ROW = re.compile(r"<tr>.*?</tr>", re.DOTALL)
_TAG = re.compile(r"<[^>]+>")


class FormulaError(ValueError):
    """LaTeX that would not be typeset whole."""


@cache
def formula(latex: str, display: str = "inline") -> str:
    """Typeset LaTeX as MathML; raise FormulaError if a command is left over in what would be shown."""
    made = convert(latex, display=display)
    shown = _TAG.sub("", made)
    if "\\" in shown or "&amp;" in shown or re.search(r"&(?![#\w]+;)", shown):
        raise FormulaError(f"expected LaTeX that is understood, received {latex!r}: made {shown!r}")
    if display == "block":
        return f'<div class="formula" tabindex="0">{made}</div>'
    return made


def mathematics(page: str, read: Callable[[str, str], str] = formula) -> str:
    """Replace the formulas of a page by MathML, as `read` makes it from text and display."""

    def typeset(found: re.Match[str]) -> str:
        display = "block" if found["tag"] == "div" else "inline"
        return read(html.unescape(found["latex"]).strip(), display)

    return _FORMULA.sub(typeset, page)


def unbroken(page: str) -> str:
    """Keep a formula and the mark after it on one line."""
    return _MARKED.sub(r'<span class="unbroken">\g<0></span>', page)


def labelled(page: str) -> str:
    """Give each cell of a table the head of its column, for narrow screens."""
    return _TABLE.sub(lambda found: _labelled(found.group()), page)


def _labelled(table: str) -> str:
    heads = [html.escape(html.unescape(_TAG.sub("", head))) for head in _HEAD.findall(table)]

    def row(found: re.Match[str]) -> str:
        columns = iter(heads)
        return re.sub(
            r"<td(?=[ >])", lambda _: f'<td data-label="{next(columns, "")}"', found.group()
        )

    return _ROW.sub(row, table)
