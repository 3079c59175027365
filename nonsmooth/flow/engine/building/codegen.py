"""C sources of lanes and kernels: constants that Python and C share, fixed texts, generated functions."""

from __future__ import annotations

from ....model import FilippovSystem, coupled_of, with_stops
from ....model.printing.programs import lanes_program
from ....model.printing.set_program import set_program
from ...options import Options
from .core_source import constants_header, driver_text, listed

#: Number of surfaces above which most steps have an event, or slide.
_MOST_SURFACES = 8

#: Largest order for linear systems: above it longer steps lose digits by cancellation.
_MOST_LINEAR = 22


def supports_lanes(system: FilippovSystem) -> bool:
    """Whether lanes can be generated: for surfaces, or one set of constant slopes, without tables and other laws."""
    if system.remembering or system.complementarity or system.constraints or system.written.tables:
        return False
    if system.sets:
        alone = len(system.sets) == 1 and system.surface_count == len(system.sets[0])
        coupled = coupled_of(system)
        steady = coupled.affine and not coupled.slope_moves.any() and not any(system.nonlinear)
        return alone and steady and not _has_jumps(system)
    return system.surface_count <= _MOST_SURFACES


def supports_device(system: FilippovSystem) -> bool:
    """Whether a kernel can be generated: one surface at most, and all events stops at a guard that is passed."""
    return supports_lanes(system) and not has_driven_events(system)


def has_driven_events(system: FilippovSystem) -> bool:
    """Whether the driver makes some events for lanes: all but stops, and those at one surface or set."""
    return _has_jumps(system) or driver_decides(system)


def _has_jumps(system: FilippovSystem) -> bool:
    """Whether a system has events besides stops at a guard that is passed."""
    return bool(system.resets or system.impacts or not system.definition.plain)


def driver_decides(system: FilippovSystem) -> bool:
    """Whether the driver makes the events at surfaces, and slides: all but one surface that lanes decide."""
    m, several = system.surface_count, system.definition.discrete or any(system.nonlinear)
    return not system.sets and m > 0 and bool(m > 1 or several or coupled_of(system).carriers[0])


def width_of_motion(system: FilippovSystem) -> int:
    """Numbers that a restart needs besides the state."""
    d = system.definition
    atoms, conditions = d.guards.numel(), sum(len(rule.triggers) for rule in d.rules)
    keeps = conditions * system.extended_dimension * any(rule.at_trigger for rule in d.rules)
    return 1 + (atoms > 0) * (5 + 4 * atoms + conditions + 3 * len(d.clocks) + keeps)


def interpreter_order(system: FilippovSystem, options: Options) -> int:
    """Order of the series of one trajectory: a third more where all is linear."""
    order = options.order
    if system.coupled or not coupled_of(system).linearity.everywhere:
        return order
    return max(order, min((4 * order + 2) // 3, _MOST_LINEAR))


#: Characters of a program above which a step's instructions exceed the first-level cache of 32 KiB: measured.
_LONG_TEXT = 200_000


def lanes_source(system: FilippovSystem, order: int, width: int) -> str:
    """C source of the engine for ``width`` trajectories in step."""
    head, program = _lanes_head(system, order)
    groups = 8 if system.sets and len(program) > _LONG_TEXT else 2
    before = ("core/common.h", "kernel/vector.h", "kernel/functions.h", "kernel/polynomials.h")
    sizes = f"#define W {width}\n#define GROUPS {groups}\n"
    parts = [sizes, head, *map(driver_text, before), program, driver_text("kernel/records.h")]
    after = ("kernel/exchange.c", "kernel/batch.c")
    return "".join([*parts, *_step_texts(system), *map(driver_text, after)])


def device_source(system: FilippovSystem, order: int, threads: int) -> str:
    """C++ source of the same engine with a trajectory for each thread, for CUDA or any compiler."""
    head, program = _lanes_head(system, order)
    sizes = f"#define THREADS {threads}\n#define RESIDENT 1\n#define RANDOM 0\n"
    before = ("core/common.h", "kernel/lane.h", "kernel/functions.h", "kernel/polynomials.h")
    parts = [driver_text("kernel/cuda.h"), sizes, head, *map(driver_text, before), program]
    return "".join([*parts, *_step_texts(system), driver_text("kernel/cuda.c")])


def _step_texts(system: FilippovSystem) -> list[str]:
    law = "set" if system.sets else "surface"
    return [driver_text(f"kernel/{name}") for name in ("state.h", f"{law}.c", "lanes.c")]


def _lanes_head(system: FilippovSystem, order: int) -> tuple[str, str]:
    """Definitions that the lanes' text needs before it, and the functions of a system."""
    driven = driver_decides(system)
    sizes: dict[str, float] = {
        "EVENTS": int(has_driven_events(system)),
        "CLEAR_STOPS": len(system.stops) if system.definition.plain else 0,
        "SURFACES": system.surface_count if driven else 0,
        "CONTACTS": len(system.impacts),
        "MOTION": width_of_motion(system),
        "PARAMETERS": len(system.parameter_names),
    }
    if sizes["EVENTS"]:
        system = with_stops(system, driven)
    of = coupled_of(system)
    program, shape = set_program(of, order) if system.sets else lanes_program(system, order)
    m, directions = system.surface_count, listed(d for _, d in system.stops) or 0
    # The sliding field has no 0/0 where both fields are tangent.
    cancelled = not m or of.continuous[0] or of.scaled[0]
    modes, affine = (listed(map(int, flags)) for flags in (shape.affine_modes, shape.affine))
    # Steps of lanes have a longest one, where all terms vanish; one as long is the driver's.
    sizes |= {
        "LONGEST": 0.5 * 10 ** (300 / (order + 2)),
        "N": system.extended_dimension,
        "ND": system.dimension,
        "P": order,
        "M": m,
        "TIMED": int(system.time_dependent),
        "SLOTS": len(shape.affine),
        "STOPS": len(system.stops),
        "CANCELLED": int(cancelled),
        "ROWS": len(shape.rows),
        "GUARDS": len(shape.slots),
        "NAMED": int(bool(shape.own)),
        "CURVED": int(any(of.linearity.curved_guards[:m])),
        "LINEAR": int(all(shape.affine_modes)),
    }
    numbers = "".join(f"#define {name} {value!r}\n" for name, value in sizes.items())
    arrays = (
        f"static const int DIRECTION[] = {{{directions}}};\n"
        f"static const long long AFFINE_MODES[] = {{{modes}}};\n"
        f"static const int ROW[] = {{{listed(shape.rows) or 0}}}, SLOT[] = {{{listed(shape.slots) or 0}}};\n"
        f"static const int AFFINE[] = {{{affine or 1}}}, OWN_STATE[] = {{{listed(shape.own) or 0}}};\n"
    )
    return constants_header() + numbers + arrays, program
