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

#: Defects above this many local tolerances cannot be truncation errors.
WRONG = 200.0

#: A step is checked in every octave below it, down to a safe length, if it is more than GROWTH times the
#: one before in its mode. The first step there is checked if it is more than FAR times the time in which
#: the state changes by its size, down to FIRST of that time.
GROWTH = 2.0
FAR = 10.0
FIRST = 0.01

#: Largest ratio of the two terms before the last two to these within a step; above it a series has a gap.
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

#: Near a surface with a root in the field: the root's share of the rate of h is below this part, or above one less it.
ROOT_SHARE = 1e-3

#: Terms of the series of a power of the time differ by this part from those of the first ones.
SHARE_SPREAD = 0.05

#: Near rest on a surface with a root, ratio of a step below rounding to the time between two zeros.
ROOT_REST = 1e-7

#: Newton steps of a jump by complementarity conditions, and relative increment of its finite differences.
JUMP_STEPS, DIFFERENCED = 60, 1e-7

#: Impulses through conditions of degree zero: multipliers act for this part of their own time scale, enlarged by the step.
IMPULSIVE, IMPULSIVE_STEP = 1e-9, 100.0

#: Increment of a finite difference of a rate, relative to the time scale of the states.
REACH = 1e-6

#: An event this close to the end of a run, relative to the time, is at the end.
AT_END = 64 * EPSILON

#: Lanes leave events closer than this, relative to the time, to the scalar driver.
NEAR = 1e-13

#: At an event that the driver makes for lanes, other guards are above this part of their terms.
CROWDED = 1e-6

#: Newton steps that improve a root by the guard itself; a step below this part of the time is the last.
POLISHED = 3
CLOSE = 1e-8

#: A root is steep where rounding moves it by less than this part of its time.
STEEP = 1e-9
#: Lanes decide an exit where its guard falls at more than this part of the rates' scale.
STEEP_EXIT = 1e-10

#: Iterations end when they change a value of order 1 by this much; those for multipliers by that.
SOLVED = 4e-16
IMPROVED = 1e-16

#: Relative tolerance of symmetry and isotropy of matrices; a gradient is dependent on others if the squared norm of its
#: remainder is below DEPENDENT of its own.
SYMMETRIC = 1e-12
DEPENDENT = 1e-24

#: Relative error of the time of a slip.
SLIP_ROOT = 1e-6

#: Range of sizes; a quotient with a divisor above HUGE_DIVISOR and a value below TINY_VALUE vanishes, as does the start of
#: a state below TINY_VALUE of its later values on a leg.
SMALLEST, LARGEST = 1e-300, 1e300
TINY = sys.float_info.min
TINY_VALUE, HUGE_DIVISOR = 1e-100, 1e150

#: Shortest step of a flow of known duration, relative to it.
FIXED_SHORTEST = 1e-14

#: Rounding of a polynomial's value, relative to the sum of the magnitudes of its terms.
ROUNDING = 4 * EPSILON

#: Rounding of the location of a root.
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

#: Rates and distances from a bound below this part of their terms are zero in the solution of a law.
TIED = 1e-10

#: For an element whose guard ended a mode they are zero to this many relative tolerances, the error of its root.
KNOWN_TO = 100.0

#: A second surface is reached too if the Newton step onto both changes no state by more than this part of it.
PARALLEL = 1e-13

#: Solutions and motions are equal to this relative tolerance; pivots below this part are zero.
MERGED, SINGULAR = 1e-8, 1e-12

#: An own slope in the law below this part of the others does not determine the rounding of an unknown.
WEAK = 1e-3

#: The slope of a complementarity condition by a multiplier is dropped where it delays the motion by less than this part of
#: its time scale.
UNDELAYED = 1e-8

#: Orders of the law that are solved; terms of the series by which motions are compared.
ORDERS, COMPARED = 9, 4

#: Largest blocks whose solutions are enumerated, and whose minors are all computed.
MOST_ENUMERATED, MOST_MINORS = 8, 10

#: Both fields are tangent below this angle to the surface.
TANGENT = 2e-14

#: Shortest step above rounding, relative to the time and to the duration of the run.
SHORTEST = 4 * EPSILON

#: Length in units of SHORTEST of a step over a guard's zero whose event, by rounding, changes nothing.
OVER = 256.0

#: A guard is low below LOW roundings of its terms. Before unresolved zeros a step ends where the guard is FAR_FROM_LOW
#: times higher, or at the part NEARER of the remaining way; zeros closer than SEPARATE, relative to the time, are one.
#: A root is exact to LOCATED of the time.
LOW = 8.0
FAR_FROM_LOW = 64.0
NEARER = 0.1
SEPARATE = 1e-13
LOCATED = 1e-12

#: Bisections of an interval before two roots count as a touch without crossing.
DEPTH = 52

# Accumulation of events: lengths of patterns (an impact 1, a crossing pair 2, a relay pair 4), blocks of
# each, largest spread and value of their ratio.
LAGS = (1, 2, 3, 4, 6)
BLOCKS = 4
SPREAD = 0.02
SHRINKS = 0.9999
#: The driver treats accumulating events of lanes if the time left is at least this part of the last interval.
SHRINKS_TO = 1e-4
AT_ONCE = 40  # events at one instant

#: A set h = 0 is reached in one step where the remaining rotation of friction is below this part of the
#: local tolerance. A set is far after leaving it where |h| is above this part of its terms.
REACHED = 0.1
LEFT = 1e-6

#: A set is reached at a distance of at most this many shortest steps.
TENFOLD = 20.0

#: Bound of series coefficients near a set: they grow as powers of the inverse time to it.
OVERFLOW = 1e280

#: Integration of derivatives reaches a set where |h| is this part of its largest value.
ARRIVED = 1e-13

#: Largest number of admissible motions kept at a point.
SEVERAL = 16

#: Roots of a rate along a multiplier that enters nonlinearly: coefficients below this part of all terms vanish;
#: number and length of the pieces are limited; the ends are this much beyond the bounds.
LAYER_ROUNDING, LAYER_BEYOND = 1e-13, 1e-9
LAYER_PIECES, LAYER_LONGEST = 4000, 0.25

#: Solutions for several such multipliers: least distance of two; relative residual of one.
LAYER_APART, LAYER_RESIDUAL = 1e-7, 1e-10

#: Bisections of each side of a box before Newton's method, its steps, and the grid and number of its starts where
#: functions are not linear in each multiplier.
LAYER_HALVINGS, LAYER_NEWTON, LAYER_GRID, LAYER_STARTS = 10, 30, 9, 729

#: Orbits around an intersection are closed to first (second) order where their ratio (bend) is this close to 1 (0).
TURN_ROUNDING = 1e-12

#: A step from a point where high derivatives do not exist: its longest and shortest length, the factor by which it
#: is shortened, and the tolerance of the rates of guards that leave zero.
SINGULAR_LONGEST, SINGULAR_SHORTEST = 1e-3, 1e-15
SINGULAR_SHORTER, SINGULAR_RATE = 0.25, 0.1

#: Sliding may end in a fold if its slope, extrapolated, vanishes within this many steps.
FOLD_AHEAD = 10.0

#: A fold is located at a root of the slope's series this close, relative to the time.
FOLD_NEAR = 1e-11

#: Multipliers that are this close to those at a fold are the solution that ended there.
FOLD_APART = 1e-5

#: Flags of a run's decisions, as bits.
DEPENDS_ON_WIDTHS, UNPROVED = 1, 2

#: Kinds of events, by number in ensembles and in C.
KINDS = (
    *("crossing", "entry", "exit", "stop", "reset"),
    *("impact", "contact", "release", "stability", "rest", "rest_below", "jump"),
    "end",
)

#: Number of kinds, with the last one, that occur without resets and impacts.
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

#: Methods of integration: the cheapest steps, or one kind.
METHODS = ("auto", "taylor", "stiff")

#: Implicit steps have seven stages instead of five below the relative tolerance SEVEN_STAGES. Newton's method ends at the
#: part NEWTON of it, bounded by LEAST_CHANGE and MOST_CHANGE. Implicit steps are tried, EIGHTFOLD as long, once a decay rate
#: has limited HELD_STEPS Taylor steps, each EVERY_STEP-th checked, to HELD_PART; they are given up after IDLE_STEPS
#: consecutive ones that cost more. Matrices are dense: systems of more than MOST_STATES states have no implicit steps.
SEVEN_STAGES = 3e-9
NEWTON = 0.01
LEAST_CHANGE, MOST_CHANGE = 1e-7, 1e-2
HELD_PART = 0.6
HELD_STEPS, EVERY_STEP = 4, 4
EIGHTFOLD = 8.0
IDLE_STEPS = 5
MOST_STATES = 1500

#: Flows of known durations: the relative tolerance; a decay rate is estimated after each CHECK_AGAIN steps, if the remaining
#: time is FAR_AWAY steps or more.
IMPLICIT_FLOW = 1e-13
CHECK_AGAIN, FAR_AWAY = 16, 64.0

#: Not a status: the run continues in the next call, after its arrays were emptied, in the driver, or once the
#: program of its derivatives is given.
RUNNING, FULL, FALL_BACK, NEEDS_PROGRAM = -1, -2, -3, -4
