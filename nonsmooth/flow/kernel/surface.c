/* Clear decisions at one surface, whose modes are masks. */

/* Number of the mode: 0 above, 1 below, 2 sliding. */
INLINE I mode_of(const Lanes *s) { return (s->slides & 2) | (~s->slides & ~s->above & (M > 0)); }

INLINE void set_lambda(Lanes *s) { s->lambda = SELECT(s->above, BC(1), BC(-1)); }

/* Lanes with a second guard of the mode, and those whose field and guards have to be checked. */
INLINE I has_second(const Lanes *s, int mode) { return s->slides; }
INLINE I is_bent(const Lanes *s, int mode) {
  return ~((s->slides & -AFFINE_MODES[2]) | (~s->slides & s->above & -AFFINE_MODES[0])
           | (~s->slides & ~s->above & -AFFINE_MODES[1]));
}

/* A step's variable is the time. */
INLINE T time_of(const Step *e, T s) { return s; }
INLINE T place_of(const Step *e, T time) { return time; }
INLINE T rate_of(const Step *e, T s) { return BC(1); }

INLINE void expand_series(const Lanes *s, Step *e, int mode) { jet(OF(s), &e->c[0][0], &e->g[0][0]); }

INLINE void check_series(const Lanes *s, const Step *e, int mode, const T *x, T at, int degree, T *f, T *guard) {
#if ROWS + GUARDS > 0
  check_values(x, s->q, s->slides, s->above, s->lambda, f, guard);
#endif
}

/* Set the mode, and the number of coefficients to drop, of lanes on the surface with clearly transversal fields; returns
 * undecided lanes. */
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

#if M > 0
INLINE void lie(const Lanes *s, T *value, T *scale) {
  T gradient[2][N];
  lie_values(OF(s), value, &gradient[0][0]);
  scale[0] = rounding_scale(s, gradient[0]);
  scale[1] = rounding_scale(s, gradient[1]);
}
#endif

/* Set modes of lanes just loaded; returns undecided lanes. */
INLINE I begin_modes(Lanes *s, I fresh) {
  I unclear = {0};
  s->slides &= ~fresh;
  s->above &= ~fresh;
  s->drop &= ~fresh;
#if M > 0
  T h, g[1][N], value[2], scale[2], noise = heights(s, &h, g);
  I on = fresh & (ABS(h) <= ON_SURFACE * noise);
  unclear |= fresh & ~(ABS(h) < INFINITY);
  s->above |= fresh & (h > 0);
  if (any(on)) {
    project(s, on);
    lie(s, value, scale);
    unclear |= decide(s, on, value, scale);
  }
#endif
  set_lambda(s);
  return unclear;
}

INLINE void guard_ratio(const Options *o, Step *e, int j, const T *gradient, I counts, T *last, T *before, T *sum);

/* Ratios of the last two terms of the surface's guards that are not affine to their allowances. */
INLINE void law_ratios(const Lanes *s, const Options *o, Step *e, int mode, T *last, T *before, T *sum) {
#if M > 0
  T gradient[2][N], surface[N], value[2], h;
  if (!AFFINE[0] || !AFFINE[1]) {
    lie_values(OF(s), value, &gradient[0][0]);
    surface_values(OF(s), &h, surface);
    UNROLL for (int i = 0; i < N; i++) gradient[0][i] = SELECT(s->slides, gradient[0][i], surface[i]);
  }
  UNROLL for (int j = 0; j < 2; j++) guard_ratio(o, e, j, gradient[j], j == 1 ? s->slides : ~NONE, last, before, sum);
#endif
}
INLINE T law_size(const Step *e, const Options *o, int mode, T h) { return h; }

/* Events --------------------------------------------------------------------------------------- */

#if RARE_CASES_HERE
static Past *past_of(const Lanes *s, int l) { return &s->past[l]; }

/* Bring a lane's last events up to date. */
static void recall(const Lanes *s, int l) {
  Past *p = past_of(s, l);
  if (s->row - p->row > ROWS_KEPT) { p->count = 0; p->row = s->row - ROWS_KEPT; }
  for (; p->row < s->row; p->row++) {
    int64_t row = p->row & (ROWS_KEPT - 1), pattern = LANE_I(s->log->pattern[row], l);
    if (pattern >= 0) p->event[p->count++ % HISTORY] = (Recent){LANE(s->log->interval[row], l), pattern};
  }
}

/* Lanes whose last event may accumulate with earlier ones, so that the run may end: the states change by less than their
 * tolerances until the limit, whose time is at least SHRINKS_TO of the last interval. */
OUTLINED I watch_limit(const Lanes *s, T c[N][P + 1], const T *allowed, I which) {
  T interval = s->log->interval[(s->row - 1) & (ROWS_KEPT - 1)], rate = BC(0);
  UNROLL for (int i = 0; i < ND; i++)
    rate = MAX(rate, ABS(c[i][1]) * ROUGH_INVERSE(allowed[i] + VANISHES * (s->size + ABS(s->x[i]))));
  I may = which & ((interval * rate <= 2 / SHRINKS_TO) | (interval <= NEAR / SHRINKS_TO * MAX(BC(1), ABS(s->t))));
  for EACH(l, may) {
    recall(s, (int)l);
    if (!may_accumulate(past_of(s, (int)l))) LANE_I(may, l) = 0;
  }
  return may;
}

/* Record events of the lanes ``which`` by their kinds and those of their guards. */
INLINE I remember(Lanes *s, I which, I kind, I guard) {
  int64_t row = s->row++ & (ROWS_KEPT - 1);
  s->log->interval[row] = s->since;
  s->log->pattern[row] = ((kind << 40) + (guard << 32)) | ~which;
  s->since = SELECT(which, BC(0), s->since);
  return NONE;
}
#else
/* Decreasing intervals are left to the driver, which computes their limit. */
INLINE I remember(Lanes *s, I which, I, I) {
  I shorter = which & (s->since < SHRINKS * s->shortest);
  s->shortest = SELECT(shorter, s->since, s->shortest);
  s->since = SELECT(which, BC(0), s->since);
  s->shrinking -= shorter;
  return which & (s->shrinking >= 3);
}
#endif

#if M > 0
/* Change the mode of lanes that reached the surface or an end of sliding; ``slope`` is that of the guard over the step.
 * Returns undecided lanes, which have no event. */
INLINE I change_modes(Lanes *s, Work *w, I reached, I up, I down, T slope) {
  T value[2], scale[2];
  lie(s, value, scale);
  I ends = up | down, was = s->slides, unclear = {0};
  I steep = slope < -STEEP_EXIT * MAX(scale[0], scale[1]);
  double clear = CANCELLED ? VANISHES : 2 * (limits(w)->rtol + TANGENT); /* not an exit at a two-fold */
  I attracts = (up & (I)(value[1] > clear * scale[1])) | (down & (I)(value[0] < -clear * scale[0]));
  unclear |= ends & ~(steep & attracts);
  I was_above = s->above;
  unclear |= decide(s, reached, value, scale);
  s->slides &= ~ends;
  s->above = (s->above & ~ends) | up;
  s->drop = (s->drop & ~ends) | (ends & 2);
  unclear |= s->events + 1 >= limits(w)->max_events;
#if RARE_CASES_HERE
  unclear |= ends_sampling(s, w, reached | ends);
#endif
  I all = (reached | ends) & ~unclear & (s->slides ^ was | s->above ^ was_above);
  I entered = all & s->slides & ~was, kind = (entered & ENTRY) | (ends & EXIT) | (~entered & ~ends & CROSSING);
  all &= ~remember(s, all, kind, ends & EXIT_GUARD);
  count(s, w, ENTRY, entered & all);
  count(s, w, EXIT, all & ends);
  count(s, w, CROSSING, all & ~ends & ~entered);
#if RARE_CASES_HERE
  keep_hits(s, w, ENTRY, SURFACE_GUARD, entered & all, was_above);
  keep_hits(s, w, EXIT, EXIT_GUARD, all & ends, was_above);
  keep_hits(s, w, CROSSING, SURFACE_GUARD, all & ~ends & ~entered, was_above);
#endif
  set_lambda(s);
  note_modes(s, w, all, mode_of(s));
  return (reached | ends) & ~all;
}

/* Lanes that slide towards a two-fold where the sliding field is 0/0. */
INLINE I near_two_fold(const Lanes *s, double tolerance) {
  T value[2], scale[2];
  lie(s, value, scale);
  return (ABS(value[0]) <= 2 * (tolerance + TANGENT) * scale[0])
         & (ABS(value[1]) <= 2 * (tolerance + TANGENT) * scale[1]);
}
#endif

/* The end of a step: project onto the surface and enter the next mode. Returns undecided lanes. */
INLINE I land(Lanes *s, Work *w, Step *e, int mode, I live) {
  I unclear = {0};
#if M > 0
  I slides = live & s->slides, reached = live & ~s->slides & (e->slot == 1), up = slides & (e->slot == 1), down = live & (e->slot == 2);
  if (any(reached | slides)) unclear |= project(s, reached | s->slides);
  I on = slides & (e->slot == 0) & ~e->last;
  if (!CANCELLED && any(on)) unclear |= on & near_two_fold(s, limits(w)->rtol);
  reached &= ~unclear;
  up &= ~unclear;
  down &= ~unclear;
  if (any(reached | up | down)) unclear |= change_modes(s, w, reached, up, down, e->slope);
  s->length = SELECT(reached | up | down, BC(0), s->length);
#endif
  return unclear;
}

INLINE void keep_mode(Lanes *s, Step *e) {
  e->drop = s->drop;
  e->slides = s->slides;
  e->above = s->above;
  s->drop = NONE;
}
INLINE void undo_mode(Lanes *s, const Step *e, I which) {
  s->drop = (s->drop & ~which) | (e->drop & which);
  s->slides = (s->slides & ~which) | (e->slides & which);
  s->above = (s->above & ~which) | (e->above & which);
  set_lambda(s);
}

#if RARE_CASES_HERE
static void write_mode(const Lanes *s, int l, Suspended *m) {
  recall(s, l);
  m->letter[0] = LANE_I(s->slides, l) ? 0 : LANE_I(s->above, l) ? 1 : -1;
  for (int k = M; k < LETTERS; k++) m->letter[k] = 1; /* an open contact */
#if EVENTS
  memcpy(m->letter + M, past_of(s, l)->letter, SURFACES);
#endif
  m->drop = (int32_t)LANE_I(s->drop, l);
}

/* Returns the pool of the mode. */
static int read_mode(Lanes *s, int l, const Suspended *m) {
  past_of(s, l)->row = s->row;
  LANE_I(s->slides, l) = -(int64_t)(M > 0 && m->letter[0] == 0);
  LANE_I(s->above, l) = -(int64_t)(m->letter[0] > 0);
  LANE(s->lambda, l) = m->letter[0] > 0 ? 1 : -1;
  LANE_I(s->drop, l) = m->drop;
#if EVENTS
  memcpy(past_of(s, l)->letter, m->letter + M, SURFACES);
#endif
  return AWAY;
}
#endif
