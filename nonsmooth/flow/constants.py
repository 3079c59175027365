"""Constants of the event logic in every driver: tolerances, kinds, priorities, reasons.

``engine/building/core_source.py`` writes them into the sources in C.
"""

from __future__ import annotations

import sys

from ..model.numbering import FALL, IMPACT_LAWS, LAWS, LIMIT_FALL, MOST_CODES, UNWATCHED

__all__ = ["FALL", "IMPACT_LAWS", "LAWS", "LIMIT_FALL", "MOST_CODES", "UNWATCHED"]  # and all below

EPSILON = sys.float_info.epsilon

#: Local errors add up over a run; a twentieth keeps the global error near the tolerance.
SAFETY = 0.05

#: Largest part of a guard's series in its last terms: beyond the circle of convergence the polynomial has
#: roots that the guard does not have.
RESOLVED = 1e-3

#: Defects above this many local tolerances are no truncation errors.
WRONG = 200.0

#: A step is checked in every octave below it, down to a safe length, if it is more than GROWTH times the
#: one before in its mode. The first step there is checked if it is more than FAR times the time in which
#: the state changes by its size, down to FIRST of that time.
GROWTH = 2.0
FAR = 10.0
FIRST = 0.01

#: The two terms before the last two may be this much larger within a step; else a series has a gap.
GAP = 1e3

#: Points inside a step at which the defect is checked besides the end, and in each such octave.
CHECKS, OCTAVE = 1, 8

#: A run ends after this many steps that were halved for their defect, most of them in a row.
SHORTENED = 40

#: Halved steps end a run only if they are much shorter (FAR) than the series allows, and do not grow, so that this
#: part of each is below the one before: at a branch point.
STEADY = 0.9

#: Part of a step at which its end is checked, and that of a step to an event, which may be the end of the
#: field's domain or a point where it is 0/0.
JUST = 1 - 1e-9
BEFORE_EVENT = 0.99

#: Events closer than this, relative to the time, and than the rounding of their roots, are simultaneous.
TIE = 8 * EPSILON

#: Close to a surface on which a field has a root the root changes the rate of h by this part, or it is all but
#: this part of it.
ROOT_SHARE = 1e-3

#: Terms of the series of a power of the time differ by this part from those of the first ones.
SHARE_SPREAD = 0.05

#: Close to rest on a surface with a root steps are shorter than flights by the inverse of this, and below rounding.
ROOT_REST = 1e-7

#: Steps of Newton's method to where complementarity conditions jump, and part of a state by which it is differenced.
JUMP_STEPS, DIFFERENCED = 60, 1e-7

#: Impulses through conditions of degree zero are those of multipliers that act for this part of the time in which they
#: would move the states as fast, or for longer ones by the step.
IMPULSIVE, IMPULSIVE_STEP = 1e-9, 100.0

#: Part of the time in which the states change by their size over which a rate is differenced.
REACH = 1e-6

#: An event this much after the end of a run, relative to the time, is at its end.
AT_END = 64 * EPSILON

#: Lanes leave events closer than this, relative to the time, to the scalar driver.
NEAR = 1e-13

#: Newton's steps that improve a root on the guard itself; one is the last below this part of the time.
POLISHED = 3
CLOSE = 1e-8

#: A root is steep where rounding moves it by less than this part of its time.
STEEP = 1e-9
#: Lanes decide an exit where its guard falls at more than this part of the rates' scale.
STEEP_EXIT = 1e-10

#: Iterations are over where they change a value of order 1 by this much; multipliers by that.
SOLVED = 4e-16
IMPROVED = 1e-16

#: Matrices are symmetric, and multiples of the identity, to this part of their entries; the squared
#: rest of a gradient below DEPENDENT of its square depends on others.
SYMMETRIC = 1e-12
DEPENDENT = 1e-24

#: Part that the time of a slip may be off by.
SLIP_ROOT = 1e-6

#: Numbers beyond these are no sizes any more; of a quotient with such a value and divisor nothing is left, and a state
#: that begins with such a value, relative to what it becomes along a leg, begins with zero.
SMALLEST, LARGEST = 1e-300, 1e300
TINY = sys.float_info.min
TINY_VALUE, HUGE_DIVISOR = 1e-100, 1e150

#: Shortest step of a flow of known duration, relative to it.
FIXED_SHORTEST = 1e-14

#: Rounding of a polynomial's value, relative to the sum of the magnitudes of its terms.
ROUNDING = 4 * EPSILON

#: The same for the location of a root.
ROOT_ROUNDING = 16 * EPSILON

#: A point is on a surface where h is zero to this much of its terms.
ON_SURFACE = 16 * EPSILON

#: A state satisfies a constraint that is zero to this part of its terms, and is projected onto it.
CONSISTENT = 1e-8

#: A coefficient of a guard below this part of its terms is zero by rounding.
VANISHES = 64 * EPSILON

#: The guard of a stop or reset is zero below this part of sum |dg/dx_i| (|x_i| + atol/rtol). A run that ends there leaves
#: that much, as its time is rounded: of 1,795 plain restarts from a stop, 14 percent would stop again at once with 16 of
#: sum |dg/dx_i x_i|, none with this.
ON_GUARD = 64 * EPSILON

#: The same where a law is solved: rates and distances from a bound below this part of their terms are zero.
TIED = 1e-10

#: In an element whose guard ended a mode they are zero to this many relative tolerances: its root has that error.
KNOWN_TO = 100.0

#: A second surface is reached too if Newton's step onto both changes no state by more than this part of it.
PARALLEL = 1e-13

#: Solutions and motions that differ by this part are one; pivots below this part are zero.
MERGED, SINGULAR = 1e-8, 1e-12

#: Rounding in an unknown is not that of its own row of the law where its slope there is below this part of others.
WEAK = 1e-3

#: The slope of a complementarity condition by a multiplier is none where it delays the motion by this part of its time:
#: the multiplier is below rounding then, and its part in the condition below this.
UNDELAYED = 1e-8

#: Orders of the law that are solved; terms of the series by which motions are compared.
ORDERS, COMPARED = 9, 4

#: Elements of a block of which all solutions are tried, and those of which all minors are.
MOST_ENUMERATED, MOST_MINORS = 8, 10

#: Both fields are tangent where they are at this angle to the surface.
TANGENT = 2e-14

#: Shortest step, relative to the time and to that of the run, that rounding does not cancel.
SHORTEST = 4 * EPSILON

#: Where a guard's zero changes nothing, by rounding, a step of this many times that length goes on without it.
OVER = 256.0

#: A guard is low where it is below this many roundings of its terms. Before zeros that are not told apart a step ends
#: where it is above this many times as much, unless that is no progress: this part of the way to them, and closer
#: than SEPARATE, relative to the time. A root is exact to LOCATED of the time.
LOW = 8.0
FAR_FROM_LOW = 64.0
NEARER = 0.1
SEPARATE = 1e-13
LOCATED = 1e-12

#: Halvings of an interval before two roots count as a touch without crossing.
DEPTH = 52

# Accumulation of events: lengths of patterns (an impact 1, a crossing pair 2, a relay pair 4), blocks of
# each, largest spread and value of their ratio.
LAGS = (1, 2, 3, 4, 6)
BLOCKS = 4
SPREAD = 0.02
SHRINKS = 0.9999
#: Lanes let the driver see to events that may accumulate where the time left is this part of the last interval or more.
SHRINKS_TO = 1e-4
AT_ONCE = 40  # events at one instant

#: A set h = 0 is reached in one step where the remaining rotation of friction is below this part of the
#: local tolerance. One that was left is far where |h| is above this part of its terms.
REACHED = 0.1
LEFT = 1e-6

#: A set is reached where at most this many of the shortest steps are left to it.
TENFOLD = 20.0

#: Coefficients of a series grow as the inverse time to a set to their order: the set is reached before
#: they are larger than this.
OVERFLOW = 1e280

#: Derivatives have reached a set where |h| is this part of what it was on the way.
ARRIVED = 1e-13

#: Motions that can continue from a point, at most so many are kept.
SEVERAL = 16

#: Roots of a rate along a multiplier that enters nonlinearly: coefficients below this part of all terms vanish;
#: the pieces of the way are at most so many and so long; its ends are this much beyond the bounds.
LAYER_ROUNDING, LAYER_BEYOND = 1e-13, 1e-9
LAYER_PIECES, LAYER_LONGEST = 4000, 0.25

#: Solutions for several such multipliers: two are apart by this; residuals of one are this part of their terms.
LAYER_APART, LAYER_RESIDUAL = 1e-7, 1e-10

#: Halvings of each side of a box before Newton's method, its steps, and the grid of its starts and their number
#: where functions are not linear in each multiplier.
LAYER_HALVINGS, LAYER_NEWTON, LAYER_GRID, LAYER_STARTS = 10, 30, 9, 729

#: Orbits round an intersection are closed to first (second) order where their ratio (bend) is this close to 1 (0).
TURN_ROUNDING = 1e-12

#: A step from a point where high derivatives do not exist: its longest and shortest length, the part by which it
#: is shortened, and how exact the rates of guards that leave zero have to be.
SINGULAR_LONGEST, SINGULAR_SHORTEST = 1e-3, 1e-15
SINGULAR_SHORTER, SINGULAR_RATE = 0.25, 0.1

#: Sliding may end in a fold where its slope would vanish within this many steps.
FOLD_AHEAD = 10.0

#: A fold is served at a root of the slope's series where it is this close, relative to the time.
FOLD_NEAR = 1e-11

#: Multipliers that are this close to those at a fold are the solution that ended there.
FOLD_APART = 1e-5

#: What a run notes about its decisions, as bits.
DEPENDS_ON_WIDTHS, UNPROVED = 1, 2

#: Kinds of events, by number in ensembles and in C.
KINDS = (
    *("crossing", "entry", "exit", "stop", "reset"),
    *("impact", "contact", "release", "stability", "rest", "rest_below", "jump"),
    "end",
)

#: The first and the last of these, as many, can happen without resets and impacts.
SIMPLE_KINDS = 5

#: Kinds of guards, by number in C, and their priority among simultaneous ones (0 first).
GUARDS = (
    *("surface", "exit", "stop", "reset", "impact", "release", "branch"),
    *("near", "slip", "atom"),
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
    "atom": 1,
}

#: Why a run ended, besides its status, by number in C.
REASONS = (
    "",
    *"""
        two_fold slid_to_two_fold ambiguous degenerate wrong_start field surface reset_map
        branch_point state pressed two_sided multiple_zero sampled behind no_impulse restitution
        no_reaction no_stable_motion possibly_several stability_lost undetermined_rates
        start_solutions impossible_start several_directions indefinite undetermined high_degree
        spiral_out discrete_value no_jump off_constraint dead_point decay out_of_table
    """.split(),
)

#: Flag of the mode of an implicit step, as it is recorded.
IMPLICIT_STEP = 1 << 30

#: Steps that a run may take: what costs least, or one kind.
METHODS = ("auto", "taylor", "stiff")

#: Implicit steps have seven stages in place of five below this relative tolerance. Newton's method ends at this part
#: of it, or where it changes nothing but rounding, between two bounds. They are tried where a decay rate allows Taylor
#: steps hardly longer (this part) in so many of them, of each fourth, first with so many times their length, and given
#: up after so many in a row that Taylor steps would have made at less cost. Matrices are dense: systems of more states
#: than these have none.
SEVEN_STAGES = 3e-9
NEWTON = 0.01
LEAST_CHANGE, MOST_CHANGE = 1e-7, 1e-2
HELD_PART = 0.6
HELD_STEPS, EVERY_STEP = 4, 4
EIGHTFOLD = 8.0
IDLE_STEPS = 5
MOST_STATES = 1500

#: The same of flows of known durations: the relative tolerance; after so many steps, and if there are so many times as
#: long ahead, a decay rate is looked for.
IMPLICIT_FLOW = 1e-13
LOOK_AGAIN, FAR_AWAY = 16, 64.0

#: Not a status: the run continues in the next call, after its arrays were emptied, in another driver, or once the
#: program of its derivatives is given.
RUNNING, FULL, HAND_OVER, NEEDS_PROGRAM = -1, -2, -3, -4
