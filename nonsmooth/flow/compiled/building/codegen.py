"""The C sources of the engines: what Python and C share, then fixed texts, then what is generated.

``interpreter_source`` knows no system; ``lanes_source`` serves systems of one surface without resets,
several trajectories in step.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from importlib import resources

from ....model import Coupled, FilippovSystem, coupled_of, motion
from ....model.printing.programs import is_flat, lanes_program
from ....model.printing.set_program import set_program
from ....model.printing.tape import OPERATIONS, TAPE_RULES
from ... import constants
from ...options import Options
from ...status import Status

#: Orders of the series are below this, for arrays on the stack.
MOST_ORDER = 48

#: The order to which that of linear systems is raised: beyond, longer steps lose digits to terms that cancel.
_MOST_LINEAR = 22

#: The driver in C, in the order in which it is read: one text.
_FILES = (
    *("programs.h", "linear.h", "state.c", "modes.c", "jets.c", "sets.c", "stepper.c"),
    *("surfaces.c", "record.c", "switching.c", "contacts.c", "approach.c", "driver.c"),
    *("memory.c", "entry.c", "motion.c"),
)


#: The package whose folder holds the C files.
_SOURCES = __package__.rpartition(".")[0]


@lru_cache(maxsize=32)
def driver_text(name: str) -> str:
    """Return one of the C files of the compiled engines."""
    return resources.files(_SOURCES).joinpath(name).read_text(encoding="utf-8")


def supports_lanes(system: FilippovSystem) -> bool:
    """Whether the lanes engine can be generated for a system."""
    return system.surface_count <= 1 and not (
        system.resets or system.impacts or any(system.nonlinear)
    )


def supports_set_lanes(coupled: Coupled) -> bool:
    """Whether lanes can be generated for a system with a set: one, alone, of constant slopes."""
    system = coupled.system
    alone = len(system.sets) == 1 and system.surface_count == len(system.sets[0])
    others = system.resets or system.impacts or any(system.nonlinear)
    return alone and not others and coupled.affine and not coupled.slope_moves.any()


def tape_order(system: FilippovSystem, options: Options) -> int:
    """Order of the series of one trajectory: a third more where all is linear."""
    order = options.order
    if system.coupled or not coupled_of(system).linearity.everywhere:
        return order
    return max(order, min((4 * order + 2) // 3, _MOST_LINEAR))


def interpreter_source() -> str:
    """C of the interpreter, which knows no system."""
    enumerations = [("OP", OPERATIONS), ("RULE", TAPE_RULES)]
    head = "".join(
        f"enum {{ {', '.join(f'{prefix}_{name}' for name in names)} }};\n"
        for prefix, names in enumerations
    )
    sizes = f"#define P {MOST_ORDER}\n"
    driver = [driver_text(f"interpreter/{name}") for name in _FILES]
    flows = [driver_text("interpreter/flow.c"), _extended("programs.h", "flow.c")]
    fixed = driver_text("interpreter/fixed.c")
    return "".join([facts_header(), sizes, head, driver_text("common.h"), *driver, *flows, fixed])


def _extended(*files: str) -> str:
    """Functions of some files once more, under other names, on long doubles."""
    text = "".join(driver_text(f"interpreter/{name}") for name in files)
    text = re.sub(r"typedef struct \{[^}]*\} (Values|Series|Field);", "", text)
    text = re.sub(r"\bdouble\b", "long double", text)
    names = {
        "Flow",
        *re.findall(r"^(?:static|OUTSIDE) (?:inline )?[\w ]+?[ *](\w+)\(", text, re.MULTILINE),
    }
    defined = "".join(f"#define {name} {name}_extended\n" for name in sorted(names))
    undone = "".join(f"#undef {name}\n" for name in sorted(names))
    plain = "#undef MULADD\n#define MULADD(a, b, c) ((a) * (b) + (c))\n"
    return f"#include <tgmath.h>\n{plain}{defined}{text}{undone}"


def lanes_source(system: FilippovSystem, order: int, width: int) -> str:
    """C source of the engine for ``width`` trajectories in step."""
    head, program = _lanes_head(system, order)
    texts = map(driver_text, ("common.h", "lanes/vector.h", "lanes/sines.h", "lanes/polynomials.h"))
    return "".join(
        [
            f"#define W {width}\n",
            head,
            *texts,
            program,
            *map(driver_text, ("lanes/lanes.c", "lanes/records.h", "lanes/batch.c")),
        ]
    )


def device_source(system: FilippovSystem, order: int, threads: int, resident: int = 1) -> str:
    """C++ source of the same engine with a trajectory for each thread, as CUDA or for any
    compiler."""
    head, program = _lanes_head(system, order)
    sizes = f"#define THREADS {threads}\n#define RESIDENT {resident}\n"
    texts = map(driver_text, ("common.h", "device/lane.h", "lanes/sines.h", "lanes/polynomials.h"))
    parts = [driver_text("device/head.h"), sizes, head, *texts, program]
    return "".join([*parts, driver_text("lanes/lanes.c"), driver_text("device/kernel.c")])


def _lanes_head(system: FilippovSystem, order: int) -> tuple[str, str]:
    """What the lanes' text asks to be defined before it, and the functions of a system."""
    program, blend = lanes_program(system, order)
    (rows, checked), affine = blend.checked, blend.affine
    slots = 2 * system.surface_count + len(system.stops)
    cancelled = system.surface_count == 0 or motion(system, "s").regular
    directions = ", ".join(str(d) for _, d in system.stops) or "0"
    defines = (
        f"#define SLOTS {slots}\n#define STOPS {len(system.stops)}\n"
        f"#define CANCELLED {int(cancelled)}\n#define ROWS {len(rows)}\n"
        f"#define GUARDS {len(checked)}\n"
        f"#define CURVED {int(bool(affine) and not is_flat(system))}\n"
        f"#define LINEAR {int(all(_affine_modes(system)))}\n"
        f"static const int DIRECTION[] = {{{directions}}};\n"
        f"static const long long AFFINE_MODES[] = {{{_list(_affine_modes(system))}}};\n"
        f"static const int ROW[] = {{{_list(rows) or 0}}}, SLOT[] = {{{_list(checked) or 0}}};\n"
        f"static const int AFFINE[] = {{{', '.join(str(int(a)) for a in affine) or '1'}}};\n"
    )
    return facts_header() + _sizes(system, order) + defines, program


#: Characters of a program from which on a step's instructions fill a processor's nearest memory of 32 KiB: measured.
_LONG_TEXT = 200_000


def set_lanes_source(coupled: Coupled, order: int, width: int) -> str:
    """C source of the engine in step of a system that ``supports_set_lanes``."""
    system, program = coupled.system, set_program(coupled, order)
    directions = _list(d for _, d in system.stops) or "0"
    groups = 8 if len(program.text) > _LONG_TEXT else 2
    defines = (
        f"#define W {width}\n#define GROUPS {groups}\n#define K {system.surface_count}\n#define STOPS {len(system.stops)}\n"
        f"#define ROWS {len(program.rows)}\n#define ON_ROWS {len(program.on_rows)}\n#define NAMED {int(bool(program.states))}\n"
        f"#define BENT_SLIP {int(program.bent_slip)}\n#define BENT_STOPS {int(program.bent_stops)}\n"
        f"__attribute__((unused)) static const int DIRECTION[] = {{{directions}}};\n"
        f"__attribute__((unused)) static const int ROW[] = {{{_list(program.rows) or 0}}};\n"
        f"__attribute__((unused)) static const int ON_ROW[] = {{{_list(program.on_rows) or 0}}};\n"
        f"__attribute__((unused)) static const int OWN[] = {{{_list(program.states) or 0}}};\n"
    )
    drivers = ("lanes/polynomials.h", "lanes/records.h", "lanes/set_lanes.c", "lanes/set_steps.c")
    texts = [*map(driver_text, ("common.h", "lanes/vector.h", "lanes/sines.h")), program.text]
    return "".join(
        [facts_header(), _sizes(system, order), defines, *texts, *map(driver_text, drivers)]
    )


def _affine_modes(system: FilippovSystem) -> list[int]:
    """Of above, below and sliding; a system without a surface has one mode."""
    modes = ["+", "-", "s"] if system.surface_count else [""] * 3
    return [int(motion(system, mode).affine) for mode in modes]


@lru_cache(maxsize=1)
def facts_header() -> str:
    """C of ``flow/constants.py`` and of the statuses: constants, enumerations, priorities."""
    numbers = {
        n: v for n, v in vars(constants).items() if n.isupper() and isinstance(v, (int, float))
    }
    states = [n for n, v in numbers.items() if isinstance(v, int) and v < 0]
    lines = [f"#define {n} {v!r}" for n, v in numbers.items() if n not in states]
    statuses = ", ".join(f"{s.name} = {s.value}" for s in Status)
    lines.append(f"enum {{ {statuses}, {', '.join(f'{n} = {numbers[n]}' for n in states)} }};")
    lines.append(f"enum {{ {', '.join(k.upper() for k in constants.KINDS)}, KINDS }};")
    lines.append(f"enum {{ {', '.join(k.upper() + '_GUARD' for k in constants.GUARDS)} }};")
    lines.append(f"enum {{ {', '.join(r.upper() or 'NO_REASON' for r in constants.REASONS)} }};")
    lines.append(_table("PRIORITY", [constants.PRIORITY[k] for k in constants.GUARDS]))
    lines.append(f"enum {{ LAG_COUNT = {len(constants.LAGS)} }};\n{_table('LAGS', constants.LAGS)}")
    return "\n".join(lines) + "\n"


def _table(name: str, values: Sequence[int]) -> str:
    return f"__attribute__((unused)) static const int {name}[] = {{{_list(values)}}};"


def _sizes(system: FilippovSystem, order: int) -> str:
    sizes = {
        "N": system.extended_dimension,
        "ND": system.dimension,
        "P": order,
        "M": system.surface_count,
        "TIMED": int(system.time_dependent),
    }
    return "".join(f"#define {name} {value}\n" for name, value in sizes.items())


def _list(values: Iterable[int]) -> str:
    return ", ".join(str(v) for v in values)
