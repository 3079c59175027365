/* A step of W trajectories, for one mode or all of them: state.h. surface.c and set.c have the parts that depend on the
 * law. */

/* Short where the series of a step need no checks. */
#if SET || ROWS + GUARDS > 0
#define SHORT_OR_CHECKED OUTLINED
#else
#define SHORT_OR_CHECKED INLINE
#endif

/* Lanes just loaded get their modes. */
static void begin(Lanes *s, Work *w, I fresh) {
#if EVENTS
  begin_elsewhere(s, w, fresh);
  return;
#endif
  I unclear = begin_modes(s, fresh);
#if STOPS > 0
  T stop[STOPS], gradient[STOPS][N];
  stop_values(OF(s), stop, &gradient[0][0]);
  for (int j = 0; j < STOPS; j++) {
    unclear |= fresh & (ABS(stop[j]) <= VANISHES * rounding_scale(s, gradient[j]));
    s->above_stop[j] = (s->above_stop[j] & ~fresh) | (fresh & (I)(stop[j] > 0));
  }
#endif
  note_modes(s, w, fresh & ~unclear, mode_of(s));
  begin_elsewhere(s, w, fresh & unclear);
}

/* Step size ------------------------------------------------------------------------------------ */

/* Where the last two terms, of a degree higher by ``more``, are 1. */
INLINE T size_of(T last, T before, int more) {
  T h1 = LOG2(MIN(last, BC(1e300))) * (-1.0 / (P + more)), h2 = LOG2(MIN(before, BC(1e300))) * (-1.0 / (P - 1 + more));
  return EXP2(MIN(h1, h2));
}

/* Ratios of the last two terms of a guard that is not affine to its allowance, in the lanes that have it; an affine
 * guard is bounded by the states. */
INLINE void guard_ratio(const Options *o, Step *e, int j, const T *gradient, I counts, T *last, T *before, T *sum) {
  const T *g = e->g[j];
  if (AFFINE[j]) { *sum += g[P] + g[P - 1]; return; }
  T a = o->rtol * ABS(g[0]) + 1e-290;
  UNROLL for (int i = 0; i < ND; i++) a += ABS(gradient[i]) * e->allowed[i];
  e->of_guards[j] = a - (1 - SAFETY) * o->rtol * ABS(g[0]);
  T r = ROUGH_INVERSE(a), p = ABS(g[P]) * r, b = ABS(g[P - 1]) * r;
  counts &= a > 1e-280;
  *sum += SELECT(counts, p + b, BC(0));
  *last = MAX(*last, SELECT(counts, p, BC(0)));
  *before = MAX(*before, SELECT(counts, b, BC(0)));
  I zero = counts & (MIN(p, b) == 0);
  if (any(zero)) *sum = SELECT(zero & ((g[P - 2] != 0) | (g[P - 3] != 0)), BC(INFINITY), *sum);
}

/* ``finite`` is false also in lanes where the last terms vanish, or are far smaller, and earlier ones bound the step. */
SHORT_OR_CHECKED T step_size(const Lanes *s, const Options *o, Step *e, int mode, I *finite) {
  T last = BC(1e-300), before = BC(1e-300), third = BC(0), fourth = BC(0), sum = BC(0);
  UNROLL for (int i = 0; i < N; i++) {
    const T *c = e->c[i];
    e->allowed[i] = i < ND ? SAFETY * (o->atol + o->rtol * ABS(s->x[i])) : BC(0);
    if (i >= ND) continue;
    T r = ROUGH_INVERSE(e->allowed[i]), p = ABS(c[P]) * r, b = ABS(c[P - 1]) * r;
    sum += p + b;
    last = MAX(last, p);
    before = MAX(before, b);
    third = MAX(third, ABS(c[P - 2]) * r);
    fourth = MAX(fourth, ABS(c[P - 3]) * r);
  }
  law_ratios(s, o, e, mode, &last, &before, &sum);
#if STOPS > 0
  T value[STOPS], gradient[STOPS][N];
  int needed = 0;
  for (int j = FIRST_STOP; j < SLOTS; j++) needed |= !AFFINE[j];
  if (needed) stop_values(OF(s), value, &gradient[0][0]);
  UNROLL for (int j = FIRST_STOP; j < SLOTS; j++) guard_ratio(o, e, j, gradient[j - FIRST_STOP], ~NONE, &last, &before, &sum);
#endif
  *finite = ABS(sum) < INFINITY;
  T h = size_of(last * (1 / LAST_TERM(mode)), before * (1 / BEFORE_LAST(mode)), 0), least = MAX(last * h, before) * h * GAP;
  *finite &= (third <= least) & (fourth <= least * h);
  return law_size(e, o, mode, h);
}

/* Roots: polynomials.h --------------------------------------------------------------------------- */

/* After a crossing the guard's first coefficient is zero, after a fold its first two, after a jump that of its guard. */
INLINE void drop_zeros(const Lanes *s, T *a, int j) {
#if M == 1 || EVENTS
  I by_one = NONE, by_two = NONE;
#if M == 1
  if (j == 0) { by_one = s->drop == 1; by_two = s->drop == 2; }
#endif
  if (EVENTS && j >= FIRST_STOP) by_one = s->from_zero[j - FIRST_STOP];
  if (!any(by_one | by_two)) return;
  UNROLL for (int k = 0; k <= P; k++) {
    T c1 = k < P ? a[k < P ? k + 1 : P] : BC(0), c2 = k + 1 < P ? a[k + 1 < P ? k + 2 : P] : BC(0);
    a[k] = SELECT(by_one, c1, SELECT(by_two, c2, a[k]));
  }
#endif
}

/* Returns the lanes whose surface or exit guard is not positive. */
INLINE I sort_guard(const Lanes *s, Guards *v, const T *g, const T *power, int j, I second, I *too_long) {
  T *a = v->a[j];
  I counts = s->live, flipped = {0}, wrong_way = {0}, none, unresolved, unclear = {0};
  v->root[j] = BC(INFINITY);
  v->slope[j] = BC(0);
  v->one[j] = NONE;
  v->hard[j] = v->flipped[j] = v->wrong_way[j] = NONE;
  if (M > 0 && j == 1 && !any(counts &= second)) return unclear;
  a[0] = g[0];
  UNROLL for (int k = 1; k <= P; k++) a[k] = g[k] * power[k];
  if (EVENTS || j < FIRST_STOP) drop_zeros(s, a, j);
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

/* Hard cases: sign changes of all Bernstein coefficients, one slot of each lane at a time. Several changes go to hard_root,
 * or are returned. */
OUTLINED I resolve(Guards *v) {
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
        double r = hard_root(v->a[j], l, j - FIRST_STOP, LANE_I(v->flipped[j], l) != 0, !SET || j >= FIRST_STOP, &LANE(v->slope[j], l));
        if (r >= 0) LANE(v->root[j], l) = r;
        else if (r != r) LANE_I(lost, l) = ~(int64_t)0;
      }
#else
      lost |= deep;
#endif
    }
  }
}

/* Polish isolated roots that can be the first, of ``n`` vectors together: in each lane the first one by a secant, the slots of
 * different lanes together; then others only if they are not clearly later. */
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
INLINE I sort_guards(const Lanes *s, Guards *v, T g[SERIES][P + 1], I second, T *h) {
  for (int first = 1;; first = 0) {
    T power[P + 1];
    I unclear = {0}, too_long = {0};
    power[1] = *h;
    UNROLL for (int k = 2; k <= P; k++) power[k] = power[k / 2] * power[k - k / 2];
    UNROLL for (int j = 0; j < SLOTS; j++) unclear |= sort_guard(s, v, g[j], power, j, second, &too_long);
    if (!first || !any(too_long)) return unclear;
#if RARE_CASES_HERE
    for (int j = 0; j < SLOTS; j++) resolve_step(g[j], M > 0 && j == 1 ? too_long & second : too_long, h);
#else
    return unclear | too_long;
#endif
  }
}

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

/* Checks ----------------------------------------------------------------------------------------- */

INLINE T series_at(const T *c, T at, int degree) {
  T v = c[degree];
  UNROLL for (int k = degree - 1; k >= 0; k--) v = v * at + c[k];
  return v;
}

/* The polynomials of the states and their slopes. */
INLINE void states_at(const Step *e, T at, int degree, T *x, T *slope) {
  UNROLL for (int i = 0; i < N; i++) {
    T v = e->c[i][degree], d = v;
    UNROLL for (int k = degree - 1; k >= 1; k--) { v = v * at + e->c[i][k]; d = d * at + v; }
    x[i] = v * at + e->c[i][0];
    slope[i] = d;
  }
}

#if ROWS + GUARDS > 0
/* Lanes where field and guards at a time of the step, or the states there, disagree with the polynomials. A ``located``
 * surface or stop has to be zero to the tolerance of a step, or the driver improves its root. */
INLINE I disagrees(const Lanes *s, const Step *e, int mode, T at, int degree, I located, T *x, I *missed) {
  T f[ROWS + 1], guard[GUARDS + 1], slope[N], rate = rate_of(e, at);
  I wrong = {0};
  states_at(e, at, degree, x, slope);
  check_series(s, e, mode, x, at, degree, f, guard);
  UNROLL for (int m = 0; m < ROWS; m++)
    wrong |= ~(I)(ABS(f[m] * rate - slope[ROW[m]]) * e->dt
                  <= WRONG * e->allowed[ROW[m]] + VANISHES * e->dt * ABS(slope[ROW[m]]));
  UNROLL for (int m = 0; m < GUARDS; m++) {
    int j = SLOT[m];
    I counts = (M > 0 && j == 1) || j >= SLOTS ? has_second(s, mode) : ~NONE;
    wrong |= counts & ~(I)(ABS(guard[m] - series_at(e->g[j], at, degree)) <= WRONG * e->of_guards[j]);
    I height = j >= SLOTS ? NONE : j >= FIRST_STOP ? ~NONE : j == 0 ? ~has_second(s, mode) : NONE;
    *missed |= height & (located == j + 1) & ~(I)(ABS(guard[m]) <= e->of_guards[j]);
  }
  return wrong;
}
#endif

/* The states at the ends of steps, shortened at a set until the polynomials agree; shortened lanes have no event. Returns
 * undecided lanes: the step may miss an event, or its defect remains too large. */
SHORT_OR_CHECKED I verify(const Lanes *s, Step *e, int mode, T *end) {
  I unclear = {0};
#if ROWS + GUARDS > 0
  I bent = s->live & is_bent(s, mode), missed = {0};
  if (!SET) unclear |= (s->length > 0) & (I)(e->by_series > GROWTH * s->length);
  UNROLL for (int i = 0; i < N; i++)
    unclear |= (s->length == 0) & (I)(e->by_series * ABS(e->c[i][1]) > FAR * (ABS(e->c[i][0]) + s->size));
  unclear &= bent;
  for (int tries = 0; !SET || GUARDS > 0 || any(bent); tries++) {
    I early = {0}, late;
    for (int k = 1; k <= CHECKS; k++) {
      T x[N];
      early |= disagrees(s, e, mode, e->dt * ((double)k / (CHECKS + 1)), INNER, NONE, x, &missed);
    }
    late = disagrees(s, e, mode, e->dt, P, e->slot, end, &missed);
    I wrong = (early | late) & bent & ~unclear;
    if (!SET || !any(wrong) || tries == 20) return unclear | missed | wrong;
    e->dt = SELECT(wrong, SELECT(early, 0.25 * e->dt, 0.5 * e->dt), e->dt);
    e->slot &= ~wrong;
    e->last &= ~wrong;
  }
#endif
  T slope[N];
  states_at(e, e->dt, P, end, slope);
  return unclear;
}

/* Steps ------------------------------------------------------------------------------------------ */

/* The guard of a stop where a step begins, or its rate if that is at its zero. */
INLINE T value_of_stop(T g[SERIES][P + 1], int stop, const I *from_zero) {
  const T *own = g[FIRST_STOP + stop];
  return EVENTS ? SELECT(from_zero[stop], own[1], own[0]) : own[0];
}

/* Lanes where a stop was passed between two steps: rounding hid it from the first. */
INLINE I passed_between(const Lanes *s, T g[SERIES][P + 1]) {
  I passed = {0};
  UNROLL for (int j = 0; j < STOPS; j++) {
    T value = value_of_stop(g, j, s->from_zero);
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
INLINE void expand_step(Lanes *s, Work *w, Step *e, int mode) {
  const Options *o = limits(w);
  I finite;
  expand_series(s, e, mode);
  e->by_series = step_size(s, o, e, mode, &finite);
  T left = o->t_end - s->t, h = MIN(e->by_series, BC(o->max_step));
#if SET
  T longest = MIN(BC(o->max_step), SELECT(s->length > 0, GROWTH * s->length, BC(INFINITY)));
  I held = time_of(e, h) > longest;
  if (any(held)) h = SELECT(held, place_of(e, longest), h);
#endif
  e->last = time_of(e, h) >= left;
  e->unclear = ~finite;
#if RARE_CASES_HERE && M == 1
  I after = (s->since == 0) & (s->events > BLOCKS);
  if (any(after)) e->unclear |= watch_limit(s, e->c, e->allowed, after);
#endif
  e->unclear |= ~e->last & ((time_of(e, h) <= SHORTEST * ABS(s->t)) | (h >= LONGEST));
  e->unclear |= (s->steps >= o->max_steps) | passed_between(s, e->g);
  /* Events at the end of the run, to rounding, are included. */
  T ends = left + AT_END * MAX(ABS(s->t), ABS(s->t + left));
  e->h = SET && !any(e->last) ? h : SELECT(e->last, place_of(e, ends), h);
  e->left = left;
}

INLINE void sort_step(Lanes *s, Step *e, int mode) {
  e->unclear |= sort_guards(s, &e->v, e->g, has_second(s, mode), &e->h);
  I hard = {0};
  UNROLL for (int j = 0; j < SLOTS; j++) hard |= e->v.hard[j];
  if (any(hard)) e->unclear |= resolve(&e->v);
}

/* Store the variables that a step may change, except the states. */
INLINE void keep_start(Lanes *s, Step *e) {
  e->t = s->t;
  e->since = s->since;
  e->length = s->length;
  for (int j = 0; EVENTS && j < STOPS; j++) {
    e->from_zero[j] = s->from_zero[j];
    s->from_zero[j] = NONE;
  }
  keep_mode(s, e);
}

/* Restore the lanes ``which`` as at the start of the step. */
OUTLINED void undo_step(Lanes *s, const Step *e, I which) {
  UNROLL for (int i = 0; i < N; i++) s->x[i] = SELECT(which, e->c[i][0], s->x[i]);
  s->t = SELECT(which, e->t, s->t);
  s->since = SELECT(which, e->since, s->since);
  s->length = SELECT(which, e->length, s->length);
  for (int j = 0; EVENTS && j < STOPS; j++) s->from_zero[j] |= e->from_zero[j] & which;
  undo_mode(s, e, which);
}

/* Lanes at an event, or at the end of the run, where another guard is small; values of all guards there. */
OUTLINED I crowded_lanes(const Lanes *s, const Step *e, int mode, I which, T *value) {
  I crowded = NONE;
  for (int j = 0; j < SLOTS; j++) {
    const T *g = e->g[j];
    T size = ABS(g[P]);
    value[j] = g[P];
    for (int k = P - 1; k >= 0; k--) { value[j] = value[j] * e->dt + g[k]; size = size * e->dt + ABS(g[k]); }
    I other = e->slot != j + 1;
    if (M > 0 && j == 1) other &= has_second(s, mode);
    crowded |= which & other & ~(I)(ABS(value[j]) > CROWDED * size);
  }
  return crowded;
}

/* Make the step; returns undecided lanes, and those at events that the driver makes. */
INLINE I take_step(Lanes *s, Work *w, Step *e, int mode) {
  const Options *o = limits(w);
  I unclear = e->unclear | by_chance(s, w);
#if SET
  if (mode == ON && any(e->slot == 1)) polish_slip(e);
#endif
  e->last &= time_of(e, e->dt) >= e->left;
  if (!SET || any(e->last)) e->dt = SELECT(e->last, place_of(e, e->left), e->dt);
  unclear |= e->last & (e->slot != 0) & (e->slot <= FIRST_STOP); /* a mode without a step */
  T requested = e->dt, end[N];
  unclear |= verify(s, e, mode, end);
  T passed = time_of(e, e->dt);
  keep_start(s, e);
  UNROLL for (int i = 0; i < N; i++) s->x[i] = end[i];
  s->t += passed;
  s->since += passed;
  if (TIMED) s->x[N - 1] = s->t;
  if (SET || ROWS + GUARDS > 0) s->length = SELECT(e->dt < requested, passed, MIN(time_of(e, e->h), e->left));
  s->steps += 1;
  unclear |= ~finite_lanes(s);
  unclear |= land(s, w, e, mode, s->live & ~unclear);
  T at_event[S1];
  I arrived = EVENTS ? e->slot > FIRST_STOP + CLEAR_STOPS : NONE;
  I tested = EVENTS ? arrived | (e->last & (e->slot == 0)) : NONE; /* ticks are exact, phases are not */
  if (any(tested)) unclear |= crowded_lanes(s, e, mode, tested, at_event);
#if EVENTS
  unclear |= sampled_there(s, w, arrived & s->live);
#endif
  unclear &= s->live;
  if (any(unclear)) {
    undo_step(s, e, unclear);
    s->steps += unclear;
  }
  I live = s->live & ~unclear, stopped = live & (e->slot > FIRST_STOP) & ~arrived;
#if RARE_CASES_HERE && !SET
  I due = live & (s->due < e->t + e->dt);
  if (any(due)) keep_samples(s, w, e, due);
#endif
#if STOPS > 0
  for (int j = 0; j < STOPS; j++)
    s->above_stop[j] = (s->above_stop[j] & ~live) | ((I)(value_of_stop(e->g, j, e->from_zero) > 0) & live);
  for (int j = 0; EVENTS && j < STOPS; j++) {
    I other = live & arrived & (e->slot != FIRST_STOP + 1 + j);
    s->above_stop[j] = (s->above_stop[j] & ~other) | ((I)(at_event[FIRST_STOP + j] > 0) & other);
  }
  if (any(stopped)) count(s, w, STOP, stopped);
#endif
  if (EVENTS) s->arrived = live & arrived & (e->slot - FIRST_STOP);
  s->t = SELECT(live & e->last, BC(o->t_end), s->t);
  finish_lanes(s, w, stopped, STOPPED);
  finish_lanes(s, w, e->last & live & (e->slot == 0), REACHED_END);
#if SET
  if (any(e->gone & live)) send(s, w, e->gone & live, mode == AWAY ? NEAR_SET : mode == ON ? GOING : AWAY);
#endif
  return EVENTS ? unclear | s->arrived != 0 : unclear;
}

#if SET
/* Lanes near the set reach it, or continue off it. */
INLINE I come_near(Lanes *s, Work *w, Step *e) {
  UNROLL for (int i = 0; i < N; i++) e->c[i][0] = s->x[i];
  keep_start(s, e);
  I steps = s->steps, unclear = by_chance(s, w), there = reach(s, w, s->live & ~unclear, &unclear) & ~unclear;
  if (any(there)) unclear |= change_mode(s, w, there, ENTRY, NEAR_GUARD, 1);
  unclear &= s->live;
  if (any(unclear)) {
    undo_step(s, e, unclear);
    s->steps = (s->steps & ~unclear) | (steps & unclear);
  }
  send(s, w, there & ~unclear, ON);
  send(s, w, s->live & ~(there | unclear), AWAY);
  return unclear;
}
#endif
