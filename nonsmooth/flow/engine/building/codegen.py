"""C sources of lanes and kernels: constants that Python and C share, fixed texts, generated functions."""

from __future__ import annotations

from ....model import Coupled, FilippovSystem, coupled_of
from ....model.printing.programs import lanes_program
from ....model.printing.set_program import set_program
from ...options import Options
from .core_source import driver_text, facts_header, listed

#: The order to which that of linear systems is raised: beyond, longer steps lose digits to terms that cancel.
_MOST_LINEAR = 22


def supports_lanes(system: FilippovSystem) -> bool:
    """Whether the lanes engine can be generated for a system."""
    return system.surface_count <= 1 and not system.written.tables and _has_only_plain_stops(system)


def supports_set_lanes(coupled: Coupled) -> bool:
    """Whether lanes can be generated for a system with a set: one, alone, of constant slopes."""
    system = coupled.system
    alone = len(system.sets) == 1 and system.surface_count == len(system.sets[0])
    moves = not coupled.affine or coupled.slope_moves.any()
    return alone and not moves and _has_only_plain_stops(system)


def _has_only_plain_stops(system: FilippovSystem) -> bool:
    """Whether all events are stops at a guard, without conditions, and multipliers enter linearly."""
    others = system.resets or system.impacts or any(system.nonlinear) or system.remembering
    others = others or system.complementarity or system.constraints
    return not others and system.definition.plain


def tape_order(system: FilippovSystem, options: Options) -> int:
    """Order of the series of one trajectory: a third more where all is linear."""
    order = options.order
    if system.coupled or not coupled_of(system).linearity.everywhere:
        return order
    return max(order, min((4 * order + 2) // 3, _MOST_LINEAR))


def lanes_source(system: FilippovSystem, order: int, width: int) -> str:
    """C source of the engine for ``width`` trajectories in step."""
    head, program = _lanes_head(system, order)
    texts = map(
        driver_text, ("core/common.h", "kernel/vector.h", "kernel/sines.h", "kernel/polynomials.h")
    )
    return "".join(
        [
            f"#define W {width}\n",
            head,
            *texts,
            program,
            *map(
                driver_text,
                ("kernel/records.h", "kernel/lanes.c", "kernel/exchange.c", "kernel/batch.c"),
            ),
        ]
    )


def device_source(system: FilippovSystem, order: int, threads: int, resident: int = 1) -> str:
    """C++ source of the same engine with a trajectory for each thread, for CUDA or any compiler."""
    head, program = _lanes_head(system, order)
    sizes = f"#define THREADS {threads}\n#define RESIDENT {resident}\n#define RANDOM 0\n"
    texts = map(
        driver_text, ("core/common.h", "kernel/lane.h", "kernel/sines.h", "kernel/polynomials.h")
    )
    parts = [driver_text("kernel/cuda.h"), sizes, head, *texts, program]
    return "".join([*parts, driver_text("kernel/lanes.c"), driver_text("kernel/cuda.c")])


def _lanes_head(system: FilippovSystem, order: int) -> tuple[str, str]:
    """Definitions that the lanes' text needs before it, and the functions of a system."""
    program, shape = lanes_program(system, order)
    of = coupled_of(system)
    m, directions = system.surface_count, listed(d for _, d in system.stops) or 0
    # The sliding field has no 0/0 where both fields are tangent.
    cancelled = not m or of.continuous[0] or of.scaled[0]
    modes, affine = (listed(map(int, flags)) for flags in (shape.affine_modes, shape.affine))
    defines = (
        f"#define SLOTS {len(shape.affine)}\n#define STOPS {len(system.stops)}\n"
        f"#define CANCELLED {int(cancelled)}\n#define ROWS {len(shape.rows)}\n"
        f"#define GUARDS {len(shape.slots)}\n"
        f"#define CURVED {int(any(of.linearity.curved_guards[:m]))}\n"
        f"#define LINEAR {int(all(shape.affine_modes))}\n"
        f"static const int DIRECTION[] = {{{directions}}};\n"
        f"static const long long AFFINE_MODES[] = {{{modes}}};\n"
        f"static const int ROW[] = {{{listed(shape.rows) or 0}}}, SLOT[] = {{{listed(shape.slots) or 0}}};\n"
        f"static const int AFFINE[] = {{{affine or 1}}};\n"
    )
    return facts_header() + _sizes(system, order) + defines, program


#: Characters of a program from which on a step's instructions fill a processor's nearest memory of 32 KiB: measured.
_LONG_TEXT = 200_000


def set_lanes_source(coupled: Coupled, order: int, width: int) -> str:
    """C source of the engine in step of a system that ``supports_set_lanes``."""
    system, program = coupled.system, set_program(coupled, order)
    directions = listed(d for _, d in system.stops) or "0"
    groups = 8 if len(program.text) > _LONG_TEXT else 2
    defines = (
        f"#define W {width}\n#define GROUPS {groups}\n#define K {system.surface_count}\n#define STOPS {len(system.stops)}\n"
        f"#define ROWS {len(program.rows)}\n#define ON_ROWS {len(program.on_rows)}\n#define NAMED {int(bool(program.states))}\n"
        f"#define BENT_SLIP {int(program.bent_slip)}\n#define BENT_STOPS {int(program.bent_stops)}\n"
        f"__attribute__((unused)) static const int DIRECTION[] = {{{directions}}};\n"
        f"__attribute__((unused)) static const int ROW[] = {{{listed(program.rows) or 0}}};\n"
        f"__attribute__((unused)) static const int ON_ROW[] = {{{listed(program.on_rows) or 0}}};\n"
        f"__attribute__((unused)) static const int OWN[] = {{{listed(program.states) or 0}}};\n"
    )
    drivers = (
        "kernel/polynomials.h",
        "kernel/records.h",
        "kernel/set_state.h",
        "kernel/exchange.c",
        "kernel/set_lanes.c",
        "kernel/set_steps.c",
    )
    texts = [
        *map(driver_text, ("core/common.h", "kernel/vector.h", "kernel/sines.h")),
        program.text,
    ]
    return "".join(
        [facts_header(), _sizes(system, order), defines, *texts, *map(driver_text, drivers)]
    )


def _sizes(system: FilippovSystem, order: int) -> str:
    # Steps of lanes have a longest one, where all terms vanish; one as long is the driver's.
    sizes: dict[str, float] = {
        "LONGEST": 0.5 * 10 ** (300 / (order + 2)),
        "N": system.extended_dimension,
        "ND": system.dimension,
        "P": order,
        "M": system.surface_count,
        "TIMED": int(system.time_dependent),
    }
    return "".join(f"#define {name} {value!r}\n" for name, value in sizes.items())
