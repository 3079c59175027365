"""Formulas as plain text become MathML: ``nu1 nu2 = 1 + O(eps^3)`` as a reader of papers expects it.

Claims, checks and captions are written as plain text, for terminals and tables. Reports are read in a
browser. There a run of words is typeset where it is mathematics: it has a relation, an operator, a
Greek name, a prime or an index. Words of a language are left alone, and so are lone numbers and
letters. In docstrings, which ``help()`` shows as they are, formulas are marked: ``$nu1 nu2 = 1$``; there
all of it is mathematics, and a word is a name. The conversion keeps the order of what is written, so
nothing can be lost in it.
"""

from __future__ import annotations

import html
import re

GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eps": "ε", "epsilon": "ε", "zeta": "ζ",
    "eta": "η", "theta": "θ", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ",
    "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "φ", "psi": "ψ",
    "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Lambda": "Λ", "Omega": "Ω", "Sigma": "Σ",
}  # fmt: skip
FUNCTIONS = {
    "exp",
    "sin",
    "cos",
    "tan",
    "arccos",
    "arcsin",
    "arctan",
    "arcosh",
    "cot",
    "coth",
    "ceil",
    "Sgn",
    "log",
    "ln",
    "sgn",
    "sign",
    "max",
    "min",
}
OPERATORS = {
    "<=": "≤", ">=": "≥", "!=": "≠", "->": "→", "<<": "≪", ">>": "≫", "+-": "±", "-+": "∓",
    "..": "…", "~": "∼", "-": "−", "*": "·", ".": "·", "|": "|",
}  # fmt: skip

_LETTERS = "|".join(sorted(GREEK, key=len, reverse=True))
_SYMBOL = rf"(?:{_LETTERS}|[A-Za-z])"
_INDEX = rf"(?:_(?:{_LETTERS}|[A-Za-z0-9]{{1,3}}'*|[+-])|\d{{1,2}})"
_NUMBER = r"\d*\.?\d+(?:e[+-]?\d+)?"
_NAME = rf"(?:{'|'.join(sorted(FUNCTIONS, key=len, reverse=True))}|sqrt|abs|grad|inf|O)"
_TOKEN = re.compile(
    rf"(?P<name>{_NAME}(?![A-Za-z_0-9]))"
    rf"|(?P<force>l(?P<axis>[NT])(?![A-Za-z]))"
    rf"|(?P<partial>d(?P<of>{_LETTERS}|[A-Z]|[nptvxyz](?![a-z]))(?P<ofhat>~?)(?P<ofindex>{_INDEX}|)(?P<ofprimes>'*)(?![a-z]))"
    rf"|(?P<symbol>{_SYMBOL})(?P<hat>~?)(?P<primes>'*)(?P<index>{_INDEX}?)(?P<late>'*)(?![A-Za-z])"
    rf"|(?P<number>{_NUMBER})"
    r"|(?P<operator><=|>=|!=|->|<<|>>|\+-|-\+|\.\.|[-+=<>~*/^|.,;:()\[\]])"
)
#: A name of several letters, or a number that belongs to it.
_WORD = re.compile(r"[A-Za-z][A-Za-z_]*")
_INTEGRAL = re.compile(r"int_(?P<low>\w)\^(?P<high>\w)(?!\w)")
_OPENS, _CLOSES = "([", ")]"
_LONG, _SHORT = 24, 6  # characters of a formula that is cut, and of its shortest part
_TELLS = re.compile(
    rf"[=<>^~]|(?<![A-Za-z])(?:{_LETTERS})(?![a-z])|'|\d/\d|[A-Za-z]\d|(?<=[A-Za-z])_\d|_[A-Za-z+-]|(?<![A-Za-z])d[A-Za-z_]*~?/d"
)


def tokens(word: str) -> list[re.Match[str]] | None:
    """Split a word into symbols, numbers and operators, or return None for a word of a language."""
    found, end = [], 0
    while end < len(word):
        match = _TOKEN.match(word, end)
        if match is None:
            return None
        found.append(match)
        end = match.end()
    return found


def typeset(text: str) -> str:
    """Return text as HTML, its formulas as MathML.

    Examples
    --------
    >>> typeset("the product nu1 nu2 is 1")[:18]
    'the product <math>'
    >>> typeset("a case of its own, 1 in 2")
    'a case of its own, 1 in 2'
    """
    made: list[str] = []
    run: list[str] = []
    for word in re.split(r"(\s+)", text):
        if word.isspace():
            (run if run else made).append(word)
        elif word and _may_be_mathematics(word):
            run.append(word)
        else:
            made.append(_run(run))
            run = []
            made.append(html.escape(word, quote=False))
    made.append(_run(run))
    return "".join(made)


def formula(text: str, display: str = "inline") -> str:
    """Return a formula as MathML; what is not a symbol is a name and stays upright.

    Parameters
    ----------
    text : str
        Without the dollars around it.
    display : {"inline", "block"}
        A block has a formula on each line.

    Examples
    --------
    >>> formula("x' = -mu load")[:12]
    '<math><mrow>'
    """
    text = text.replace(r"\|", "|")  # a bar in the cell of a table
    if display == "block":
        lines = (line.strip() for line in text.strip().splitlines())
        made = "".join(f'<math display="block">{_rendered(line)}</math>' for line in lines if line)
        return f'<div class="formula" tabindex="0">{made}</div>'
    parts = _parts(" ".join(text.split()))
    return "<wbr>".join(f"<math>{_rendered(part)}</math>" for part in parts)


def _may_be_mathematics(word: str) -> bool:
    if word in {"a", "A", "I", "O", "-", "(a)", "(b)", "(c)", "(d)", "(A)", "(B)", "(C)"}:
        return word in {"A", "-"}
    return tokens(word.rstrip(",;:.")) is not None


def _run(words: list[str]) -> str:
    """A run of words that may be mathematics, as MathML if it is."""
    text = "".join(words)
    bare = text.strip()
    if not bare:
        return html.escape(text, quote=False)
    if not _TELLS.search(bare):
        return html.escape(text, quote=False)
    after = text[len(text.rstrip()) :]
    bare, mark = re.fullmatch(r"(.*?)([,;:.]*)", bare, re.DOTALL).groups()  # type: ignore[union-attr]
    lead = re.match(r"-\s+", bare)  # a dash between words is no minus
    dash = lead.group() if lead else ""
    parts = "<wbr>".join(f"<math>{_rendered(part)}</math>" for part in _parts(bare[len(dash) :]))
    return f"{dash}{parts}{html.escape(mark, quote=False)}{after}"


def _parts(text: str) -> list[str]:
    """Cut a long formula at outer relations, signs and commas, and in a number of many digits.

    Browsers do not break a formula.
    """
    if len(text) <= _LONG:
        return [text]
    depth, cuts, groups = 0, [0], list[bool]()
    for k, letter in enumerate(text):
        depth += (letter in _OPENS) - (letter in _CLOSES)
        if letter in _OPENS:  # what is under a root, a power or bars stays together
            groups.append(bool(re.search(r"(sqrt|abs|\^)$", text[:k])))
        elif letter in _CLOSES and groups:
            groups.pop()
        outer = depth == 0 and text[k - 1 : k] == " " and text[k + 1 : k + 2] == " "
        if outer and letter in "=<>+-~" and k - cuts[-1] > _SHORT:
            cuts.append(k)
        elif letter in ",;" and k + 1 - cuts[-1] > (_LONG if depth else _SHORT) and not any(groups):
            cuts.append(k + 1)  # inside brackets, those of a matrix, only where it is long
    for digits in re.finditer(r"\d{25,}", text):  # of a number proven to many
        cuts += range(digits.start() + 15, digits.end() - 5, 15)
    cuts.sort()
    return [text[a:b] for a, b in zip(cuts, [*cuts[1:], len(text)], strict=True)]


def _rendered(text: str) -> str:
    atoms: list[str] = []
    position = 0
    while position < len(text):
        if text[position].isspace():
            position += 1
            continue
        fraction = re.compile(r"\((\d+)/(\d+)\)").match(text, position)
        if fraction:
            atoms.append(f"<mfrac><mn>{fraction[1]}</mn><mn>{fraction[2]}</mn></mfrac>")
            position = fraction.end()
            continue
        whole = _INTEGRAL.match(text, position)
        if whole:
            limits = f"<mn>{whole['low']}</mn><mi>{whole['high']}</mi>"
            atoms.append(f"<msubsup><mo>∫</mo>{limits}</msubsup>")
            position = whole.end()
            continue
        found = _TOKEN.match(text, position)
        word = _WORD.match(text, position)
        if found is None and word:  # a name; "in" is a relation
            name = word.group().replace("_", " ")
            if name == "in":
                atoms.append("<mo>∈</mo>")
            else:
                atoms += _apart(f"<mtext>{name}</mtext>", atoms, text[word.end() :])
            position = word.end()
        elif found is None:  # a mark inside a run
            atoms.append(f"<mo>{html.escape(text[position])}</mo>")
            position += 1
        elif found.group() == "^" and atoms:
            power, position = _group(text, found.end())
            atoms[-1] = f"<msup>{_grouped(atoms[-1])}<mrow>{power}</mrow></msup>"
        elif found["name"] in ("sqrt", "abs") and text[found.end() : found.end() + 1] == "(":
            inside, position = _group(text, found.end())
            bar = "<mo>|</mo>"
            atoms.append(
                f"<msqrt>{inside}</msqrt>"
                if found["name"] == "sqrt"
                else f"<mrow>{bar}{inside}{bar}</mrow>"
            )
        elif found["name"] in FUNCTIONS:
            atoms += _apart(_atom(found), atoms, text[found.end() :])
            position = found.end()
        else:
            atoms.append(_atom(found))
            position = found.end()
    return "".join(atoms)


_SPACE = '<mspace width="0.2em"/>'


def _apart(word: str, before: list[str], after: str) -> list[str]:
    """A word with the space that it needs to what is beside it."""
    first = [_SPACE] if before and not before[-1].startswith(("<mo", "<mspace")) else []
    last = [_SPACE] if re.match(r"\s+[\w(|]", after) else []
    return [*first, word, *last]


def _grouped(atom: str) -> str:
    return atom if atom.count("<m") <= 1 else f"<mrow>{atom}</mrow>"


def _group(text: str, start: int) -> tuple[str, int]:
    """What a power or a root applies to: what is in brackets, or one signed token."""
    if text[start : start + 1] == "(":
        depth = 0
        for end in range(start, len(text)):
            depth += (text[end] in _OPENS) - (text[end] in _CLOSES)
            if depth == 0:
                return _rendered(text[start + 1 : end]), end + 1
        return _rendered(text[start + 1 :]), len(text)
    sign = ""
    if text[start : start + 1] in ("-", "+"):
        sign, start = f"<mo>{OPERATORS.get(text[start], text[start])}</mo>", start + 1
    found = _TOKEN.match(text, start)
    if found is None:
        return sign, start
    return sign + _atom(found), found.end()


def _atom(found: re.Match[str]) -> str:
    if found["name"]:
        word = {"grad": "∇", "inf": "∞", "sign": "sgn"}.get(found["name"], found["name"])
        return f"<mo>{word}</mo>" if word == "∇" else f"<mi>{word}</mi>"
    if found["force"]:
        return f"<msub><mi>λ</mi><mi>{found['axis']}</mi></msub>"
    if found["partial"]:
        letter = _symbol(
            found["of"], found["ofprimes"], found["ofindex"] or "", hat=bool(found["ofhat"])
        )
        return f"<mrow><mi>d</mi>{letter}</mrow>"
    if found["symbol"]:
        primes = found["primes"] + found["late"]
        base = _symbol(found["symbol"], primes, found["index"] or "", hat=bool(found["hat"]))
        return base
    if found["number"]:
        return _number(found["number"])
    sign = found["operator"]
    shown = html.escape(OPERATORS.get(sign, sign))
    if sign in _OPENS + _CLOSES:
        return f'<mo stretchy="false">{shown}</mo>'
    if found.start() == 0 and found.string[1:2] == " ":  # the start of a part that was cut
        return f'<mo form="infix">{shown}</mo>'
    return f"<mo>{shown}</mo>"


def _symbol(name: str, primes: str, index: str, hat: bool = False) -> str:
    letter = f"<mi>{GREEK.get(name, name)}</mi>"
    if hat:
        letter = f"<mover>{letter}<mo>~</mo></mover>"
    if primes:  # the glyph is raised by itself
        letter = f'<mrow>{letter}<mo lspace="0" rspace="0">{"′" * len(primes)}</mo></mrow>'
    if not index:
        return letter
    inner = index.lstrip("_")
    inner, dashes = inner.rstrip("'"), "′" * inner.count("'")
    shown = {"+": "+", "-": "−"}.get(inner, GREEK.get(inner, inner))
    return f"<msub>{letter}<mi>{shown}{dashes}</mi></msub>"


def _number(text: str) -> str:
    mantissa, e, power = text.partition("e")
    if e and float(mantissa) == 0:
        return "<mn>0</mn>"
    if not e:
        return f"<mn>{text}</mn>"
    sign = "<mo>−</mo>" if power.startswith("-") else ""
    ten = f"<msup><mn>10</mn><mrow>{sign}<mn>{power.lstrip('+-').lstrip('0') or '0'}</mn></mrow></msup>"
    return ten if mantissa == "1" else f"<mrow><mn>{mantissa}</mn><mo>×</mo>{ten}</mrow>"


_TEXT = re.compile(
    r"(?P<kept><(?:style|script|code|pre|title|h\d|math|a)\b.*?</(?:style|script|code|pre|title|h\d|math|a)>"
    r"|<[^>]+>)|(?P<text>[^<]+)",
    re.DOTALL,
)


def typeset_page(page: str) -> str:
    """Typeset the formulas in the text of an HTML page; code, headings and links stay as they are."""
    return _TEXT.sub(lambda f: f["kept"] or typeset(html.unescape(f["text"])), page)
