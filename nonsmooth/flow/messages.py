"""Messages of the ends of runs."""

from __future__ import annotations

from collections.abc import Sequence


def held_by_decay(t: float, step: float, is_possible: bool) -> str:
    """Explicit steps that a decay rate holds."""
    advice = (
        "method='auto' takes implicit steps."
        if is_possible
        else "Systems with vector multipliers have no implicit steps."
    )
    return (
        f"The steps are held near {step:.1e} at t = {t:.6g} by a decay rate of about {8 / step:.0e}, much faster "
        f"than the motion: the system is stiff there. {advice}"
    )


def two_fold(surface: int) -> str:
    """Start or arrival at a two-fold off sliding."""
    return (
        f"Both fields are tangent to h{surface} = 0: a two-fold, where the sliding field is 0/0 "
        "and Filippov's convention does not determine the motion."
    )


def slid_to_two_fold(surface: int) -> str:
    """Arrival at a two-fold by sliding."""
    return f"Sliding reached a two-fold of h{surface} = 0: both fields are tangent there."


def ambiguous(modes: Sequence[str], names: Sequence[str]) -> str:
    """Several modes can continue."""
    differing = [i for i, letters in enumerate(zip(*modes, strict=True)) if len(set(letters)) > 1]
    surfaces = " and ".join(names[i] for i in differing)
    where = (
        "an intersection" if len(differing) > 1 else "repelling sliding or a fold of both fields"
    )
    listed = ", ".join(repr(m) for m in modes)
    first = "" if len(differing) > 1 else ", at once or after sliding for a while"
    return (
        f"On {surfaces} = 0 ({where}) the motion can continue in each of the modes {listed}{first}."
    )


def undetermined_rates(entries: Sequence[int]) -> str:
    """Several multipliers keep the same surfaces, with different fields."""
    surfaces = " and ".join(f"h{k}" for k in entries)
    return (
        f"On {surfaces} = 0 many sets of multipliers keep the motion on the surfaces, and the field differs "
        "between them. Only a combination of them is determined."
    )


def stability_lost(name: str, t: float) -> str:
    """Loss of the stability of sliding on several surfaces."""
    return (
        f"At t = {t:.8g} sliding on {name} and other surfaces loses its stability across their layers: an "
        "eigenvalue of dh/dx df/dlambda, or a pair, reaches the imaginary axis."
    )


def multiple_zero(surface: int) -> str:
    """The gradient of a switching function vanishes with it."""
    return (
        f"The gradient of h{surface} vanishes where h{surface} does: a multiple zero, which cannot be "
        "located to rounding. Write the surface with a simple zero, x - 1 instead of (x - 1)**3."
    )


def indefinite(name: str) -> str:
    """The friction matrix of a set is indefinite."""
    return (
        f"On {name} = 0 the matrix M = -dh/dx df/dlambda has a negative direction: an indefinite friction matrix "
        "(Painleve's paradox, or a negative load), for which several motions can follow."
    )


def undetermined(names: Sequence[str]) -> str:
    """No unique multiplier of a set."""
    return (
        f"On {' and '.join(names)} = 0 the multiplier is not unique: the matrix M = -dh/dx df/dlambda is "
        "singular there, or close to it (friction that does not act in some direction)."
    )


def several_directions(count: int) -> str:
    """A set can be left in several ways."""
    return f"The set h = 0 can be left in {count} directions: M is far from symmetric."


def degenerate() -> str:
    """No mode can continue, to rounding."""
    return "No mode continues from here to rounding: a degenerate tangency."


def no_stable_motion(surfaces: Sequence[int]) -> str:
    """No mode leaves an intersection or slides stably along it."""
    return f"No mode leaves or slides stably along {' and '.join(f'h{i}' for i in surfaces)} = 0."


def possibly_several(surfaces: Sequence[int]) -> str:
    """A complementarity problem without a proof of uniqueness."""
    return (
        f"On {' and '.join(f'h{i}' for i in surfaces)} = 0 more than one set of multipliers may hold: "
        "the matrix dh/dx df/dlambda is not known to be a P-matrix, for which there is one."
    )


def high_degree(surface: int) -> str:
    """Rest on a surface of relative degree three or more."""
    return (
        f"Rest on h{surface} = 0 is one of many motions: the multiplier enters the third derivative of "
        f"h{surface} or a later one, and motions leave such a point by infinitely many switchings. "
        "start_mode='s' chooses rest."
    )


def wrong_start(mode: str, actual: str) -> str:
    """The start mode is not admissible."""
    return f"start_mode {mode!r} is not admissible at the start, where the mode is {actual!r}."


def impossible_start(mode: str) -> str:
    """The start mode cannot leave the start."""
    return f"start_mode {mode!r} cannot continue from the start: its field points elsewhere."


def start_solutions(mode: str, count: int) -> str:
    """The start mode has no multipliers, or several sets."""
    return f"start_mode {mode!r} has {count} sliding solutions here."


def field_not_finite(mode: str, x: Sequence[float]) -> str:
    """The field of a mode is not finite at a state."""
    return f"The field of mode {mode!r} at ({', '.join(f'{v:.6g}' for v in x)})."


def state_not_finite(t: float) -> str:
    """A step ends outside the numbers."""
    return f"The state after a step from t = {t:.10g}."


def surface_not_finite() -> str:
    """A switching function is not finite."""
    return "A switching function is not finite."


def reset_not_finite(name: str, t: float) -> str:
    """The map of a reset is not finite."""
    return f"The map of reset {name!r} at t = {t:.10g}."


def discrete_value(name: str, t: float) -> str:
    """A map gives a discrete state another value."""
    return (
        f"The map of reset {name!r} at t = {t:.10g} gives a discrete state a value that is not among those "
        "of discrete=."
    )


def endless_jumps(names: Sequence[str], t: float) -> str:
    """Jumps at one instant that do not end."""
    return f"At t = {t:.10g} jumps of {' and '.join(map(repr, names))} repeat without end."


def unmet(name: str) -> str:
    """An event whose condition was true from the start on."""
    return (
        f"{name!r} was true at the start and did not happen: events happen where they become true. "
        "initially=True lets it happen at the start, level=True while it is true, initially=False says no more of it."
    )


def reached_end(t_end: float) -> str:
    """Nothing stopped the run."""
    return f"t_end = {t_end:g} reached."


def stopped(name: str, t: float) -> str:
    """A stop fired."""
    return f"{name!r} at t = {t:.10g}."


def sampled(count: int, t: float) -> str:
    """The last sample of a section."""
    return f"Sample {count} of the section at t = {t:.10g}."


def accumulation(events: int, limit: float) -> str:
    """Events accumulate."""
    return f"After {events} events; estimated limit t = {limit:.12g}."


def behind(name: str, t: float) -> str:
    """A gap is negative."""
    return f"The gap of {name!r} is negative at t = {t:.10g}."


def off_constraint(name: str, what: str, value: float, t: float) -> str:
    """A state that does not satisfy a constraint."""
    return (
        f"{what} of {name!r} is {value:.6g} at t = {t:.10g}, and has to be 0. Start on the constraint, with velocities "
        "along it, and let jumps keep it."
    )


def dead_point(names: Sequence[str], t: float) -> str:
    """Constraints that cannot all be kept."""
    return (
        f"No reactions keep {' and '.join(map(repr, names))} at t = {t:.10g}: the constraints contradict one another, or "
        "become dependent there, as those of a linkage at its dead point."
    )


def no_impulse(name: str, t: float) -> str:
    """No impulses satisfy the law of impact and friction."""
    return f"No impulse fits the impact {name!r} at t = {t:.10g}."


def restitution(name: str, t: float) -> str:
    """A coefficient of restitution that gives energy, or pushes on."""
    return f"The restitution of {name!r} is not from 0 to 1 at t = {t:.10g}."


def no_jump(name: str, t: float) -> str:
    """No jump leads to y >= 0."""
    return f"y of {name!r} is negative at t = {t:.10g}, and no impulses of the multipliers lead to y >= 0."


def no_reaction(names: Sequence[str], algebraic: bool = False) -> str:
    """No reactions are consistent with closed or opening contacts."""
    advice = (
        " No multipliers keep y >= 0: a sign is wrong, or a source forces a current through diodes that block or a "
        "voltage on diodes that conduct. Give it a resistance."
    )
    return f"At {' and '.join(map(repr, names))} neither the closed contact nor an open one holds.{advice * algebraic}"


def pressed(name: str, t: float) -> str:
    """A reset leaves the motion pressed against its zero."""
    return (
        f"Reset {name!r} leaves the motion pressed against its zero at t = {t:.10g}: it rests there. "
        "Declare nonsmooth.Impact for a contact that lasts."
    )


def two_sided(name: str) -> str:
    """A start on the zero of a reset without a direction."""
    return (
        f"The run is on the zero of reset {name!r}, which has no direction and would turn the motion "
        "round: it may be a floor or a ceiling. Give it a direction: -1 where its function falls to "
        "zero, 1 where it rises."
    )


def too_many(what: str, count: int) -> str:
    """A limit of the run was reached."""
    return f"{count} {what}."


def branch_point(t: float) -> str:
    """A polynomial passed where the field has no derivatives, and is no solution beyond."""
    return (
        f"The field stops being smooth just after t = {t:.8g}: a root or a power of something that "
        "reaches zero there. End the run before, with a Stop at a small positive value of it."
    )


def step_too_small(h: float) -> str:
    """Rounding swallows the step."""
    return f"A step of {h:.1e} would be needed."
