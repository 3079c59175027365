"""Typeset formulas that are written as plain text, as ``nu1 nu2 = 1 + O(eps^3)``, by way of LaTeX.

Docstrings have them between dollars, where a word is a name. Claims and captions of papers and the tables
of benchmarks have them among words: there a run of words is a formula if all of it can be read as one and
if it has a relation, an operator, a Greek name, a prime or an index.
"""

from __future__ import annotations

import html
import re

from . import typeset

_GREEK = (
    "alpha|beta|gamma|delta|epsilon|eps|zeta|eta|theta|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|upsilon|"
    "phi|psi|omega|Gamma|Delta|Lambda|Omega|Sigma"
)
_FUNCTIONS = "arccos|arcsin|arctan|arcosh|coth|cot|exp|sin|cos|tan|ceil|Sgn|sgn|sign|log|ln|max|min"
_INDEX = rf"(?:_(?:{_GREEK}|[A-Za-z0-9]{{1,3}}'*|[+-])|\d{{1,2}})"
_TOKEN = re.compile(
    rf"\((?P<over>\d+)/(?P<under>\d+)\)"
    rf"|int_(?P<low>\w)\^(?P<high>\w)(?!\w)"
    rf"|(?P<root>sqrt|abs)(?=\()"
    rf"|(?P<name>{_FUNCTIONS}|sqrt|abs|grad|inf)(?![A-Za-z_0-9])"
    rf"|l(?P<axis>[NT])(?![A-Za-z])"
    rf"|(?P<d>d(?=(?:{_GREEK}|[A-Z]|[nptvxyz](?![a-z]))~?{_INDEX}?'*(?![a-z])))?"
    rf"(?P<symbol>{_GREEK}|[A-Za-z])(?P<hat>~?)(?P<primes>'*)(?P<index>{_INDEX}?)(?P<late>'*)(?![A-Za-z])"
    rf"|(?P<word>[A-Za-z][A-Za-z_]*)"
    rf"|(?P<number>\d*\.?\d+(?:e[+-]?\d+)?)"
    rf"|(?P<power>\^)"
    rf"|(?P<operator><=|>=|!=|->|<<|>>|\+-|-\+|\.\.|[-+=<>~*/|.,;:()\[\]])"
    rf"|(?P<other>\S)"
)
_LATEX = {
    "<=": r"\le ", ">=": r"\ge ", "!=": r"\neq ", "->": r"\to ", "<<": r"\ll ", ">>": r"\gg ",
    "+-": r"\pm ", "-+": r"\mp ", "..": r"\ldots ", "~": r"\sim ", "*": r"\cdot ", ".": r"\cdot ",
    "eps": r"\varepsilon ", "epsilon": r"\varepsilon ", "phi": r"\varphi ", "grad": r"\nabla ",
    "inf": r"\infty ", ";": r";\; ", "sign": r"\operatorname{sgn}",
}  # fmt: skip
_TELLS = re.compile(
    rf"[=<>^~]|(?<![A-Za-z])(?:{_GREEK})(?![a-z])|'|\d/\d|[A-Za-z]\d|(?<=[A-Za-z])_\d|_[A-Za-z+-]"
    r"|(?<![A-Za-z])d[A-Za-z_]*~?/d"
)
_LONG, _SHORT = 24, 6  # characters of a formula that is cut, and of its shortest part


def formula(text: str, display: str = "inline") -> str:
    """Typeset a formula; a block has one on each line."""
    text = text.replace(r"\|", "|")  # a bar in the cell of a table
    if display == "block":
        lines = [latex(line) for line in text.splitlines() if line.strip()]
        made = "".join(typeset.formula(line, "block") for line in lines)
        return made.replace('</div><div class="formula" tabindex="0">', "")  # one block
    return "<wbr>".join(typeset.formula(latex(part)) for part in _parts(" ".join(text.split())))


def among_words(text: str) -> str:
    """Typeset the formulas in a text without marks; return HTML."""
    made, run = list[str](), list[str]()
    for word in re.split(r"(\s+)", text):
        if _may_be_mathematics(word) or (run and word.isspace()):
            run.append(word)
        else:
            made += [_run("".join(run)), html.escape(word, quote=False)]
            run = []
    return "".join([*made, _run("".join(run))])


def page(text: str) -> str:
    """Typeset the formulas in the text of an HTML page; code, headings and links stay as they are."""
    kept = r"<(?P<tag>style|script|code|pre|title|h\d|math|a)\b.*?</(?P=tag)>|<[^>]+>"
    return re.sub(
        rf"(?P<kept>{kept})|[^<]+",
        lambda found: found["kept"] or among_words(html.unescape(found[0])),
        text,
        flags=re.DOTALL,
    )


def _may_be_mathematics(word: str) -> bool:
    if word in {"a", "I", "O", "m/s", *(f"({letter})" for letter in "abcdABC")}:
        return False
    bare = word.rstrip(",;:.")
    tokens = _TOKEN.finditer(bare)
    return bool(word) and not word.isspace() and all(not (t["word"] or t["other"]) for t in tokens)


def _run(text: str) -> str:
    """A run of words that may be mathematics, typeset if it is."""
    place = re.match(r"\s*\d[\d.]*,\s+", text)  # as in "Sec. 3.2, alpha"
    if place:
        return place[0] + _run(text[place.end() :])
    bare = text.strip()
    if not _TELLS.search(bare):
        return html.escape(text, quote=False)
    dash = "- " if bare.startswith("- ") else ""  # between words; no minus
    inner = bare[len(dash) :].rstrip(",;:. ")
    mark = bare[len(dash) + len(inner) :] + text[len(text.rstrip()) :]
    return f"{dash}{formula(inner)}{html.escape(mark, quote=False)}"


def _parts(text: str) -> list[str]:
    """Cut a long formula at outer relations, signs and commas: browsers do not break formulas."""
    if len(text) <= _LONG:
        return [text]
    depth, cuts, whole = 0, [0], list[bool]()
    for k, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if letter in "([":  # what is under a root, a power or bars stays together
            whole.append(bool(re.search(r"(sqrt|abs|\^)$", text[:k])))
        elif letter in ")]" and whole:
            whole.pop()
        spaced = text[k - 1 : k] == " " and text[k + 1 : k + 2] == " "
        if depth == 0 and spaced and letter in "=<>+-~" and k - cuts[-1] > _SHORT:
            cuts.append(k)
        elif letter in ",;" and k + 1 - cuts[-1] > (_LONG if depth else _SHORT) and not any(whole):
            cuts.append(k + 1)
    for digits in re.finditer(r"\d{25,}", text):  # of a number proven to many
        cuts += range(digits.start() + 15, digits.end() - 5, 15)
    cuts.sort()
    return [text[a:b].strip() for a, b in zip(cuts, [*cuts[1:], len(text)], strict=True)]


def latex(text: str) -> str:
    """Write a formula in LaTeX."""
    made = ["{}" if re.match(r"[-+] ", text) else ""]  # a sign between two parts of a formula
    position = 0
    while found := re.compile(r"\s*").match(text, position):
        token = _TOKEN.match(text, found.end())
        if token is None:
            break
        position = token.end()
        if token["root"] or token["power"]:
            inside, position = _group(text, position)
            around = {"sqrt": r"\sqrt{%s}", "abs": "|%s|", None: "^{%s}"}[token["root"]]
            made.append(around % inside)
        else:
            made.append(_written(token))
    return "".join(made)


def _group(text: str, start: int) -> tuple[str, int]:
    """What a root or a power applies to: what is in brackets, or one signed token; and its end."""
    if text[start : start + 1] == "(":
        depth = 0
        for end in range(start, len(text)):
            depth += (text[end] in "([") - (text[end] in ")]")
            if depth == 0:
                return latex(text[start + 1 : end]), end + 1
        return latex(text[start + 1 :]), len(text)
    signed = start + (text[start : start + 1] in ("-", "+"))
    token = _TOKEN.match(text, signed)
    if token is None:
        return text[start:signed], signed
    return text[start:signed] + _written(token), token.end()


def _written(token: re.Match[str]) -> str:
    """A token in LaTeX."""
    if token["over"]:
        return rf"\frac{{{token['over']}}}{{{token['under']}}}"
    if token["low"]:
        return rf"\int_{{{token['low']}}}^{{{token['high']}}}"
    if token["axis"]:
        return rf"\lambda_{{{token['axis']}}}"
    if token["name"]:
        known = token[0] not in ("arcosh", "ceil", "Sgn", "sgn", "sqrt", "abs")
        return _LATEX.get(token[0], rf"\{token[0]} " if known else rf"\operatorname{{{token[0]}}}")
    if token["symbol"]:
        letter = token["symbol"]
        letter = _LATEX.get(letter, rf"\{letter} " if len(letter) > 1 else letter)
        letter = rf"\tilde{{{letter}}}" if token["hat"] else letter
        index = token["index"].lstrip("_")
        greek = re.fullmatch(_GREEK, index)
        if greek:
            index = _LATEX.get(index, rf"\{index} ")
        elif len(index) > 1 and not index.isdigit():
            index = rf"\text{{{index}}}"
        primes = token["primes"] + token["late"]
        return f"{token['d'] or ''}{letter}{primes}" + (f"_{{{index}}}" if index else "")
    if token["word"]:
        return r"\in " if token[0] == "in" else rf"\,\text{{{token[0].replace('_', ' ')}}}\,"
    if token["number"]:
        return _number(token[0])
    return _LATEX.get(token[0], "\\" + token[0] if token[0] in "%&#{}_$" else token[0])


def _number(text: str) -> str:
    mantissa, e, power = text.partition("e")
    if not e or float(mantissa) == 0:
        return "0" if e else f"0{text}" if text.startswith(".") else text
    times = "" if mantissa == "1" else rf"{mantissa}\times "
    return f"{times}10^{{{int(power)}}}"
