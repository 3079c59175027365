"""What the runs say when they end: one wording for every engine."""

from __future__ import annotations

from collections.abc import Sequence


def two_fold(surface: int) -> str:
    """Start or arrival at a two-fold off sliding."""
    return (
        f"Both fields are tangent to h{surface} = 0: a two-fold, where the sliding field is 0/0 "
        "and the future is not decided by Filippov's convention."
    )


def slid_to_two_fold(surface: int) -> str:
    """Arrival at a two-fold by sliding."""
    return f"Sliding reached a two-fold of h{surface} = 0: both fields are tangent there."


def ambiguous(modes: Sequence[str]) -> str:
    """Several modes can continue."""
    differing = [i for i, letters in enumerate(zip(*modes, strict=True)) if len(set(letters)) > 1]
    surfaces = " and ".join(f"h{i}" for i in differing)
    where = (
        "an intersection" if len(differing) > 1 else "repelling sliding or a fold of both fields"
    )
    listed = ", ".join(repr(m) for m in modes)
    first = "" if len(differing) > 1 else ", at once or after sliding for a while"
    return (
        f"On {surfaces} = 0 ({where}) the motion can continue in each of the modes {listed}{first}."
    )


def degenerate() -> str:
    """No mode can continue, to rounding."""
    return "No mode continues from here to rounding: a degenerate tangency."


def no_stable_motion(surfaces: Sequence[int]) -> str:
    """No mode leaves an intersection or slides stably along it."""
    return f"No mode leaves or slides stably along {' and '.join(f'h{i}' for i in surfaces)} = 0."


def wrong_start(asked: str, actual: str) -> str:
    """The mode asked for does not hold at the start."""
    return f"start_mode {asked!r} does not hold at the start, where the mode is {actual!r}."


def impossible_start(asked: str) -> str:
    """The mode asked for cannot leave the start."""
    return f"start_mode {asked!r} cannot continue from the start: its field points elsewhere."


def field_not_finite(mode: str, x: Sequence[float]) -> str:
    """The field of a mode is not finite at a state."""
    return f"The field of mode {mode!r} at ({', '.join(f'{v:.6g}' for v in x)})."


def surface_not_finite() -> str:
    """A switching function is not finite."""
    return "A switching function is not finite."


def reset_not_finite(name: str, t: float) -> str:
    """The map of a reset is not finite."""
    return f"The map of reset {name!r} at t = {t:.10g}."


def reached_end(t_end: float) -> str:
    """Nothing stopped the run."""
    return f"t_end = {t_end:g} reached."


def stopped(name: str, t: float) -> str:
    """A stopping surface was met."""
    return f"{name!r} at t = {t:.10g}."


def accumulation(events: int, limit: float) -> str:
    """Events accumulate."""
    return f"After {events} events; estimated limit t = {limit:.12g}."


def too_many(what: str, count: int) -> str:
    """A limit of the run was met."""
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
