"""Facts of the event logic that every driver shares: constants, kinds, priorities, reasons.

The drivers in C get them from here too (``compiled/codegen.py`` writes them into the source), so a
number or an order has one place.
"""

from __future__ import annotations

import sys

from ..model.laws.multiplier_series import FALL, LIMIT_FALL

__all__ = ["FALL", "LIMIT_FALL"]  # and all below

EPSILON = sys.float_info.epsilon

#: Local errors add up over a run; a twentieth keeps the global error near the tolerance.
SAFETY = 0.05

#: The last terms of a guard's series stay below this part of all of them, however small the guard is
#: beside the tolerance: beyond its circle of convergence a polynomial has roots that the guard has not.
RESOLVED = 1e-3

#: A defect this many times the local tolerance is no truncation error.
WRONG = 200.0

#: A step is looked at in every octave below it, down to a length that is known to be safe, if it is
#: more than this many times the one before in its mode; or, if it is the first there, more than so many
#: times the time in which the state changes by its size, down to this part of that time.
GROWTH = 2.0
FAR = 10.0
FIRST = 0.01

#: Points inside a step at which the defect is looked at besides the end, and in each such octave.
CHECKS, OCTAVE = 1, 8

#: So many steps that had to be halved for their defect, most of them in a row, are an end.
SHORTENED = 40

#: Halved steps are steady above this part of the one before. Steady ones are an end only if they do not
#: grow and are much shorter (FAR) than what the series allows: at a branch point.
STEADY = 0.9

#: Part of a step at which its end is looked at, and of one that ends with an event: that may be the
#: end of the field's domain, or a point where it is 0/0.
JUST = 1 - 1e-9
BEFORE_EVENT = 0.99

#: Two events closer than this, relative to the time, and than the rounding of their roots, are
#: simultaneous; a stop is then served first.
TIE = 8 * EPSILON

#: What comes this much after the end of a run, relative to the time, is at its end.
AT_END = 64 * EPSILON

#: Lanes leave events closer than this, relative to the time, to the scalar driver.
NEAR = 1e-13

#: Rounding of a polynomial's value, relative to the sum of the magnitudes of its terms.
ROUNDING = 4 * EPSILON

#: The same where a root's place is asked for.
ROOT_ROUNDING = 16 * EPSILON

#: A point is on a surface where h is zero to this much of its terms.
ON_SURFACE = 16 * EPSILON

#: A coefficient of a guard below this part of its terms is zero by rounding.
VANISHES = 64 * EPSILON

#: Both fields are tangent where they are at this angle to the surface.
TANGENT = 2e-14

#: A step this short, relative to the time and to that of the run, is swallowed by rounding.
SHORTEST = 4 * EPSILON

#: Halvings of the interval before two roots count as one that touches without crossing.
DEPTH = 52

# Events that accumulate: the patterns that are tried (an impact 1, a crossing pair 2, a relay pair
# 4), blocks of each, how steady their ratio is, and what is left, relative to the time of the run.
LAGS = (1, 2, 3, 4, 6)
BLOCKS = 6
SPREAD = 0.02
SHRINKS = 0.9999
REMAINING = 1e-6
AT_ONCE = 40  # events at one instant

#: A set h = 0 is reached in one step where what friction's turning could still do is this part of the
#: local tolerance. One that was left is far where |h| is this much of its terms.
REACHED = 0.1
LEFT = 1e-6

#: A set is reached where no more than so many of the shortest steps are left to it.
TENFOLD = 20.0

#: Coefficients of a series grow as the inverse time to a set to their order: it is reached before they
#: are larger than this.
OVERFLOW = 1e280

#: Kinds of events, by number in ensembles and in C.
KINDS = ("crossing", "entry", "exit", "stop", "reset", "impact", "contact", "release", "end")

#: So many of them, the first and the last, can happen without resets and impacts.
SIMPLE_KINDS = 5

#: Kinds of guards, by number in C, and which is served first among simultaneous ones.
GUARDS = (
    *("surface", "exit", "stop", "reset", "impact", "release", "branch"),
    *("near", "slip"),
)
PRIORITY = {
    "stop": 0,
    "reset": 1,
    "impact": 2,
    "surface": 3,
    "exit": 4,
    "release": 5,
    "branch": 6,
    "near": 3,
    "slip": 4,
}

#: Why a run ended, besides its status, by number in C.
REASONS = (
    "",
    "two_fold",
    "slid_to_two_fold",
    "ambiguous",
    "no_mode",
    "degenerate",
    "wrong_start",
    "field",
    "surface",
    "reset_map",
    "branch_point",
    "state",
    "pressed",
    "two_sided",
    "multiple_zero",
    "looked_at",
    "behind",
    "no_impulse",
    "restitution",
    "no_reaction",
    "no_stable_motion",
    "possibly_several",
)

#: Not a status: the run goes on in the next call, after its arrays were emptied, or elsewhere.
RUNNING, FULL, HAND_OVER = -1, -2, -3
