/* W trajectories together, for systems of surfaces, or of one set of codimension two or three.
 *
 * Each lane holds one trajectory and is refilled when it ends. Common operations run for all lanes at once: expansion,
 * step size, roots, projection, clear decisions at one surface or set. The driver makes steps with rare cases (tangency,
 * repelling sliding, ties, accumulating events, limits, points that are not finite). With EVENTS it makes all events of
 * resets, impacts and conditions, and those at surfaces where there are several, at the states to which lanes integrate:
 * the guards end a step as those of stops do. No lane's result depends on its neighbours.
 *
 * Modes of a surface are masks: one jet expands them all. The modes off a set, on it and leaving it have a jet and a pool of
 * lanes each; a fourth pool is for states near it. A trajectory waits until all lanes of a pool are filled (fewer run only
 * when no start is left).
 *
 * The generated text defines, besides what common.h needs: N states with time, ND without, M surfaces, TIMED whether
 * time is a state, W, GROUPS, EVENTS (as above), CLEAR_STOPS stops without conditions, the first of STOPS guards of
 * events, SURFACES at which the driver decides, then CONTACTS gaps, the last of them; PARAMETERS; MOTION (size of the driver's data), SLOTS guards (surface or exit to +, exit to -,
 * stops; of a set its guard, friction's limit, stops), STOPS, DIRECTION[STOPS], AFFINE[SLOTS], AFFINE_MODES[3] (above,
 * below, sliding; or off the set, on it, leaving it), LINEAR whether all are, CANCELLED, CURVED, OWN_STATE[M], states
 * that a set's functions are (NAMED: whether they are), prepare(p, q), surface_values, stop_values; ROW[ROWS] of the
 * field and SLOT[GUARDS] of the series are not affine; and the functions of programs.py or set_program.py in
 * nonsmooth/model/printing.
 */
#define SET (M > 1)
#define S1 (SLOTS > 0 ? SLOTS : 1)
#define M1 (M > 0 ? M : 1)
#define SERIES (S1 + (SET ? M : 0)) /* of guards, and of a set's unknowns */
#define FIRST_STOP (SLOTS - STOPS)
#define INNER (P - P / 3) /* degree that is enough at half of a step */
#define LONG_CODE (1LL << 2 * MOST_MODES)
#define LETTERS (M + SURFACES + CONTACTS > 0 ? M + SURFACES + CONTACTS : 1)
#if SET
#define LAST_TERM(mode) ((mode) == GOING ? 1.0 : 2.0) /* size of the last two terms in units of the tolerance */
#define BEFORE_LAST(mode) ((mode) == GOING ? 1.0 : 10.0)
#if M == 2
#define UNPACK(v) (v)[0], (v)[1]
#else
#define UNPACK(v) (v)[0], (v)[1], (v)[2]
#endif
#define LAMBDA(v) UNPACK(v), BC(0)
#define OF(s) (s)->x, (s)->q, LAMBDA((s)->lam)
enum { AWAY, ON, GOING, NEAR_SET, POOLS };
#else
#define LAST_TERM(mode) 1.0
#define BEFORE_LAST(mode) 1.0
#define OF(s) (s)->x, (s)->q, (s)->slides, (s)->above, (s)->lambda
enum { AWAY, POOLS };
#endif

#if RARE_CASES_HERE
#define ROWS_KEPT 256 /* a power of two */

/* The last events of all lanes in order: the intervals before them, and patterns, negative where a lane had none. */
typedef struct { T interval[ROWS_KEPT]; I pattern[ROWS_KEPT]; } Log;

#endif

/* The first members are vectors: a trajectory is a column of words, which ends with its parameters. */
typedef struct {
  T x[N], t, since, length; /* time since the last event; of the step before in the same mode, or 0 */
#if SET
  T left_at, lam[M]; /* when the set was left, and in which direction */
  I behind, fell, own; /* own: which past */
#else
  T lambda;
  I slides, above, drop;
#endif
  I live, steps, events, kinds[LAST_KIND];
  I entered; /* number of steps when the mode began */
  I code; /* modes since the itinerary ``base``, base 4 with digits from 1, the last one lowest */
  I above_stop[STOPS > 0 ? STOPS : 1]; /* side of the guard of a stop at the start of the step before */
  I index, base;
  OWN(T, q, NQ); /* prepared from the parameters */
  double size; /* of states at which both tolerances are equal */
  I from_zero[STOPS + 1]; /* with EVENTS: whether the step begins at a zero of the guard of a stop */
  I arrived; /* with EVENTS: number of the guard whose event is due, or 0 */
#if RARE_CASES_HERE
  Past *past; /* of each lane, or of each ``own`` */
  Log *log; /* of a surface's events */
  int64_t row; /* next one of the log */
  int pool;
  T due; /* the time of each lane's next sample */
#else
  T shortest;
  I shrinking;
#endif
} Lanes;

/* Guards scaled to [0, 1] with their lanes sorted: no root, one root to be polished, or a hard case,
 * whose root is found at once. */
typedef struct { T a[S1][P + 1], end[S1], root[S1], slope[S1]; I one[S1], hard[S1], flipped[S1], wrong_way[S1]; } Guards;

/* A step: its series, its guards, and its end. */
typedef struct {
  T c[N][P + 1], g[SERIES][P + 1], allowed[N], of_guards[SERIES], by_series, h, left;
  T dt, slope; /* to the first event, or the step's end, and how fast the event's guard falls */
  I unclear, last, slot;
  T t, since, length; /* of the lanes at its start */
#if SET
  T ends[2 * M], turn[2], level; /* last terms of the direction; tolerance of |h| */
  T radius, stretch, fall; /* |h|, or friction's limit; 1 over the time to a branch point; part that |h| may fall to */
  I behind, gone;
#else
  I drop, slides, above;
#endif
  I from_zero[STOPS + 1];
  Guards v;
} Step;

/* Source of starts and sink of results: batch.c, or cuda.c on a GPU. */
typedef struct Work Work;
INLINE const Options *limits(const Work *w);
static void store(Lanes *s, Work *w, int l, int status);
static void shorten_codes(Lanes *s, Work *w);
static void begin_elsewhere(Lanes *s, Work *w, I which);
INLINE I by_chance(const Lanes *s, const Work *w);
INLINE void count(Lanes *s, Work *w, int kind, I which);
#if RARE_CASES_HERE
static void keep_samples(Lanes *s, Work *w, const Step *e, I which);
static I sampled_there(const Lanes *s, const Work *w, I which);
static I ends_sampling(const Lanes *s, const Work *w, I which);
static void keep_hits(Lanes *s, Work *w, int kind, int guard, I which, I above);
#endif

static void note_modes(Lanes *s, Work *w, I which, I mode) {
  s->code = (s->code & ~which) | (((s->code << 2) + mode + 1) & which);
  s->entered = (s->entered & ~which) | (s->steps & which);
  if (any(s->code >= LONG_CODE)) shorten_codes(s, w);
}

OUTLINED void store_lanes(Lanes *s, Work *w, I which, int status) {
  for EACH(l, which) store(s, w, l, status);
}

/* The runs of these lanes end. */
INLINE void finish_lanes(Lanes *s, Work *w, I which, int status) {
  which &= s->live;
  if (!any(which)) return;
  s->live &= ~which;
  store_lanes(s, w, which, status);
}

/* The surface or the set ------------------------------------------------------------------------- */

/* sum of |gradient| (size + |x|): rounding in a function is that times epsilon. */
INLINE T rounding_scale(const Lanes *s, const T *gradient) {
  T scale = BC(0);
  UNROLL for (int i = 0; i < N; i++) scale += ABS(gradient[i]) * (s->size + ABS(s->x[i]));
  return scale;
}

#if M > 0
INLINE T length_of(const T *h) {
  if (M == 1) return ABS(h[0]);
  T sum = BC(0);
  UNROLL for (int i = 0; i < M; i++) sum += h[i] * h[i];
  return SQRT_(sum);
}

/* h and the scale of its rounding. */
INLINE T heights(const Lanes *s, T *h, T gradient[M][N]) {
  T scale = BC(0);
  surface_values(OF(s), h, &gradient[0][0]);
  UNROLL for (int i = 0; i < M; i++)
    scale = MAX(scale, NAMED ? s->size + ABS(s->x[OWN_STATE[i]]) : rounding_scale(s, gradient[i]));
  return scale;
}

/* y of m y = b, from cofactors. */
INLINE void solve_block(const T *m, const T *b, T *y) {
#if M == 1
  y[0] = b[0] / m[0];
#elif M == 2
  T per = 1.0 / (m[0] * m[3] - m[1] * m[2]);
  y[0] = (m[3] * b[0] - m[1] * b[1]) * per;
  y[1] = (m[0] * b[1] - m[2] * b[0]) * per;
#else
  T c[3][3], whole = BC(0);
  UNROLL for (int i = 0; i < 3; i++)
    UNROLL for (int j = 0; j < 3; j++) {
      int p = (i + 1) % 3, q = (i + 2) % 3, u = (j + 1) % 3, v = (j + 2) % 3;
      c[i][j] = m[3 * p + u] * m[3 * q + v] - m[3 * p + v] * m[3 * q + u];
    }
  UNROLL for (int j = 0; j < 3; j++) whole += m[j] * c[0][j];
  UNROLL for (int i = 0; i < 3; i++) y[i] = (c[0][i] * b[0] + c[1][i] * b[1] + c[2][i] * b[2]) * (1.0 / whole);
#endif
}

/* Newton steps of the states (not the time) along the gradients. Returns lanes that do not reach the surface, because its
 * zero is multiple. */
INLINE I project(Lanes *s, I which) {
  T h[M], g[M][N], m[M * M], y[M];
  for (int iteration = 0; iteration < (CURVED ? 3 : 2); iteration++) {
    I apart = NONE;
    surface_values(OF(s), h, &g[0][0]);
    UNROLL for (int i = 0; i < M; i++) apart |= which & (I)(h[i] != 0);
    if (!CURVED && !any(apart)) break;
    UNROLL for (int i = 0; i < M * M; i++) {
      m[i] = BC(0);
      UNROLL for (int n = 0; n < ND; n++) m[i] += g[i / M][n] * g[i % M][n];
    }
    solve_block(m, h, y); /* a remainder of h would move a state at rest */
    UNROLL for (int i = 0; i < M; i++) {
      y[i] = SELECT(apart, y[i], BC(0));
      UNROLL for (int n = 0; n < ND; n++) s->x[n] -= y[i] * g[i][n];
    }
  }
  if (!CURVED) return NONE;
  T scale = heights(s, h, g);
  return which & ~(I)(length_of(h) <= VANISHES * scale);
}
#endif
