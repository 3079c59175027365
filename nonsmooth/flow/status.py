"""Status of a run, and advice for each status."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Why a run ended.

    It reached its end (REACHED_END) or a stop (STOPPED); the motion is not unique (NON_UNIQUE); events
    accumulate (ACCUMULATION); several surfaces meet where no motion is stable (INTERSECTION); steps
    became too short (STEP_TOO_SMALL); a value is not finite (NOT_FINITE); a limit on events or steps was
    reached (TOO_MANY_EVENTS, TOO_MANY_STEPS); a constraint cannot be satisfied (INCONSISTENT); jumps at one
    instant do not end (ENDLESS_JUMPS). The message of a run has details. The values are stable: ensembles store
    them in arrays and files.
    """

    REACHED_END = 0
    STOPPED = 1
    NON_UNIQUE = 2
    ACCUMULATION = 3
    INTERSECTION = 4
    STEP_TOO_SMALL = 5
    NOT_FINITE = 6
    TOO_MANY_EVENTS = 7
    TOO_MANY_STEPS = 8
    INCONSISTENT = 9
    ENDLESS_JUMPS = 10

    def __str__(self) -> str:
        return self.name

    @property
    def complete(self) -> bool:
        """Whether the run reached its end or a stop."""
        return self in (Status.REACHED_END, Status.STOPPED)


ADVICE: dict[Status, str] = {
    Status.REACHED_END: "The run reached t_end.",
    Status.STOPPED: "The run reached a stop or the last event of its section.",
    Status.NON_UNIQUE: "The motion is not unique from here; continue from the last state with "
    "start_mode= and one of the modes.",
    Status.ACCUMULATION: "Events accumulate in finite time (Zeno); continue from the limit with "
    "the mode that is admissible there. If a Reset stands for a contact, declare an Impact: it comes to rest.",
    Status.INTERSECTION: "At this intersection of surfaces Filippov's convention with independent "
    "multipliers has no stable motion; check the fields around the last state.",
    Status.INCONSISTENT: "A constraint cannot hold here: the state is behind it, or no reaction (or "
    "more than one) keeps the contact (Painleve's paradox); check the gaps and the friction.",
    Status.STEP_TOO_SMALL: "The solution has a singularity here, or the tolerance is below "
    "rounding: loosen tol (atol alone where states are large) or check the fields near the last "
    "state.",
    Status.NOT_FINITE: "A field or a switching function is not a finite number here: check "
    "logarithms, roots and divisions at the last state.",
    Status.TOO_MANY_EVENTS: "Raise max_events if this many are expected; otherwise the motion "
    "chatters. rest_below= lets a relay in a position, or a body on an edge, rest once it is slow.",
    Status.ENDLESS_JUMPS: "Each jump makes another one due at the same instant: give these events a when= "
    "that a jump makes false, or raise max_jumps if this many are expected.",
    Status.TOO_MANY_STEPS: "Raise max_steps if the run is long; otherwise loosen tol.",
}
