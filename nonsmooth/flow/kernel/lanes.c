/* W trajectories in step, for systems of at most one surface and without resets.
 *
 * Each lane holds one trajectory and is refilled when it ends. Whatever is common is done for all
 * lanes at once: expansion, step size, roots, projection, the decision at a surface where both
 * fields are clearly transversal. Whatever is rare (tangency, repelling sliding, ties, accumulating
 * events, limits, points that are not finite) is not clear: the lane gives its trajectory to the driver for that
 * step and takes it back. No lane's result depends on its neighbours.
 *
 * The generated text defines, besides what common.h needs: N states with time, ND without, M surfaces,
 * TIMED whether time is a state, W, SLOTS guards (surface or exit to +, exit to -, stops), STOPS, DIRECTION[STOPS],
 * AFFINE[SLOTS], AFFINE_MODES[3] (above, below, sliding), LINEAR whether all are, CANCELLED, CURVED, prepare(p, q),
 * jet(x, q, slides, above, lambda, c, g), surface_values, lie_values, stop_values; ROW[ROWS] of the field and SLOT[GUARDS]
 * are not affine, and check_values gives them.
 */
#define S1 (SLOTS > 0 ? SLOTS : 1)
#define FIRST_STOP (SLOTS - STOPS)
#define INNER (P - P / 3) /* degree that is enough at half of a step */
#define LONG_CODE (1LL << 2 * MOST_MODES)
#define LETTERS 1
#define OF_POOLS int alive;

#if RARE_CASES_HERE
#define ROWS_KEPT 256 /* a power of two */

/* The last events of all lanes in the order in which they came: the intervals before them, and patterns that are
 * negative where a lane had none. */
typedef struct { T interval[ROWS_KEPT]; I pattern[ROWS_KEPT]; } Log;

#endif

typedef struct {
  T x[N];
  OWN(T, q, NQ); /* prepared from the parameters */
  T t, lambda, since, length; /* time since the last event; of the step before in the same mode, or 0 */
  I slides, above, drop, live, steps, events, kinds[LAST_KIND];
  I entered; /* number of steps when the mode began */
  I code; /* modes since the itinerary ``base``, base 4 with digits from 1, the last one lowest */
  I above_stop[STOPS > 0 ? STOPS : 1]; /* where the guard of a stop was at the start of the step before */
  double size; /* of states at which both tolerances are as large */
  I index, base;
#if RARE_CASES_HERE
  Past *past; /* of each lane */
  Log *log;
  int64_t row; /* next one of the log */
#else
  T shortest;
  I shrinking;
#endif
} Lanes;

/* What feeds the lanes and takes their results: batch.c, or cuda.c on a GPU. */
typedef struct Work Work;
INLINE const Options *limits(const Work *w);
static void store(Lanes *s, Work *w, int l, int status);
static void shorten_codes(Lanes *s, Work *w);
static void begin_elsewhere(Lanes *s, Work *w, I which);
INLINE I by_chance(const Lanes *s, const Work *w);
INLINE void count(Lanes *s, Work *w, int kind, I which);

/* Number of the mode: 0 above, 1 below, 2 sliding. */
INLINE I mode_of(const Lanes *s) { return (s->slides & 2) | (~s->slides & ~s->above & (M > 0)); }

static void note_modes(Lanes *s, Work *w, I which) {
  s->code = (s->code & ~which) | (((s->code << 2) + mode_of(s) + 1) & which);
  s->entered = (s->entered & ~which) | (s->steps & which);
  if (any(s->code >= LONG_CODE)) shorten_codes(s, w);
}

SELDOM void store_lanes(Lanes *s, Work *w, I which, int status) {
  for EACH(l, which) store(s, w, l, status);
}

/* The runs of these lanes end. */
INLINE void finish_lanes(Lanes *s, Work *w, I which, int status) {
  which &= s->live;
  if (!any(which)) return;
  s->live &= ~which;
  store_lanes(s, w, which, status);
}

/* The surface -------------------------------------------------------------------------------- */

INLINE T rounding_scale(const Lanes *s, const T *gradient);

/* Newton steps of the states (not the time) along the gradient; lanes that they do not lead onto the
 * surface, because its zero is a multiple one. */
INLINE I project(Lanes *s, I which) {
  I off = {0};
#if M > 0
  for (int iteration = 0; iteration < (CURVED ? 3 : 2); iteration++) {
    T h, g[N], size = BC(0);
    surface_values(s->x, s->q, s->slides, s->above, s->lambda, &h, g);
    I apart = which & (I)(h != 0);
    if (!CURVED && !any(apart)) break;
    UNROLL for (int i = 0; i < ND; i++) size += g[i] * g[i];
    T step = SELECT(apart, h / size, BC(0)); /* what is left of h moves a state at rest for as long as it rests */
    UNROLL for (int i = 0; i < ND; i++) s->x[i] -= step * g[i];
  }
  if (CURVED) {
    T h, g[N];
    surface_values(s->x, s->q, s->slides, s->above, s->lambda, &h, g);
    off = which & ~(I)(ABS(h) <= VANISHES * rounding_scale(s, g));
  }
#endif
  return off;
}

/* sum of |gradient| (size + |x|): rounding in a function is that times epsilon. */
INLINE T rounding_scale(const Lanes *s, const T *gradient) {
  T scale = BC(0);
  UNROLL for (int i = 0; i < N; i++) scale += ABS(gradient[i]) * (s->size + ABS(s->x[i]));
  return scale;
}

/* Lanes on the surface whose fields are both clearly transversal get their mode and the number of
 * coefficients to drop; the mask of those that are not clear is returned. */
INLINE I decide(Lanes *s, I which, const T *lie, const T *scale) {
  I clear = (ABS(lie[0]) > VANISHES * scale[0]) & (ABS(lie[1]) > VANISHES * scale[1]);
  I up0 = lie[0] > 0, up1 = lie[1] > 0;
  clear &= ~(up0 & ~up1);
  I mine = which & clear;
  s->slides = (s->slides & ~mine) | (mine & ~up0 & up1);
  s->above = (s->above & ~mine) | (mine & up0 & up1);
  s->drop = (s->drop & ~mine) | (mine & ~s->slides & 1);
  return which & ~clear;
}

INLINE void set_lambda(Lanes *s) { s->lambda = SELECT(s->above, BC(1), BC(-1)); }

#if M > 0
INLINE void lie(const Lanes *s, T *value, T *scale) {
  T gradient[2][N];
  lie_values(s->x, s->q, s->slides, s->above, s->lambda, value, &gradient[0][0]);
  scale[0] = rounding_scale(s, gradient[0]);
  scale[1] = rounding_scale(s, gradient[1]);
}
#endif

/* Modes of lanes just loaded. */
static void begin(Lanes *s, Work *w, I fresh) {
  I unclear = {0};
  s->slides &= ~fresh;
  s->above &= ~fresh;
#if M > 0
  T h, g[N], value[2], scale[2];
  surface_values(s->x, s->q, s->slides, s->above, s->lambda, &h, g);
  I on = fresh & (ABS(h) <= ON_SURFACE * rounding_scale(s, g));
  unclear |= fresh & ~(ABS(h) < INFINITY);
  s->above |= fresh & (h > 0);
  if (any(on)) {
    project(s, on);
    lie(s, value, scale);
    unclear |= decide(s, on, value, scale);
  }
#endif
#if STOPS > 0
  T stop[STOPS], gradient[STOPS][N];
  stop_values(s->x, s->q, s->slides, s->above, s->lambda, stop, &gradient[0][0]);
  for (int j = 0; j < STOPS; j++)
    unclear |= fresh & (ABS(stop[j]) <= VANISHES * rounding_scale(s, gradient[j]));
  for (int j = 0; j < STOPS; j++)
    s->above_stop[j] = (s->above_stop[j] & ~fresh) | (fresh & (I)(stop[j] > 0));
#endif
  set_lambda(s);
  note_modes(s, w, fresh & ~unclear);
  begin_elsewhere(s, w, fresh & unclear);
}

/* Step size ------------------------------------------------------------------------------------ */

/* Ratios of the last two terms of the guards that are not affine to their allowances (an affine
 * guard is bounded by the states). */
INLINE void guard_ratios(const Lanes *s, const Options *o, const T *allowed, T *of_guards, T g[S1][P + 1],
                         T *last, T *before, T *sum) {
  T gradient[S1][N], value[S1];
#if M > 0
  if (!AFFINE[0] || !AFFINE[1]) {
    T h, surface[N];
    lie_values(s->x, s->q, s->slides, s->above, s->lambda, value, &gradient[0][0]);
    surface_values(s->x, s->q, s->slides, s->above, s->lambda, &h, surface);
    UNROLL for (int i = 0; i < N; i++) gradient[0][i] = SELECT(s->slides, gradient[0][i], surface[i]);
  }
#endif
#if STOPS > 0
  int needed = 0;
  for (int j = FIRST_STOP; j < SLOTS; j++) needed |= !AFFINE[j];
  if (needed)
    stop_values(s->x, s->q, s->slides, s->above, s->lambda, value, &gradient[FIRST_STOP][0]);
#endif
  UNROLL for (int j = 0; j < SLOTS; j++) {
    if (AFFINE[j]) { *sum += g[j][P] + g[j][P - 1]; continue; }
    T a = o->rtol * ABS(g[j][0]) + 1e-290;
    UNROLL for (int i = 0; i < ND; i++) a += ABS(gradient[j][i]) * allowed[i];
    of_guards[j] = a - (1 - SAFETY) * o->rtol * ABS(g[j][0]);
    T r = ROUGH_INVERSE(a), p = ABS(g[j][P]) * r, b = ABS(g[j][P - 1]) * r;
    I counts = M > 0 && j == 1 ? s->slides : ~NONE;
    counts &= a > 1e-280;
    *sum += SELECT(counts, p + b, BC(0));
    *last = MAX(*last, SELECT(counts, p, BC(0)));
    *before = MAX(*before, SELECT(counts, b, BC(0)));
    I zero = counts & (MIN(p, b) == 0);
    if (any(zero)) *sum = SELECT(zero & ((g[j][P - 2] != 0) | (g[j][P - 3] != 0)), BC(INFINITY), *sum);
  }
}

/* ``allowed`` and ``of_guards`` are the tolerances of states and of guards that are not affine. Not ``finite`` is also
 * a lane where the last terms vanish, or are far smaller, and earlier ones bound the step. */
INLINE T step_size(const Lanes *s, const Options *o, T c[N][P + 1], T g[S1][P + 1], T *allowed, T *of_guards,
                   I *finite) {
  T last = BC(1e-300), before = BC(1e-300), third = BC(0), fourth = BC(0), sum = BC(0);
  UNROLL for (int i = 0; i < N; i++) {
    allowed[i] = i < ND ? SAFETY * (o->atol + o->rtol * ABS(s->x[i])) : BC(0);
    if (i >= ND) continue;
    T r = ROUGH_INVERSE(allowed[i]), p = ABS(c[i][P]) * r, b = ABS(c[i][P - 1]) * r;
    sum += p + b;
    last = MAX(last, p);
    before = MAX(before, b);
    third = MAX(third, ABS(c[i][P - 2]) * r);
    fourth = MAX(fourth, ABS(c[i][P - 3]) * r);
  }
  guard_ratios(s, o, allowed, of_guards, g, &last, &before, &sum);
  *finite = ABS(sum) < INFINITY;
  T h1 = LOG2(MIN(last, BC(1e300))) * (-1.0 / P), h2 = LOG2(MIN(before, BC(1e300))) * (-1.0 / (P - 1));
  T h = EXP2(MIN(h1, h2)), least = MAX(last * h, before) * h * GAP;
  *finite &= (third <= least) & (fourth <= least * h);
  return h;
}

/* Roots: polynomials.h --------------------------------------------------------------------------- */

/* After a crossing the guard's first coefficient is zero, after a fold its first two. */
INLINE void drop_zeros(const Lanes *s, T *a) {
  I by_one = s->drop == 1, by_two = s->drop == 2;
  if (!any(by_one | by_two)) return;
  UNROLL for (int k = 0; k <= P; k++) {
    T c1 = k < P ? a[k < P ? k + 1 : P] : BC(0), c2 = k + 1 < P ? a[k + 1 < P ? k + 2 : P] : BC(0);
    a[k] = SELECT(by_one, c1, SELECT(by_two, c2, a[k]));
  }
}

#if RARE_CASES_HERE
/* Shorten steps until the series of all guards converge within them, as in the interpreter. */
static __attribute__((noinline)) void resolve_steps(const Lanes *s, T g[S1][P + 1], I which, T *h) {
  for (int j = 0; j < SLOTS; j++) {
    I active = which;
    if (M > 0 && j == 1) active &= s->slides;
    resolve_step(g[j], active, h);
  }
}
#endif

/* Guards scaled to [0, 1] with their lanes sorted: no root, one root to be polished, or a hard case,
 * whose root is found here. */
typedef struct { T a[S1][P + 1], end[S1], root[S1], slope[S1]; I one[S1], hard[S1], flipped[S1], wrong_way[S1]; } Guards;

/* Returns the lanes whose surface or exit guard is not positive. */
INLINE I sort_guard(const Lanes *s, Guards *v, const T *g, const T *power, int j, I *too_long) {
  T *a = v->a[j];
  I counts = s->live, flipped = {0}, wrong_way = {0}, none, unresolved, unclear = {0};
  v->root[j] = BC(INFINITY);
  v->slope[j] = BC(0);
  v->one[j] = NONE;
  v->hard[j] = v->flipped[j] = v->wrong_way[j] = NONE;
  if (M > 0 && j == 1 && !any(counts &= s->slides)) return unclear;
  a[0] = g[0];
  UNROLL for (int k = 1; k <= P; k++) a[k] = g[k] * power[k];
  if (M > 0 && j == 0) drop_zeros(s, a);
  if (j >= FIRST_STOP) {
    int direction = DIRECTION[j < FIRST_STOP ? 0 : j - FIRST_STOP];
    flipped = a[0] < 0;
    if (any(flipped & counts)) {
      I sign = flipped & INT64_MIN;
      UNROLL for (int k = 0; k <= P; k++) a[k] = (T)((I)a[k] ^ sign);
    }
    wrong_way = direction == 0 ? wrong_way : direction < 0 ? flipped : ~flipped;
  }
  screen(a, &none, &v->one[j], &unresolved, &v->end[j]);
  I zero = ~(I)(a[0] > 0);
  *too_long |= counts & unresolved;
  if (j < FIRST_STOP) { unclear = counts & zero; counts &= ~zero; }
  v->hard[j] = counts & ((~none & ~v->one[j]) | (v->one[j] & wrong_way) | zero);
  v->one[j] &= counts & ~v->hard[j];
  v->flipped[j] = flipped;
  v->wrong_way[j] = wrong_way;
  return unclear;
}

/* Hard cases: sign changes of all Bernstein coefficients, one slot of each lane at a time; what has
 * several goes to hard_root, or is returned. */
SELDOM I resolve(Guards *v) {
  I lost = NONE;
  for (;;) {
    I rest = ~NONE, mine[S1], all = {0};
    UNROLL for (int j = 0; j < SLOTS; j++) {
      mine[j] = v->hard[j] & rest;
      rest &= ~mine[j];
      all |= mine[j];
      v->hard[j] &= ~mine[j];
    }
    if (!any(all)) return lost;
    T b[P + 1];
    UNROLL for (int k = 0; k <= P; k++) b[k] = v->a[SLOTS - 1][k];
    for (int j = 0; j < SLOTS - 1; j++)
      if (any(mine[j])) UNROLL for (int k = 0; k <= P; k++) b[k] = SELECT(mine[j], v->a[j][k], b[k]);
    I first, changes = sign_changes(b, &first);
    UNROLL for (int j = 0; j < SLOTS; j++) {
      I one = mine[j] & first & (changes == 1) & ~v->wrong_way[j];
      I deep = mine[j] & ~one & ~(first & (changes == 0));
      v->one[j] |= one;
#if RARE_CASES_HERE
      for EACH(l, deep) {
        double r = hard_root(v->a[j], l, j - FIRST_STOP, LANE_I(v->flipped[j], l) != 0, 1, &LANE(v->slope[j], l));
        if (r >= 0) LANE(v->root[j], l) = r;
        else if (r != r) LANE_I(lost, l) = ~(int64_t)0;
      }
#else
      lost |= deep;
#endif
    }
  }
}

/* Polish the isolated roots that can be the first, of ``n`` vectors in step: of each lane the one that a secant puts
 * first, the slots of different lanes together, then others only if they are not clearly later. */
INLINE void polish_guards(int n, Guards *const *given, const T *margin) {
  T a[MOST][P + 1], end[MOST], at[MOST], slope[MOST];
  const T *series[MOST];
  I mine[MOST][S1], all[MOST], some = NONE;
  IN_STEP {
    const Guards *v = given[i];
    series[i] = a[i];
    slope[i] = BC(0);
    all[i] = NONE;
    UNROLL for (int j = 0; j < SLOTS; j++) all[i] |= v->one[j];
    some |= all[i];
  }
  while (any(some)) {
    IN_STEP {
      const Guards *v = given[i];
      T guess = BC(INFINITY);
      UNROLL for (int j = 0; j < SLOTS; j++) {
        T g = MIN(v->a[j][0] * ROUGH_INVERSE(v->a[j][0] - v->end[j]), BC(1));
        mine[i][j] = v->one[j] & (g < guess);
        guess = SELECT(mine[i][j], g, guess);
        for (int k = 0; k < j; k++) mine[i][k] &= ~mine[i][j];
      }
      UNROLL for (int k = 0; k <= P; k++) a[i][k] = v->a[SLOTS - 1][k];
      end[i] = v->end[SLOTS - 1];
      for (int j = 0; j < SLOTS - 1; j++) {
        UNROLL for (int k = 0; k <= P; k++) a[i][k] = SELECT(mine[i][j], v->a[j][k], a[i][k]);
        end[i] = SELECT(mine[i][j], v->end[j], end[i]);
      }
    }
    polish(n, series, end, all, at, slope);
    some = NONE;
    IN_STEP {
      Guards *v = given[i];
      T s = at[i], later = s + margin[i];
      UNROLL for (int j = 0; j < SLOTS; j++) {
        v->root[j] = SELECT(mine[i][j], s, v->root[j]);
        v->slope[j] = SELECT(mine[i][j], slope[i], v->slope[j]);
        v->one[j] &= ~mine[i][j];
      }
      all[i] = NONE;
      UNROLL for (int j = 0; j < SLOTS; j++) all[i] |= v->one[j];
      if (any(all[i])) {
        all[i] = NONE;
        UNROLL for (int j = 0; j < SLOTS; j++) all[i] |= v->one[j] &= ~(I)(values_at(v->a[j], P, later, later * later) > 0);
      }
      some |= all[i];
    }
  }
}

/* Sorts all guards for steps h, which are shortened where a guard's series needs that. */
INLINE I sort_guards(const Lanes *s, Guards *v, T g[S1][P + 1], T *h) {
  for (int first = 1;; first = 0) {
    T power[P + 1];
    I unclear = {0}, too_long = {0};
    power[1] = *h;
    UNROLL for (int k = 2; k <= P; k++) power[k] = power[k / 2] * power[k - k / 2];
    UNROLL for (int j = 0; j < SLOTS; j++) unclear |= sort_guard(s, v, g[j], power, j, &too_long);
    if (!first || !any(too_long)) return unclear;
#if RARE_CASES_HERE
    resolve_steps(s, g, too_long, h);
#else
    return unclear | too_long;
#endif
  }
}

/* A step: its series, its guards, and what is known of its end. */
typedef struct {
  T c[N][P + 1], g[S1][P + 1], allowed[N], of_guards[S1], by_series, h, left;
  T dt, slope; /* to the first event, or the step's end, and how fast the event's guard falls */
  I unclear, last, slot;
  T t, since, length; /* of the lanes at its start */
  I drop, slides, above;
  Guards v;
} Step;

/* Time of the first event within h in each lane and its slot + 1, of ``n`` vectors; lanes that are not clear are
 * added. */
INLINE void first_hits(int n, const Lanes *s, Step *e) {
  T tie[MOST], margin[MOST];
  Guards *guards[MOST];
  IN_STEP {
    guards[i] = &e[i].v;
    tie[i] = NEAR * MAX(BC(1), ABS(s[i].t));
    margin[i] = tie[i] * QUICK_INVERSE(e[i].h);
  }
  if (SLOTS > 0) polish_guards(n, guards, margin);
  IN_STEP {
    const Guards *v = guards[i];
    T best = BC(INFINITY), second = BC(INFINITY), slope = BC(0), h = e[i].h;
    I slot = NONE;
    UNROLL for (int j = 0; j < SLOTS; j++) {
      I first = v->root[j] < best;
      second = SELECT(first, best, MIN(second, v->root[j]));
      best = SELECT(first, v->root[j], best);
      slot = (slot & ~first) | (first & (j + 1));
      slope = SELECT(first, v->slope[j], slope);
    }
    I hit = slot != 0;
    e[i].dt = SELECT(hit, best * h, h);
    e[i].slot = slot;
    e[i].slope = slope;
    e[i].unclear |= hit & ((second - best) * h <= tie[i]);
  }
}

/* Events --------------------------------------------------------------------------------------- */

#if RARE_CASES_HERE
/* Bring a lane's last events up to date. */
static void recall(const Lanes *s, int l) {
  Past *p = &s->past[l];
  if (s->row - p->row > ROWS_KEPT) { p->count = 0; p->row = s->row - ROWS_KEPT; }
  for (; p->row < s->row; p->row++) {
    int64_t row = p->row & (ROWS_KEPT - 1), pattern = LANE_I(s->log->pattern[row], l);
    if (pattern >= 0) p->event[p->count++ % HISTORY] = (Recent){LANE(s->log->interval[row], l), pattern};
  }
}

/* Lanes whose last event, just before, may be one of those that accumulate, so that the run may end here: the driver
 * acts where the states change by less than their tolerances up to the limit, and the time left is a part of the last
 * interval, SHRINKS_TO or more. */
SELDOM I watch_limit(const Lanes *s, T c[N][P + 1], const T *allowed, I which) {
  T interval = s->log->interval[(s->row - 1) & (ROWS_KEPT - 1)], rate = BC(0);
  UNROLL for (int i = 0; i < ND; i++)
    rate = MAX(rate, ABS(c[i][1]) * ROUGH_INVERSE(allowed[i] + VANISHES * (s->size + ABS(s->x[i]))));
  I may = which & ((interval * rate <= 2 / SHRINKS_TO) | (interval <= NEAR / SHRINKS_TO * MAX(BC(1), ABS(s->t))));
  for EACH(l, may) {
    recall(s, (int)l);
    if (!may_accumulate(&s->past[l])) LANE_I(may, l) = 0;
  }
  return may;
}

/* Remember events of the lanes ``which`` by their kinds and those of their guards. */
INLINE I remember(Lanes *s, I which, I kind, I guard) {
  int64_t row = s->row++ & (ROWS_KEPT - 1);
  s->log->interval[row] = s->since;
  s->log->pattern[row] = ((kind << 40) + (guard << 32)) | ~which;
  s->since = SELECT(which, BC(0), s->since);
  return NONE;
}
#else
/* Ever shorter intervals are left to the driver, which knows their limit. */
INLINE I remember(Lanes *s, I which, I, I) {
  I shorter = which & (s->since < SHRINKS * s->shortest);
  s->shortest = SELECT(shorter, s->since, s->shortest);
  s->since = SELECT(which, BC(0), s->since);
  s->shrinking -= shorter;
  return which & (s->shrinking >= 3);
}
#endif

#if M > 0
/* Lanes that met the surface or an end of sliding change their mode; ``slope`` is that of the guard
 * over the step. Those that are not clear are returned, and have no event. */
INLINE I change_modes(Lanes *s, Work *w, I met, I up, I down, T slope) {
  T value[2], scale[2];
  lie(s, value, scale);
  I ends = up | down, was = s->slides, unclear = {0};
  I steep = slope < -STEEP_EXIT * MAX(scale[0], scale[1]);
  double clear = CANCELLED ? VANISHES : 2 * (limits(w)->rtol + TANGENT); /* not an exit at a two-fold */
  I attracts = (up & (I)(value[1] > clear * scale[1])) | (down & (I)(value[0] < -clear * scale[0]));
  unclear |= ends & ~(steep & attracts);
  I was_above = s->above;
  unclear |= decide(s, met, value, scale);
  s->slides &= ~ends;
  s->above = (s->above & ~ends) | up;
  s->drop = (s->drop & ~ends) | (ends & 2);
  unclear |= s->events + 1 >= limits(w)->max_events;
  I all = (met | ends) & ~unclear & (s->slides ^ was | s->above ^ was_above);
  I entered = all & s->slides & ~was, kind = (entered & ENTRY) | (ends & EXIT) | (~entered & ~ends & CROSSING);
  all &= ~remember(s, all, kind, ends & EXIT_GUARD);
  count(s, w, ENTRY, entered & all);
  count(s, w, EXIT, all & ends);
  count(s, w, CROSSING, all & ~ends & ~entered);
  set_lambda(s);
  note_modes(s, w, all);
  return (met | ends) & ~all;
}

/* Lanes that slide towards a two-fold where the sliding field is 0/0. */
INLINE I near_two_fold(const Lanes *s, double tolerance) {
  T value[2], scale[2];
  lie(s, value, scale);
  return (ABS(value[0]) <= 2 * (tolerance + TANGENT) * scale[0])
         & (ABS(value[1]) <= 2 * (tolerance + TANGENT) * scale[1]);
}
#endif

INLINE void state_at(T *x, T c[N][P + 1], T dt, int degree) {
  UNROLL for (int i = 0; i < N; i++) {
    T v = c[i][degree];
    UNROLL for (int k = degree - 1; k >= 0; k--) v = v * dt + c[i][k];
    x[i] = v;
  }
}

INLINE void advance(Lanes *s, const T *x, T dt) {
  UNROLL for (int i = 0; i < N; i++) s->x[i] = x[i];
  s->t += dt;
  s->since += dt;
  if (TIMED) s->x[N - 1] = s->t;
  s->steps += 1;
  s->drop = NONE;
}

#if ROWS + GUARDS > 0
/* Lanes where field and guards at a time of the step are not those of the polynomials. A surface or a stop that is
 * ``met`` there has to be zero to the tolerance of a step: else its root is improved by the driver. */
INLINE I disagrees(const Lanes *s, T c[N][P + 1], T g[S1][P + 1], const T *x, const T *allowed,
                   const T *of_guards, T at, T dt, int degree, I met, I *missed) {
  T f[ROWS + 1], guard[GUARDS + 1];
  I wrong = {0};
  check_values(x, s->q, s->slides, s->above, s->lambda, f, guard);
  UNROLL for (int m = 0; m < ROWS; m++) {
    const T *row = c[ROW[m]];
    T v = row[degree], d = v; /* the slope comes with the value */
    UNROLL for (int k = degree - 1; k >= 1; k--) { v = v * at + row[k]; d = d * at + v; }
    wrong |= ~(I)(ABS(f[m] - d) * dt <= WRONG * allowed[ROW[m]] + VANISHES * dt * ABS(d));
  }
  UNROLL for (int m = 0; m < GUARDS; m++) {
    int j = SLOT[m];
    T v = g[j][degree];
    UNROLL for (int k = degree - 1; k >= 0; k--) v = v * at + g[j][k];
    I counts = M > 0 && j == 1 ? s->slides : ~NONE;
    wrong |= counts & ~(I)(ABS(guard[m] - v) <= WRONG * of_guards[j]);
    I height = j >= FIRST_STOP ? ~NONE : j == 0 ? ~s->slides : NONE;
    *missed |= height & (met == j + 1) & ~(I)(ABS(guard[m]) <= of_guards[j]);
  }
  return wrong;
}
#endif

/* Lanes whose step is not clear: it would be held back, or its defect is too large. */
INLINE I unchecked(const Lanes *s, const Options *o, T c[N][P + 1], T g[S1][P + 1], const T *allowed,
                   const T *of_guards, T by_series, T dt, const T *end, I met) {
  I wrong = {0};
#if ROWS + GUARDS > 0
  I same = s->length > 0, missed = {0};
  wrong |= same & (I)(by_series > GROWTH * s->length);
  UNROLL for (int i = 0; i < N; i++)
    wrong |= ~same & (I)(by_series * ABS(c[i][1]) > FAR * (ABS(c[i][0]) + s->size));
  for (int k = 1; k <= CHECKS; k++) {
    T x[N], at = dt * ((double)k / (CHECKS + 1));
    state_at(x, c, at, INNER);
    wrong |= disagrees(s, c, g, x, allowed, of_guards, at, dt, INNER, NONE, &missed);
  }
  wrong |= disagrees(s, c, g, end, allowed, of_guards, dt, dt, P, met, &missed);
  wrong &= ~((s->slides & -AFFINE_MODES[2]) | (~s->slides & s->above & -AFFINE_MODES[0])
             | (~s->slides & ~s->above & -AFFINE_MODES[1]));
  wrong |= missed;
#endif
  return wrong;
}

/* Lanes where a stop was passed between two steps: rounding hid it from the first. */
INLINE I passed_between(const Lanes *s, T g[S1][P + 1]) {
  I passed = {0};
  UNROLL for (int j = 0; j < STOPS; j++) {
    T value = g[FIRST_STOP + j][0];
    I above = value > 0, was = s->above_stop[j];
    if (DIRECTION[j] <= 0) passed |= was & ~above;
    if (DIRECTION[j] >= 0) passed |= ~was & (I)(value >= 0);
  }
  return passed;
}

INLINE I finite_lanes(const Lanes *s) {
  T sum = BC(0);
  UNROLL for (int i = 0; i < ND; i++) sum += s->x[i] - s->x[i];
  return sum == 0;
}

/* The series of a step, its length, and which guards have a root in it. */
INLINE void expand_step(Lanes *s, Work *w, Step *e) {
  const Options *o = limits(w);
  I finite;
  jet(s->x, s->q, s->slides, s->above, s->lambda, &e->c[0][0], &e->g[0][0]);
  e->by_series = step_size(s, o, e->c, e->g, e->allowed, e->of_guards, &finite);
  T h = MIN(e->by_series, BC(o->max_step)), left = o->t_end - s->t;
  e->last = h >= left;
  e->unclear = ~finite;
#if RARE_CASES_HERE
  I after = (s->since == 0) & (s->events > BLOCKS);
  if (any(after)) e->unclear |= watch_limit(s, e->c, e->allowed, after);
#endif
  e->unclear |= ~e->last & ((h <= SHORTEST * ABS(s->t)) | (h >= LONGEST));
  e->unclear |= (s->steps >= o->max_steps) | passed_between(s, e->g);
  /* What happens at the end, to rounding, happens. */
  e->h = SELECT(e->last, left + AT_END * MAX(ABS(s->t), ABS(s->t + left)), h);
  e->left = left;
}

INLINE void sort_step(Lanes *s, Step *e) {
  e->unclear |= sort_guards(s, &e->v, e->g, &e->h);
  I hard = {0};
  UNROLL for (int j = 0; j < SLOTS; j++) hard |= e->v.hard[j];
  if (any(hard)) e->unclear |= resolve(&e->v);
}

/* What a step may have changed in the lanes ``which`` is again as at its start. */
SELDOM void undo_step(Lanes *s, const Step *e, I which) {
  UNROLL for (int i = 0; i < N; i++) s->x[i] = SELECT(which, e->c[i][0], s->x[i]);
  s->t = SELECT(which, e->t, s->t);
  s->since = SELECT(which, e->since, s->since);
  s->length = SELECT(which, e->length, s->length);
  s->steps += which;
  s->drop = (s->drop & ~which) | (e->drop & which);
  s->slides = (s->slides & ~which) | (e->slides & which);
  s->above = (s->above & ~which) | (e->above & which);
  set_lambda(s);
}

/* Take the step where it is clear; the lanes are returned where it is not. */
INLINE I take_step(Lanes *s, Work *w, Step *e) {
  const Options *o = limits(w);
  T left = e->left, dt = e->dt;
  I last = e->last & (e->h >= left), unclear = e->unclear | by_chance(s, w), slot = e->slot;
  dt = MIN(dt, SELECT(last, left, dt));
  unclear |= last & (dt == left) & (slot != 0) & (slot <= FIRST_STOP); /* a mode without a step */
  T h = MIN(e->h, left), end[N];
  state_at(end, e->c, dt, P);
  unclear |= unchecked(s, o, e->c, e->g, e->allowed, e->of_guards, e->by_series, dt, end, slot);
  I slides = s->slides;
  e->t = s->t;
  e->since = s->since;
  e->length = s->length;
  e->drop = s->drop;
  e->slides = slides;
  e->above = s->above;
  advance(s, end, dt);
  I live = s->live & ~unclear, met = {0}, up = {0}, down = {0}, stopped = {0};
  if (ROWS + GUARDS > 0) s->length = h;
  unclear |= ~finite_lanes(s);
#if M > 0
  met = live & ~slides & (slot == 1);
  up = live & slides & (slot == 1);
  down = live & (slot == 2);
  if (any(met | (live & slides))) unclear |= project(s, met | slides);
  I on = live & slides & (slot == 0) & ~last;
  if (!CANCELLED && any(on)) unclear |= on & near_two_fold(s, o->rtol);
  met &= ~unclear;
  up &= ~unclear;
  down &= ~unclear;
  if (any(met | up | down)) unclear |= change_modes(s, w, met, up, down, e->slope);
  s->length = SELECT(met | up | down, BC(0), s->length);
#endif
  unclear &= s->live;
  if (any(unclear)) undo_step(s, e, unclear);
  live &= ~unclear;
#if STOPS > 0
  for (int j = 0; j < STOPS; j++)
    s->above_stop[j] = (s->above_stop[j] & ~live) | ((I)(e->g[FIRST_STOP + j][0] > 0) & live);
  stopped = live & (slot > FIRST_STOP);
  if (any(stopped)) count(s, w, STOP, stopped);
#endif
  s->t = SELECT(live & last & (I)(dt == left), BC(o->t_end), s->t);
  finish_lanes(s, w, stopped, STOPPED);
  finish_lanes(s, w, last & live & (slot == 0), REACHED_END);
  return unclear;
}
