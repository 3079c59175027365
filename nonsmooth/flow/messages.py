"""Messages of the ends of runs: a sentence for each reason, or for the status of a run without one.

Fields in braces are those of ``engine/convert.py``.
"""

from __future__ import annotations

from collections.abc import Sequence

SENTENCES = {
    # by the status
    "REACHED_END": "t_end = {t_end:g} reached.",
    "STOPPED": "Stop {stop!r} at t = {t:.10g}.",
    "ACCUMULATION": "After {events} events; estimated limit t = {limit:.12g}.",
    "ENDLESS_JUMPS": "At t = {t:.10g} jumps of {jumps} repeat without end.",
    "TOO_MANY_EVENTS": "{max_events} events.",
    "TOO_MANY_STEPS": "{max_steps} steps.",
    "STEP_TOO_SMALL": "A step of {shortest:.1e} would be needed.",
    "NON_UNIQUE": "No mode continues from here to rounding: a degenerate tangency.",
    # by the reason
    "sampled": "Sample {where} of the section at t = {t:.10g}.",
    "two_fold": "Both fields are tangent to h{entry} = 0: a two-fold, where the sliding field is 0/0 "
    "and Filippov's convention does not determine the motion.",
    "slid_to_two_fold": "Sliding reached a two-fold of h{entry} = 0: both fields are tangent there.",
    "ambiguous": "On {differing} = 0 ({situation}) the motion can continue in each of the modes {modes}{delay}.",
    "undetermined_rates": "On {entries} = 0 many sets of multipliers keep the motion on the surfaces, and the "
    "field differs between them. Only a combination of them is determined.",
    "stability_lost": "At t = {t:.8g} sliding on {surface} and other surfaces loses its stability across their "
    "layers: an eigenvalue of dh/dx df/dlambda, or a pair, reaches the imaginary axis.",
    "multiple_zero": "The gradient of h{entry} vanishes where h{entry} does: a multiple zero, which cannot be "
    "located to rounding. Write the surface with a simple zero, x - 1 instead of (x - 1)**3.",
    "indefinite": "On {surface} = 0 the friction matrix M = -dh/dx df/dlambda is indefinite (Painleve's paradox, or a "
    "negative load): several motions can follow.",
    "undetermined": "On {sets} = 0 the multiplier is not unique: the matrix M = -dh/dx df/dlambda is singular "
    "there, or close to it (friction that does not act in some direction).",
    "several_directions": "The set h = 0 can be left in {where} directions: M is far from symmetric.",
    "no_stable_motion": "No mode leaves or slides stably along {entries} = 0.",
    "possibly_several": "On {entries} = 0 the multipliers may not be unique: the matrix dh/dx df/dlambda "
    "is not known to be a P-matrix, for which they are.",
    "high_degree": "Rest on h{entry} = 0 is one of many motions: the multiplier enters the third derivative of "
    "h{entry} or a higher one, and motions leave such a point by infinitely many switchings. "
    "start_mode='s' chooses rest.",
    "spiral_out": "Rest on h{entry} = 0 is one of many motions: a multiplier drives the rate of h{entry} away from zero, "
    "and motions leave such a point in infinitely many growing turns. start_mode= chooses rest.",
    "wrong_start": "start_mode {start_mode!r} is not admissible at the start, where the mode is {actual!r}.",
    "impossible_start": "start_mode {start_mode!r} cannot continue from the start: its field leads out of the mode.",
    "start_solutions": "start_mode {start_mode!r} has {where} sliding solutions here.",
    "field": "The field of mode {mode!r} at ({state}).",
    "state": "The state after a step from t = {t:.10g}.",
    "surface": "A switching function is not finite.",
    "out_of_table": "The argument {argument} of a table left its range at t = {t:.10g}: with outside='error' it has "
    "no value there.",
    "reset_map": "The map of reset {reset!r} at t = {t:.10g}.",
    "discrete_value": "The map of reset {reset!r} at t = {t:.10g} gives a discrete state a value that is not "
    "among those of discrete=.",
    "behind": "The gap of {impact!r} is negative at t = {t:.10g}.",
    "off_constraint": "{what} of {constraint!r} is {limit:.6g} at t = {t:.10g}, and has to be 0. Start on the "
    "constraint, with velocities along it, and let jumps keep it.",
    "dead_point": "No reactions keep {constraints} at t = {t:.10g}: the constraints contradict one another, or "
    "become dependent there, as those of a linkage at its dead point.",
    "no_impulse": "No impulse fits the impact {impact!r} at t = {t:.10g}.",
    "restitution": "The restitution of {impact!r} is not from 0 to 1 at t = {t:.10g}.",
    "no_jump": "y of {surface!r} is negative at t = {t:.10g}, and no impulses of the multipliers lead to y >= 0.",
    "no_reaction": "At {contacts} neither a closed nor an open contact is admissible.{equations}",
    "pressed": "After reset {reset!r} at t = {t:.10g} the field leads back into its zero: the motion rests there. "
    "Declare nonsmooth.Impact for a contact that lasts.",
    "two_sided": "The run is on the zero of reset {reset!r}, which has no direction and would reverse the motion: "
    "it may be a floor or a ceiling. Give it a direction: -1 where its function falls to zero, 1 where it rises.",
    "branch_point": "The field is not smooth just after t = {t:.8g}: the argument of a root or a power reaches zero "
    "there. Make that argument a surface, surface= with above= and below=: a run passes the root of a switching "
    "function. Or end the run before, with a Stop at a small positive value of it.",
    "decay": "A decay rate of about {decay:.0e}, much faster than the motion, limits the steps to {step:.1e} near "
    "t = {t:.6g}: the system is stiff there. {implicit}",
}

#: Note on an event whose condition was true from the start on.
UNFIRED = (
    " {name!r} was true at the start and did not fire: events fire where they become true. "
    "initially=True fires it at the start, level=True while it is true; initially=False drops this note."
)

#: Where several modes can continue, in one surface or in more, and when.
SITUATIONS = ("repelling sliding or a fold of both fields", "an intersection")
DELAYS = (", at once or after sliding for a while", "")

#: Notes on diodes and other conditions without a solution, and on steps that a decay rate limits.
EQUATIONS = (
    " No multipliers keep y >= 0: a sign is wrong, or a source forces a current through blocking diodes or a voltage "
    "on conducting ones. Give it a resistance."
)
IMPLICIT = "method='auto' takes implicit steps."
NO_IMPLICIT = "Systems with vector multipliers have no implicit steps."


def listed(x: Sequence[float]) -> str:
    """A state in a message."""
    return ", ".join(f"{v:.6g}" for v in x)
