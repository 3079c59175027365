/* W trajectories in step, for systems with one set of codimension two or three, and stops.
 *
 * Off the set, on it and leaving it are three programs, and what is done near it is a fourth; each has lanes of
 * its own, and a trajectory waits until all lanes of a program are filled (fewer run only when no start is left).
 * These are GROUPS of W: each part of a step is done for all groups before the next part, since a step's text is
 * longer than what a processor keeps of instructions close by. What is rare is not clear: such a
 * trajectory is given to the driver for that step, and taken back off the set or on it. No lane's result depends on its
 * neighbours.
 *
 * The generated text defines, besides what common.h needs: N states with time, ND without, K, STOPS,
 * DIRECTION[STOPS], TIMED, W, GROUPS, ROWS and ROW[ROWS] of the field that are not affine (on the set ON_ROWS),
 * BENT_SLIP, BENT_STOPS, OWN[K] states that the switching functions are (NAMED: whether they are), and the functions of
 * nonsmooth/model/printing/set_program.py.
 */
#define SLOTS (STOPS + 2) /* the set's guard, stops, friction's limit */
#define LIMIT_SLOT (STOPS + 1)
#define INNER (P - P / 3) /* degree that is enough at half of a step */
#define LONG_CODE (1LL << 60)
#define WAITING (4 * GROUPS * W)
#define OFTEN 8 /* fewer groups run where the starts do not fill all of them so many times */
#define FALLEN 0.01 /* a step ends where |h| has fallen to this part, closer to rounding to FALL */
#define PASSED 1e-11 /* what passes h = 0 closer than this much of its terms may cross it: the interpreter sees to it */
#define TURNED 1e-7 /* to this at least the direction is known in which a set is left */
#define THIRD 3 /* what the last way leaves out is so many times what its terms suggest, or less */
#define LAST_WAY 0.1 /* part of the tolerance that it may be, once for each time that a set is reached */
#define SMALL 0.05 /* it is tried where |h| is a third of the cube root of the tolerance */
#define LAST_TERM 2.0 /* off the set and on it the last two terms of series may be so many times the tolerance */
#define BEFORE_LAST 10.0
#define AT_LIMIT 10 /* at the end of rolling |lambda| is 1 to so many times the tolerance */
#define ROOM_TO_ROLL 1e-6 /* |lambda| is clearly below 1 */

enum { AWAY, ON, GOING, NEAR_SET, POOLS };

/* All members are vectors, so that a trajectory is a column of words. */
typedef struct {
  T x[N], t, since, length, left_at, lam[K]; /* since: the last event; when the set was left, and in which direction */
  I behind, fell, live, steps, entered, events, kinds[LAST_KIND], code, base, index, own; /* own: which past */
  I above_stop[STOPS > 0 ? STOPS : 1];
  T q[NQ];
} Lanes;

typedef struct Work Work;

#define WORDS ((int)(sizeof(Lanes) / sizeof(T)))

typedef struct { int64_t word[WORDS]; } Traveller;

#define LETTERS K
#define OF_POOLS \
  double size; /* of states at which both tolerances are as large */ \
  int alive[POOLS], waiting[POOLS], column, pool, landed; /* words of a trajectory; the pool at work, and where a lane goes on */ \
  int spare[WAITING], spares, begun; /* pasts that are free */ \
  Past past[WAITING]; \
  Traveller queue[POOLS][WAITING];

#define SELECT_I(m, a, b) (((a) & (m)) | ((b) & ~(m)))
#define LAMBDA(v) UNPACK(v), BC(0)
#if K == 2
#define UNPACK(v) (v)[0], (v)[1]
#else
#define UNPACK(v) (v)[0], (v)[1], (v)[2]
#endif
