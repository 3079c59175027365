"""The C source of an engine: tables and generated functions of a system, then a fixed driver.

``scalar_source`` serves every system whose modes have at most one sliding surface; ``lanes_source``
those of one surface without resets, eight trajectories in step.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import resources

from ...model import FilippovSystem, motion
from ...model.programs import has_branches, is_flat, lanes_program, modes_program

_KINDS = {"surface": 0, "exit": 1, "stop": 2, "reset": 3}

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


@lru_cache(maxsize=8)
def _driver(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def supports_scalar(system: FilippovSystem) -> bool:
    """Whether the scalar engine can be generated for a system."""
    if any(system.nonlinear):  # hidden dynamics has multipliers as states: the reference driver's
        return False
    return system.surface_count < 8 and len(system.modes) <= MAX_MODES


def supports_lanes(system: FilippovSystem) -> bool:
    """Whether the lanes engine can be generated for a system."""
    return system.surface_count <= 1 and not system.resets and not any(system.nonlinear)


def scalar_source(system: FilippovSystem, order: int) -> str:
    """C source of the engine for one trajectory at a time."""
    calls = "".join(f"#define {f.upper()}_ {f}\n" for f in _SCALAR_FUNCTIONS)
    calls += "#define ERFINV_ ns_erfinv\n"
    return "".join(
        [
            _sizes(system, order),
            _driver("common.h"),
            _SCALAR_TYPE,
            calls,
            modes_program(system, order),
            _mode_tables(system),
            _dispatch(system),
            _driver("scalar.c"),
        ]
    )


def lanes_source(system: FilippovSystem, order: int, width: int) -> str:
    """C source of the engine for ``width`` trajectories in step."""
    program, affine = lanes_program(system, order)
    slots = 2 * system.surface_count + len(system.stops)
    cancelled = system.surface_count == 0 or motion(system, "s").cancelled
    directions = ", ".join(str(d) for _, d in system.stops) or "0"
    defines = (
        f"#define W {width}\n#define SLOTS {slots}\n#define STOPS {len(system.stops)}\n"
        f"#define CANCELLED {int(cancelled)}\n#define BRANCHES {int(has_branches(system))}\n"
        f"#define CURVED {int(bool(affine) and not is_flat(system))}\n"
        f"static const int DIRECTION[] = {{{directions}}};\n"
        f"static const int AFFINE[] = {{{', '.join(str(int(a)) for a in affine) or '1'}}};\n"
    )
    return "".join(
        [
            _sizes(system, order),
            defines,
            _driver("common.h"),
            _driver("vector.h"),
            program,
            _driver("lanes.c"),
        ]
    )


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
        row = [f"{{{_KINDS[g.kind]}, {g.index}, {g.side}}}" for g in m.guards]
        rows.append("{" + ", ".join(row + ["{0, 0, 0}"] * (width - len(row))) + "}")
    letters = ", ".join("{" + (", ".join(map(str, s)) or "0") + "}" for s in signs)
    return (
        f"static const int LETTER[MODES][M1] = {{{letters}}};\n"
        f"static const int MODE_OF[] = {{{', '.join(map(str, by_code))}}};\n"
        f"static const int CANCELLED[MODES] = {{{_list(int(m.cancelled) for m in motions)}}};\n"
        f"static const int BRANCHES[MODES] = {{{_list(int(m.branches) for m in motions)}}};\n"
        f"static const int GUARDS[MODES] = {{{_list(len(m.guards) for m in motions)}}};\n"
        f"static const int GUARD[MODES][NG1][3] = {{{', '.join(rows)}}};\n"
    )


def _list(values: object) -> str:
    return ", ".join(str(v) for v in values)  # type: ignore[attr-defined]


def _dispatch(system: FilippovSystem) -> str:
    modes = range(len(system.modes))
    jets = "\n".join(f"    case {k}: jet_{k}(x, q, c, g); break;" for k in modes)
    values = "\n".join(
        f"    case {k}: guard_values_{k}(x, q, value, gradient); break;" for k in modes
    )
    fields = "\n".join(
        f"    case {k}: field_{k}(x, q, f); break;"
        for k, mode in enumerate(system.modes)
        if motion(system, mode).branches
    )
    maps = "\n".join(
        f"    case {j}: reset_map_{j}(x, q, y); break;" for j in range(len(system.resets))
    )
    text = (
        "static void jet(int mode, const double *x, const double *q, double *c, double *g) {\n"
        f"  switch (mode) {{\n{jets}\n  }}\n}}\n"
        "static void guard_values(int mode, const double *x, const double *q, double *value,\n"
        f"                         double *gradient) {{\n  switch (mode) {{\n{values}\n  }}\n}}\n"
        "static void field(int mode, const double *x, const double *q, double *f) {\n"
        f"  (void)x; (void)q; (void)f;\n  switch (mode) {{\n{fields}\n  }}\n}}\n"
        "static void reset_map(int index, const double *x, const double *q, double *y) {\n"
        f"  (void)x; (void)q; (void)y;\n  switch (index) {{\n{maps}\n  }}\n}}\n"
    )
    if not system.surface_count:
        text += (
            "static void surface_values(const double *x, const double *q, double *h, double *g) "
            "{ (void)x; (void)q; (void)h; (void)g; }\n"
        )
    return text
