"""PTX, what NVRTC makes of a kernel before the card's assembler does, as C++: statement by statement.

Kernels whose threads do not wait for each other can then be run on this processor, thread by thread. What is not known
here is refused. Source: NVIDIA, Parallel Thread Execution ISA 9.
"""

import itertools
import re
from pathlib import Path

from nonsmooth.flow.compiled.device.shim import Shim
from tests.flow.compiled.device import nvrtc

HEADER = Path(__file__).with_name("ptx.h").read_text(encoding="utf-8")
TYPES = {
    **{f"{s}{n}": f"{'' if s == 's' else 'u'}int{n}_t" for s in "usb" for n in (8, 16, 32, 64)},
    "f32": "float",
    "f64": "double",
    "pred": "bool",
}
SPECIAL = {"tid": "threadIdx", "ctaid": "blockIdx", "ntid": "blockDim", "nctaid": "gridDim"}

#: Instructions whose operands and result are of one type, and what may stand between name and type.
PLAIN = {
    **dict.fromkeys(("add", "sub", "mul", "div", "sqrt", "rcp"), ("", "rn", "lo")),
    **dict.fromkeys(("rem", "neg", "abs", "min", "max"), ("",)),
    **dict.fromkeys(("copysign", "and", "or", "xor", "not"), ("",)),
    **{"fma": ("rn",), "mad": ("lo",)},
}
APPROXIMATE = {"rcp", "rsqrt", "ex2", "lg2"}
ROUNDED = {"rzi": "z", "rni": "i", "rmi": "m", "rpi": "p"}
CARRIED = {"add": "carried", "sub": "borrowed"}


class Interpreted(Shim):
    """The shim, running what NVRTC makes of the kernels instead of their text.

    Parameters
    ----------
    fused : bool
        Whether NVRTC fuses products and sums.
    """

    name = "this processor, as a GPU that reads PTX"

    def __init__(self, fused=True, **more):
        # What is to be fused is an instruction of its own; half of the time is the compiler's.
        super().__init__(fused=False, flags=("-O1",), **more)
        self._option = f"--fmad={'true' if fused else 'false'}"

    def translate(self, source):
        """Return what NVRTC makes of a source, as C++."""
        return translated(nvrtc.ptx(source, "compute_90", self._option))

    def compile(self, source):
        """Return the kernels of a source."""
        return super().compile(self.translate(source))


def translated(text):
    """Return C++ for a module of PTX."""
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r"^\.(version|target|address_size)[^\n]*", "", text, flags=re.MULTILINE)
    data, heads, functions, numbers = [], [], [], itertools.count()
    while match := re.match(r"\s*(\.global[^;]*;|[^{;]*;|[^{]*(?=\{))", text):
        found = match[1].strip()
        text = text[match.end() :]
        if found.startswith(".global"):
            data.append(_data(found))
        elif not found.endswith(";") and found:
            end = re.search(r"^\}", text, re.MULTILINE)
            head, copies = _head(found)
            heads.append(head + ";")
            functions.append(f"{head} {{\n{copies}{_body(text[1 : end.start()], numbers)}}}\n")
            text = text[end.end() :]
        elif not found:
            break
    assert not text.strip(), text[:200]
    return "\n".join([HEADER, *data, *heads, *functions])


def _data(text):
    """An array of bytes for a variable with its initial bytes."""
    match = re.fullmatch(
        r"\.global(?: \.align (\d+))? \.[bu]8 ([\w$]+)(?:\[(\d+)\])?(?: = (\{[^}]*\}))?;", text
    )
    assert match, text
    align, name, size, values = match.groups()
    return f"alignas({align or 1}) static Byte {_name(name)}[{size or 1}] = {values or '{}'};"


def _head(text):
    """The declaration of a kernel or a function, and copies of a kernel's parameters into memory."""
    match = re.search(r"(?:\.func\s*(?:\(([^)]*)\))?|\.entry)\s*([\w$]+)\s*(?:\(([^)]*)\))?", text)
    assert match, text
    given, name, taken = match.groups()
    parameters = [p.split() for p in (taken or "").split(",") if p.strip()]
    names = [_name(p[-1].split("[")[0]) for p in parameters]
    if ".entry" not in text:
        given = [_name(given.split()[-1].split("[")[0])] if given else []
        return f"static void {_name(name)}({', '.join('Byte *' + n for n in [*given, *names])})", ""
    types = [TYPES[p[-2][1:]] for p in parameters]
    values = [f"{t} v{n}" for t, n in zip(types, names, strict=True)]
    copies = [f"Byte {n}[sizeof v{n}]; save({n}, v{n});\n" for n in names]
    return f'extern "C" void {name}({", ".join(values)})', "".join(copies)


def _body(text, numbers):
    """The statements of a function. Labels and instructions are numbered together, so that they can be counted."""
    made = ["unsigned carry = 0; (void)carry;"]
    for label, brace, statement in re.findall(r"([\w$]+):|([{}])|([^;{}\s][^;]*);", text):
        if brace:
            made.append(brace)
        elif label:
            made.append(f"{_name(label)}: LABEL({next(numbers)})")
        else:
            made.append(_statement(" ".join(statement.split()), numbers))
    return "\n".join(made)


def _name(text):
    return text.replace("%", "").replace("$", "_")


def _statement(text, numbers):
    """A declaration or an instruction."""
    if text.startswith(".pragma"):
        return ""
    if text.startswith(".reg"):
        kind, names = re.fullmatch(r"\.reg \.(\w+) (.*)", text).groups()
        return f"{TYPES[kind]} {', '.join(_declared(n) for n in names.split(','))};"
    if text.startswith((".local", ".param")):
        match = re.fullmatch(r"\.\w+(?: \.align (\d+))? \.\w(\d+) ([\w$]+)(?:\[(\d+)\])?", text)
        align, bits, name, count = match.groups()
        size = int(bits) // 8 * int(count or 1)
        return f"alignas({align or size}) Byte {_name(name)}[{size}];"
    match = re.fullmatch(r"(@!?%\w+)? ?([a-z][\w.:]*) ?(.*)", text)
    assert match, text
    guard, word, rest = match.groups()
    made = _instruction(word.split("."), _operands(rest))
    made = f"if ({_name(guard[1:])}) {{ {made} }}" if guard else made
    return f'AT({next(numbers)}, "{word}") {made}'


def _declared(text):
    many = re.fullmatch(r"%(\w+)<(\d+)>", text.strip())
    return ", ".join(f"{many[1]}{k}" for k in range(int(many[2]))) if many else _name(text.strip())


def _operands(text):
    """What commas divide, outside of all brackets."""
    return [part.strip() for part in re.findall(r"(?:\{[^}]*\}|\([^)]*\)|[^,{(])+", text)]


def _value(text, kind):
    """An operand read as a type."""
    if text.startswith("0d"):
        return f"as<{kind}>(as<double>((uint64_t)0x{text[2:]}ULL))"
    if text.startswith("0f"):
        return f"as<{kind}>(as<float>((uint32_t)0x{text[2:]}U))"
    if re.fullmatch(r"-?\d+", text):
        return f"({kind}){int(text) & (1 << 64) - 1}ULL"
    if special := re.fullmatch(r"%(n?c?tai?d|n?tid)\.([xyz])", text):
        return f"({kind}){SPECIAL[special[1]]}.{special[2]}"
    if text.startswith("%"):
        return f"as<{kind}>({_name(text)})"
    assert re.fullmatch(r"[\w$]+", text), text  # a variable: its address
    return f"({kind})(uint64_t){_name(text)}" if kind != "bool" else _name(text)


def _address(text):
    """A place in memory, from ``[base+offset]``."""
    base, offset = re.fullmatch(r"\[([^+\]]+)(?:\+(-?\d+))?\]", text).groups()
    start = f"(Byte *){_name(base)}" if base.startswith("%") else _name(base)
    return f"({start} + ({offset or 0}))"


def _instruction(word, operands):
    """C++ for an instruction, by its dotted parts."""
    name, *between = word
    kind = TYPES.get(word[-1], "")
    between = [b for b in between[: -1 if kind else None] if b != "ftz"]
    put = lambda value: f"put({_name(operands[0])}, {value});"
    values = lambda t=kind: ", ".join(_value(o, t) for o in operands[1:])
    if name in SPECIFIC:
        return SPECIFIC[name](between, kind, operands, word)
    if name in APPROXIMATE and between == ["approx"]:
        return put(f"{name}_approx({values()})")
    if name.removesuffix("c") in CARRIED and ("cc" in between or name.endswith("c")):
        with_, keeps = int(name.endswith("c")), int("cc" in between)
        call = f"{CARRIED[name.removesuffix('c')]}({values()}, {with_}, carry, {keeps})"
        return put(call)
    if name in ("mad", "madc") and {"hi", "cc"} & set(between):
        a, b, c = (_value(o, kind) for o in operands[1:])
        product = f"mul_hi({a}, {b})" if "hi" in between else f"mul_({a}, {b})"
        with_, keeps = int(name == "madc"), int("cc" in between)
        return put(f"carried({product}, {c}, {with_}, carry, {keeps})")
    if name == "mul" and between in (["wide"], ["hi"]):
        return put(f"mul_{between[0]}({values()})")
    assert name in PLAIN and ".".join(between) in PLAIN[name], word
    return put(f"{name}_({values()})")


def _mov(_, kind, operands, __):
    to, value = operands
    if to.startswith("{"):  # halves, the lower one first
        halves, whole = _operands(to[1:-1]), _value(value, "uint64_t")
        return " ".join(
            f"put({_name(h)}, (uint32_t)({whole} >> {32 * k}));" for k, h in enumerate(halves)
        )
    if value.startswith("{"):
        low, high = (_value(h, "uint32_t") for h in _operands(value[1:-1]))
        return f"put({_name(to)}, (uint64_t)({low}) | (uint64_t)({high}) << 32);"
    return f"put({_name(to)}, {_value(value, kind)});"


def _ld(_, kind, operands, __):
    to, at = operands[0], _address(operands[1])
    names = _operands(to[1:-1]) if to.startswith("{") else [to]
    return " ".join(
        f"put({_name(n)}, load<{kind}>({at} + {k} * sizeof({kind})));" for k, n in enumerate(names)
    )


def _st(_, kind, operands, __):
    value, at = operands[1], _address(operands[0])
    values = _operands(value[1:-1]) if value.startswith("{") else [value]
    return " ".join(
        f"save({at} + {k} * sizeof({kind}), {_value(v, kind)});" for k, v in enumerate(values)
    )


def _setp(between, kind, operands, _):
    value = f"is_{between[0]}({', '.join(_value(o, kind) for o in operands[1:3])})"
    assert len(between) == 1 and "|" not in operands[0] and len(operands) == 3, operands
    return f"put({_name(operands[0])}, {value});"


def _selp(_, kind, operands, __):
    to, a, b, which = operands
    return f"put({_name(to)}, {_name(which)} ? {_value(a, kind)} : {_value(b, kind)});"


def _shift(_, kind, operands, word):
    to, a, n = operands
    return f"put({_name(to)}, {word[0]}_({_value(a, kind)}, {_value(n, 'uint32_t')}));"


def _shf(between, _, operands, __):
    direction, how = between
    values = ", ".join(_value(o, "uint32_t") for o in operands[1:])
    return f"put({_name(operands[0])}, shf_{direction}_{how}({values}));"


def _count(_, kind, operands, word):
    return f"put({_name(operands[0])}, {word[0]}_({_value(operands[1], kind)}));"


def _cvt(between, kind, operands, word):
    to, source = TYPES[word[-2]], kind
    assert set(between) <= {"rn", *ROUNDED, word[-2]}, word
    rounding = next((ROUNDED[b] for b in between if b in ROUNDED), "-")
    return f"put({_name(operands[0])}, cvt<{to}>({_value(operands[1], source)}, '{rounding}'));"


def _cvta(_, __, operands, ___):
    return f"put({_name(operands[0])}, {_value(operands[1], 'uint64_t')});"


def _bra(_, __, operands, ___):
    return f"goto {_name(operands[0])};"


def _ret(_, __, ___, ____):
    return "return;"


def _call(_, __, operands, ___):
    """``call (result), function, (arguments)``; the first and the last may be missing."""
    lists = [[_name(n) for n in _operands(o[1:-1])] for o in operands if o.startswith("(")]
    function = next(o for o in operands if not o.startswith("("))
    return f"{_name(function)}({', '.join(n for part in lists for n in part)});"


def _atom(between, kind, operands, _):
    what = between[-1]
    assert between[0] == "global" and what in ("add", "cas"), between
    values = ", ".join(_value(o, kind) for o in operands[2:])
    return f"put({_name(operands[0])}, atom_{what}<{kind}>({_address(operands[1])}, {values}));"


SPECIFIC = {
    **{"mov": _mov, "ld": _ld, "st": _st, "cvt": _cvt, "cvta": _cvta, "atom": _atom},
    **{"setp": _setp, "selp": _selp, "shl": _shift, "shr": _shift, "shf": _shf},
    **{"clz": _count, "popc": _count, "bra": _bra, "ret": _ret, "call": _call},
}
