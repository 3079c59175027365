"""Expressions as MathML, which browsers and notebooks typeset without any other software."""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Sequence

import casadi as ca

from .graph import Node, instructions

_MOST = 160  # operations of an expression that is typeset
_SUM, _PRODUCT, _POWER, _ATOM = range(4)  # precedences
_SIGNS = {"lt": "&lt;", "le": "≤", "eq": "=", "ne": "≠", "and": "∧", "or": "∨"}
_MINUS = "<mo>−</mo>"
_Part = tuple[str, int]  # MathML and its precedence


def equation(left: str, right: ca.SX, symbols: Sequence[ca.SX]) -> str:
    """Typeset ``left = right`` in symbols; dots for an expression that is too long to be read."""
    inside = f"{left}<mo>=</mo>{_typeset(right, symbols)}"
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML"><mrow>{inside}</mrow></math>'


def rate(name: str) -> str:
    """Typeset the rate of a state."""
    return f'<mover accent="true">{symbol(name)}<mo>˙</mo></mover>'


def symbol(name: str) -> str:
    """Typeset a name: Greek letters by their names, digits at the end and after ``_`` as subscripts."""
    found = re.fullmatch(r"([A-Za-z]+?)_?(\d+|(?<=_)\w+)", name)
    stem, below = found.groups() if found else (name, "")
    letter = f"<mi>{html.escape(_greek(stem))}</mi>"
    return f"<msub>{letter}<mi>{html.escape(below)}</mi></msub>" if below else letter


def _greek(name: str) -> str:
    size = "CAPITAL" if name[:1].isupper() else "SMALL"
    word = "LAMDA" if name.upper() == "LAMBDA" else name.upper()
    try:
        return unicodedata.lookup(f"GREEK {size} LETTER {word}") if len(name) > 1 else name
    except KeyError:
        return name


def _typeset(expression: ca.SX, symbols: Sequence[ca.SX]) -> str:
    nodes, rows = instructions([ca.vertcat(*symbols)], [expression])
    sizes, parts = list[int](), list[_Part]()
    names = [one.name() for one in symbols]
    for node in nodes:
        sizes.append(1 + sum(sizes[k] for k in node.args))
        small = sizes[-1] <= _MOST
        parts.append(_part(node, [parts[k] for k in node.args], names) if small else ("", _ATOM))
    k = rows[0][0]
    return parts[k][0] if sizes[k] <= _MOST else "<mo>…</mo>"


def _part(node: Node, args: list[_Part], names: list[str]) -> _Part:
    """MathML of one operation on its arguments."""
    op = node.op
    if op == "const":
        value = float(node.payload)  # type: ignore[arg-type]
        return _number(value), _ATOM if value >= 0 else _SUM
    if op == "input":
        return symbol(names[node.source[1]]), _ATOM
    if op == "add":
        text = args[1][0]
        return f"{args[0][0]}{text if text.startswith(_MINUS) else '<mo>+</mo>' + text}", _SUM
    if op == "sub":
        return f"{args[0][0]}{_MINUS}{_at(args[1], _PRODUCT)}", _SUM
    if op == "neg":
        return f"{_MINUS}{_at(args[0], _PRODUCT)}", _SUM
    if op in ("mul", "twice"):
        one, two = (("<mn>2</mn>", _ATOM), *args)[-2:] if op == "twice" else args
        dot = "<mo>·</mo>" if two[0].startswith("<mn>") else "<mo>\N{INVISIBLE TIMES}</mo>"
        return f"{_at(one, _PRODUCT)}{dot}{_at(two, _PRODUCT)}", _PRODUCT
    if op in ("div", "inv"):
        above, below = ("<mn>1</mn>", args[0][0]) if op == "inv" else (args[0][0], args[1][0])
        return f"<mfrac><mrow>{above}</mrow><mrow>{below}</mrow></mfrac>", _POWER
    if op in ("sq", "pow", "constpow"):
        power = "<mn>2</mn>" if op == "sq" else args[1][0]
        return f"<msup><mrow>{_at(args[0], _ATOM)}</mrow><mrow>{power}</mrow></msup>", _POWER
    if op == "sqrt":
        return f"<msqrt><mrow>{args[0][0]}</mrow></msqrt>", _ATOM
    if op == "fabs":
        return f"<mo>|</mo>{args[0][0]}<mo>|</mo>", _ATOM
    if op in _SIGNS:
        return f"{args[0][0]}<mo>{_SIGNS[op]}</mo>{args[1][0]}", _SUM
    inside = "<mo>,</mo>".join(text for text, _ in args)
    return f"<mi>{html.escape(op)}</mi>{_inside(inside)}", _ATOM


def _at(part: _Part, least: int) -> str:
    """A part with parentheses if it binds less than its place."""
    text, precedence = part
    return text if precedence >= least else _inside(text)


def _inside(text: str) -> str:
    return f"<mrow><mo>(</mo>{text}<mo>)</mo></mrow>"


def _number(value: float) -> str:
    text = f"{abs(value):.6g}"
    if "e" in text:
        digits, _, power = text.partition("e")
        text = f"<mn>{digits}</mn><mo>·</mo><msup><mn>10</mn><mn>{int(power)}</mn></msup>"
    else:
        text = f"<mn>{text}</mn>"
    return text if value >= 0 else _MINUS + text
