"""The C source of the driver: constants that Python and C share, then fixed texts. It is the same for all systems.

A build of the package imports this module and what it imports, and no package that is installed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path

from ....model.expressions.float_arithmetic import BINARY
from ....model.numbering import OPERATIONS, TAYLOR_RULES, operation_in_c
from ... import constants
from ...status import Status

#: Orders of the series are below this, for arrays on the stack.
MOST_ORDER = 48

#: The driver in C, in the order in which it is read: one text.
_FILES = """
    programs.h pairs.h linear.h implicit/banded.h implicit/radau.h state.c modes.c laws/hidden.c jets.c laws/stability.c laws/sets.c
    stepper.c near_zeros.c laws/elements.c record.c laws/spiral.c laws/vectors.c laws/blocks.c laws/decide.c laws/layer.c laws/contacts.c
    laws/complementarity.c laws/approach.c events.c implicit/collocation.c implicit/implicit.c implicit/stiffness.c
    driver.c accumulation.c laws/roots.c entry.c sample.c
""".split()

#: Legs of known durations with derivatives.
_LEGS = "legs/variation.c legs/adjoint.c implicit/implicit_legs.c legs/legs.c".split()

#: Flows of smooth fields.
_FLOWS = "legs/flow.c implicit/implicit_flow.c legs/fixed.c".split()


#: The folder of those of the C files.
_SOURCES = Path(__file__).parents[2]


@lru_cache(maxsize=32)
def driver_text(name: str) -> str:
    """Return one of the C files."""
    return (_SOURCES / name).read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def run_source() -> str:
    """C of runs: the driver without derivatives and flows of known durations."""
    # UNFUSED: the same bits on every processor.
    enumerations = [("OP", OPERATIONS), ("RULE", TAYLOR_RULES)]
    head = "".join(
        f"enum {{ {', '.join(f'{prefix}_{name}' for name in names)} }};\n"
        for prefix, names in enumerations
    )
    given = {op: ("(x)", "(y)") if op in BINARY else ("(x)",) for op in OPERATIONS[2:]}
    cases = [f"case OP_{op}: return {operation_in_c(op, own)};" for op, own in given.items()]
    head += f"#define OPERATIONS_OF(x, y) {' '.join(cases)}\n"
    sizes = f"#define UNFUSED\n#define P {MOST_ORDER}\n"
    driver = [driver_text(f"core/{name}") for name in _FILES]
    at = _FILES.index("state.c") + 1
    texts = [*driver[:at], _declarations(driver[at:]), *driver[at:]]
    return "".join([constants_header(), sizes, head, driver_text("core/common.h"), *texts])


def _declarations(texts: Sequence[str]) -> str:
    """Declare the functions of some files, so that each may call all others, but those that take types of these files."""
    text = "".join(texts)
    own = re.findall(r"^(?:\} |typedef struct (?:\w+ |\{[^}]*\} ))(\w+);", text, re.MULTILINE)
    heads = re.findall(r"^static [\w *]+\([^;{}]*\)(?= \{)", text, re.MULTILINE)
    foreign = re.compile(rf"\b(?:{'|'.join(own)})\b")
    return "".join(f"{head};\n" for head in heads if not foreign.search(head))


@lru_cache(maxsize=1)
def core_source() -> str:
    """C of the driver."""
    legs = [driver_text(f"core/{name}") for name in _LEGS]
    flow, *others = (driver_text(f"core/{name}") for name in _FLOWS)
    extended = _extended("programs.h", "legs/flow.c")
    return "".join([run_source(), *legs, flow, extended, *others])


def _extended(*files: str) -> str:
    """Functions of some files once more, under other names, on long doubles."""
    text = "".join(driver_text(f"core/{name}") for name in files)
    text = re.sub(r"typedef struct \{[^}]*\} (Values|Rule|Term|List|Series|Field|Legs);", "", text)
    text = re.sub(r"enum \{[^}]*\};", "", text)
    text = re.sub(r"\bdouble\b", "long double", text)
    names = {
        "Flow",
        "PART",
        *re.findall(r"^(?:static|OUTSIDE) (?:inline )?[\w ]+?[ *](\w+)\(", text, re.MULTILINE),
    }
    defined = "".join(f"#define {name} {name}_extended\n" for name in sorted(names))
    undone = "".join(f"#undef {name}\n" for name in sorted(names))
    return f"#include <tgmath.h>\n{defined}{text}{undone}"


@lru_cache(maxsize=1)
def constants_header() -> str:
    """C of ``flow/constants.py`` and of the statuses: constants, enumerations, priorities."""
    numbers = {
        n: v for n, v in vars(constants).items() if n.isupper() and isinstance(v, (int, float))
    }
    states = [n for n, v in numbers.items() if isinstance(v, int) and v < 0]
    lines = [f"#define {n} {v!r}" for n, v in numbers.items() if n not in states]
    statuses = ", ".join(f"{s.name} = {s.value}" for s in Status)
    lines.append(f"enum {{ {statuses}, {', '.join(f'{n} = {numbers[n]}' for n in states)} }};")
    lines.append(f"enum {{ {', '.join(k.upper() for k in constants.KINDS)}, KINDS }};")
    laws = (("LAW", constants.LAWS), ("IMPACTS", constants.IMPACT_LAWS))
    for ending, names in (("GUARD", constants.GUARDS), *laws):
        lines.append(f"enum {{ {', '.join(f'{k.upper()}_{ending}' for k in names)} }};")
    lines.append(f"enum {{ {', '.join(f'METHOD_{m.upper()}' for m in constants.METHODS)} }};")
    lines.append(f"enum {{ {', '.join(r.upper() or 'NO_REASON' for r in constants.REASONS)} }};")
    lines.append(_table("PRIORITY", [constants.PRIORITY[k] for k in constants.GUARDS]))
    lines.append(f"enum {{ LAG_COUNT = {len(constants.LAGS)} }};\n{_table('LAGS', constants.LAGS)}")
    return "\n".join(lines) + "\n"


def _table(name: str, values: Sequence[int]) -> str:
    return f"__attribute__((unused)) static const int {name}[] = {{{listed(values)}}};"


def listed(values: Iterable[int]) -> str:
    """Return numbers with commas between."""
    return ", ".join(str(v) for v in values)


def source_key() -> str:
    """Identify the text of the driver."""
    return hashlib.sha256(core_source().encode()).hexdigest()[:32]


def keyed(source: str, key: str) -> str:
    """Return a source whose library holds a key."""
    return f'{source}\nconst char nonsmooth_key[] = "{key}";\n'


def packaged_name(platform: str) -> str:
    """Name of the driver's library in a wheel, beside ``library.py``."""
    ending = {"darwin": "dylib", "win32": "dll"}.get(platform, "so")
    return f"_core.{ending}"
