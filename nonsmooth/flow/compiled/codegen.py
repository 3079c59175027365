"""The C source of an engine: tables and generated functions of a system, then a fixed driver.

``scalar_source`` serves every system whose modes have at most one sliding surface; ``lanes_source``
those of one surface without resets, eight trajectories in step.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from importlib import resources

from ...model import FilippovSystem, motion
from ...model.printing.programs import is_flat, lanes_program, modes_program
from .. import facts
from ..status import Status

#: More modes than this (four surfaces) compile for too long: the reference driver serves them.
MAX_MODES = 20

_SCALAR_TYPE = """
typedef double T;
#define BC(v) (v)
#define FUNCTION static void
"""

_SCALAR_FUNCTIONS = (
    "sqrt exp log sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh atan2 pow erf hypot "
    "expm1 log1p"
).split()


@lru_cache(maxsize=32)
def driver_text(name: str) -> str:
    """Return one of the files in C beside this module."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def supports_scalar(system: FilippovSystem) -> bool:
    """Whether the scalar engine can be generated for a system."""
    if (
        any(system.nonlinear) or system.impacts or system.sets
    ):  # hidden dynamics has multipliers as states: the reference driver's
        return False
    return system.surface_count < 8 and len(system.modes) <= MAX_MODES


def supports_lanes(system: FilippovSystem) -> bool:
    """Whether the lanes engine can be generated for a system."""
    return system.surface_count <= 1 and not (
        system.resets or system.impacts or any(system.nonlinear)
    )


def scalar_source(system: FilippovSystem, order: int) -> str:
    """C source of the engine for one trajectory at a time."""
    calls = "".join(f"#define {f.upper()}_ {f}\n" for f in _SCALAR_FUNCTIONS)
    calls += "#define ERFINV_ ns_erfinv\n"
    return "".join(
        [
            facts_header(),
            _sizes(system, order),
            driver_text("common.h"),
            _SCALAR_TYPE,
            calls,
            modes_program(system, order),
            _mode_tables(system),
            _dispatch(system),
            driver_text("scalar.c"),
        ]
    )


def lanes_source(system: FilippovSystem, order: int, width: int) -> str:
    """C source of the engine for ``width`` trajectories in step."""
    program, blend = lanes_program(system, order)
    (rows, checked), affine = blend.checked, blend.affine
    slots = 2 * system.surface_count + len(system.stops)
    cancelled = system.surface_count == 0 or motion(system, "s").regular
    directions = ", ".join(str(d) for _, d in system.stops) or "0"
    defines = (
        f"#define W {width}\n#define SLOTS {slots}\n#define STOPS {len(system.stops)}\n"
        f"#define CANCELLED {int(cancelled)}\n#define ROWS {len(rows)}\n"
        f"#define GUARDS {len(checked)}\n"
        f"#define CURVED {int(bool(affine) and not is_flat(system))}\n"
        f"static const int DIRECTION[] = {{{directions}}};\n"
        f"static const long long AFFINE_MODES[] = {{{_list(_affine_modes(system))}}};\n"
        f"static const int ROW[] = {{{_list(rows) or 0}}}, SLOT[] = {{{_list(checked) or 0}}};\n"
        f"static const int AFFINE[] = {{{', '.join(str(int(a)) for a in affine) or '1'}}};\n"
    )
    return "".join(
        [
            facts_header(),
            _sizes(system, order),
            defines,
            driver_text("common.h"),
            driver_text("vector.h"),
            program,
            driver_text("lanes.c"),
        ]
    )


def _affine_modes(system: FilippovSystem) -> list[int]:
    """Of above, below and sliding; a system without a surface has one mode."""
    modes = ["+", "-", "s"] if system.surface_count else [""] * 3
    return [int(motion(system, mode).affine) for mode in modes]


@lru_cache(maxsize=1)
def facts_header() -> str:
    """C of ``flow/facts.py`` and of the statuses: constants, enumerations, priorities."""
    numbers = {n: v for n, v in vars(facts).items() if n.isupper() and isinstance(v, (int, float))}
    states = [n for n, v in numbers.items() if isinstance(v, int) and v < 0]
    lines = [f"#define {n} {v!r}" for n, v in numbers.items() if n not in states]
    statuses = ", ".join(f"{s.name} = {s.value}" for s in Status)
    lines.append(f"enum {{ {statuses}, {', '.join(f'{n} = {numbers[n]}' for n in states)} }};")
    lines.append(f"enum {{ {', '.join(k.upper() for k in facts.KINDS)}, KINDS }};")
    lines.append(f"enum {{ {', '.join(k.upper() + '_GUARD' for k in facts.GUARDS)} }};")
    lines.append(f"enum {{ {', '.join(r.upper() or 'NO_REASON' for r in facts.REASONS)} }};")
    lines.append(_table("PRIORITY", [facts.PRIORITY[k] for k in facts.GUARDS]))
    lines.append(f"enum {{ LAG_COUNT = {len(facts.LAGS)} }};\n{_table('LAGS', facts.LAGS)}")
    return "\n".join(lines) + "\n"


def _table(name: str, values: Sequence[int]) -> str:
    return f"__attribute__((unused)) static const int {name}[] = {{{_list(values)}}};"


def _sizes(system: FilippovSystem, order: int) -> str:
    guards = [len(motion(system, mode).guards) for mode in system.modes]
    sizes = {
        "N": system.extended_dimension,
        "ND": system.dimension,
        "P": order,
        "M": system.surface_count,
        "MODES": len(system.modes),
        "NG": max(guards),
        "TIMED": int(system.time_dependent),
    }
    return "".join(f"#define {name} {value}\n" for name, value in sizes.items())


def _mode_tables(system: FilippovSystem) -> str:
    signs = [system.parse_mode(mode) for mode in system.modes]
    digit = {1: 0, -1: 1, 0: 2}
    numbers = {sum(3**i * digit[c] for i, c in enumerate(s)): k for k, s in enumerate(signs)}
    by_code = [numbers.get(c, -1) for c in range(3**system.surface_count)]
    motions = [motion(system, mode) for mode in system.modes]
    width = max(1, max(len(m.guards) for m in motions))
    rows = []
    for m in motions:
        row = [f"{{{facts.GUARDS.index(g.kind)}, {g.index}, {g.side}}}" for g in m.guards]
        rows.append("{" + ", ".join(row + ["{0, 0, 0}"] * (width - len(row))) + "}")
    letters = ", ".join("{" + (", ".join(map(str, s)) or "0") + "}" for s in signs)
    return (
        f"static const int LETTER[MODES][M1] = {{{letters}}};\n"
        f"static const int MODE_OF[] = {{{', '.join(map(str, by_code))}}};\n"
        f"static const int CANCELLED[MODES] = {{{_list(int(m.regular) for m in motions)}}};\n"
        f"static const int AFFINE[MODES] = {{{_list(int(m.affine) for m in motions)}}};\n"
        f"static const int GUARDS[MODES] = {{{_list(len(m.guards) for m in motions)}}};\n"
        f"static const int GUARD[MODES][NG1][3] = {{{', '.join(rows)}}};\n"
    )


def _list(values: Iterable[int]) -> str:
    return ", ".join(str(v) for v in values)


def _dispatch(system: FilippovSystem) -> str:
    modes = range(len(system.modes))
    jets = "\n".join(f"    case {k}: jet_{k}(x, q, c, g); break;" for k in modes)
    values = "\n".join(
        f"    case {k}: guard_values_{k}(x, q, value, gradient); break;" for k in modes
    )
    checks = "\n".join(
        f"    case {k}: values_{k}(x, q, f, g); break;"
        for k, mode in enumerate(system.modes)
        if not motion(system, mode).affine
    )
    maps = "\n".join(
        f"    case {j}: reset_map_{j}(x, q, y); break;" for j in range(len(system.resets))
    )
    text = (
        "static void jet(int mode, const double *x, const double *q, double *c, double *g) {\n"
        f"  switch (mode) {{\n{jets}\n  }}\n}}\n"
        "static void guard_values(int mode, const double *x, const double *q, double *value,\n"
        f"                         double *gradient) {{\n  switch (mode) {{\n{values}\n  }}\n}}\n"
        "static void values(int mode, const double *x, const double *q, double *f, double *g) {\n"
        f"  (void)x; (void)q; (void)f; (void)g;\n  switch (mode) {{\n{checks}\n  }}\n}}\n"
        "static void reset_map(int index, const double *x, const double *q, double *y) {\n"
        f"  (void)x; (void)q; (void)y;\n  switch (index) {{\n{maps}\n  }}\n}}\n"
    )
    if not system.surface_count:
        text += (
            "static void surface_values(const double *x, const double *q, double *h, double *g) "
            "{ (void)x; (void)q; (void)h; (void)g; }\n"
        )
    return text
