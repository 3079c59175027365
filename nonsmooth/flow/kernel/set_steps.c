/* A step of lanes in one of three modes at a set: set_lanes.c. */

/* Coefficients of a step. */
typedef struct {
  T c[N][P + 1], g[SLOTS][P + 1], unknowns[K][P + 1], ends[2 * K]; /* unknowns on the set; the direction when leaving it */
  T allowed[N], level; /* of states, and of |h| */
  T radius, stretch, fall; /* |h|, or friction's limit; 1 over the time to a branch point; part that |h| may fall to */
  T off_stop[STOPS + 1], off_slip[K + 1]; /* what stops, unknowns and friction's limit may be off in a check */
} Step;

/* Time and the variable s of a step: dt = (1 - stretch s/3)^2 ds (set_program.py). */
INLINE T time_of(const Step *e, T s) {
  T v = s * e->stretch * (1.0 / 3);
  return s * (1.0 - v + v * v * (1.0 / 3));
}

INLINE T rate_of(const Step *e, T s) {
  T v = 1.0 - s * e->stretch * (1.0 / 3);
  return v * v;
}

INLINE T place_of(const Step *e, T time) {
  T q = 1.0 - time * e->stretch, size = MAX(ABS(q), BC(1e-30)), y = EXP2(LOG2(size) * (1.0 / 3));
  for (int again = 0; again < 2; again++) {
    T cube = y * y * y;
    y *= (cube + 2.0 * size) / (2.0 * cube + size);
  }
  y = SELECT(q < 0, -y, y);
  return 3.0 * time / (1.0 + y + y * y);
}

/* 1 over the time to where the set is reached, roughly, or from where it was left: any value is right. */
INLINE T stretch_of(const Lanes *s) {
  T h[K], g[K][N], a[K], m[K * K], y[K], c, square = BC(0), back = -1.0 / (s->t - s->left_at);
  height_values(s->x, s->q, LAMBDA(s->lam), h, &g[0][0]);
  frozen_values(s->x, s->q, LAMBDA(s->lam), a, m);
  I isotropic, holds = is_definite(m, &isotropic, &c);
  solve_block(m, a, y);
  UNROLL for (int i = 0; i < K; i++) square += y[i] * y[i];
  T along = BC(0), part = BC(0), rate = BC(0), radius = BC(0);
  UNROLL for (int i = 0; i < K; i++) radius += h[i] * h[i];
  T size = QUICK_ROOT(radius);
  UNROLL for (int i = 0; i < K; i++) {
    T own = a[i] * size;
    UNROLL for (int j = 0; j < K; j++) own -= m[i * K + j] * h[j];
    rate += h[i] * own;
    along += a[i] * h[i];
    part += a[i] * a[i];
  }
  T over = SELECT(isotropic, c * c - part, MAX(-rate, BC(0))), under = SELECT(isotropic, c * size + along, radius * size);
  T per = over * QUICK_INVERSE(under);
  return SELECT(holds & (square < 1) & (per >= 0), per, back);
}

/* Step size -------------------------------------------------------------------------------------- */

INLINE T weighed(const T *gradient, const char *there, const T *allowed) {
  T sum = BC(0);
  UNROLL for (int i = 0; i < ND; i++) if (there[i]) sum += ABS(gradient[i]) * allowed[i];
  return sum;
}

INLINE void bound(T last_one, T before_one, T per, T *last, T *before) {
  *last = MAX(*last, ABS(last_one) * per);
  *before = MAX(*before, ABS(before_one) * per);
}

/* Ratios of the last two terms of the guards to their tolerances. */
INLINE void guard_bounds(const Lanes *s, const Work *w, Step *e, int mode, T *last, T *before) {
  const Options *o = w->o;
  T h[K], gradient[K][N], sum = BC(0);
  height_values(s->x, s->q, LAMBDA(s->lam), h, &gradient[0][0]);
  UNROLL for (int i = 0; i < K; i++) sum += weighed(gradient[i], HEIGHT_SLOPES[i], e->allowed);
  const T *g = e->g[0];
  e->level = sum;
  e->fall = SELECT(e->radius * (SAFETY * o->rtol) > LEFT * sum, BC(FALLEN), BC(FALL));
  if (mode == AWAY) bound(g[P], g[P - 1], e->radius * ROUGH_INVERSE(sum + o->rtol * e->radius * ABS(g[0])), last, before);
  if (mode == GOING) bound(g[P - 2], g[P - 3], 1.0 / sum, last, before);
  if (mode == ON) {
    T value[K + 1], slope[K + 1][N];
    slip_values(s->x, s->q, LAMBDA(s->lam), value, &slope[0][0]);
    T part[K + 1], all = BC(0);
    UNROLL for (int i = 0; i <= K; i++) part[i] = weighed(slope[i], SLIP_SLOPES[i], e->allowed);
    UNROLL for (int i = 0; i < K; i++) all += 2.0 * (ABS(value[i]) + ABS(value[K])) * (part[i] + part[K]);
    /* Where rolling ends the motion is smooth to the second order: the time is known to the tolerance itself. */
    bound(g[P], g[P - 1], SAFETY * BEFORE_LAST * ROUGH_INVERSE(all + o->rtol * ABS(g[0]) + 1e-290), last, before);
    UNROLL for (int i = 0; i <= K; i++) e->off_slip[i] = WRONG * part[i] + VANISHES * rounding_scale(s, w, slope[i], SLIP_SLOPES[i]);
  }
#if STOPS > 0
  if (!BENT_STOPS) return;
  T stop[STOPS], slopes[STOPS][N];
  stop_values(s->x, s->q, LAMBDA(s->lam), stop, &slopes[0][0]);
  UNROLL for (int j = 0; j < STOPS; j++) {
    const T *a = e->g[1 + j];
    T part = weighed(slopes[j], STOP_SLOPES[j], e->allowed);
    bound(a[P], a[P - 1], ROUGH_INVERSE(part + o->rtol * ABS(a[0]) + 1e-290), last, before);
    e->off_stop[j] = WRONG * part + VANISHES * rounding_scale(s, w, slopes[j], STOP_SLOPES[j]);
  }
#endif
}

/* Where the last two terms, of a degree higher by ``more``, are 1. */
INLINE T size_of(T last, T before, int more) {
  T h1 = LOG2(MIN(last, BC(1e300))) * (-1.0 / (P + more)), h2 = LOG2(MIN(before, BC(1e300))) * (-1.0 / (P - 1 + more));
  return EXP2(MIN(h1, h2));
}

/* The coefficients of a step. */
INLINE void expand_step(const Lanes *s, Step *e, int mode) {
  e->stretch = mode == AWAY ? stretch_of(s) : BC(0);
  if (mode == AWAY) off_jet(s->x, s->q, UNPACK(s->lam), e->stretch, &e->c[0][0], &e->g[0][0], e->ends, &e->radius);
  if (mode == ON) on_jet(s->x, s->q, LAMBDA(s->lam), &e->c[0][0], &e->g[0][0], &e->unknowns[0][0]);
  if (mode == GOING) leave_jet(s->x, s->q, LAMBDA(s->lam), &e->c[0][0], &e->g[0][0], &e->unknowns[0][0]);
}

/* The size that the coefficients allow: terms fall to a fifth of the one before or less, so what comes after the
 * last one is within the tolerance where this is LAST_TERM of it and the one before BEFORE_LAST. */
INLINE T series_size(const Lanes *s, const Work *w, Step *e, int mode, I *finite) {
  const Options *o = w->o;
  T last = BC(1e-300), before = BC(1e-300), sum = BC(0), per = BC(1.0 / (SAFETY * o->rtol));
  T turn = BC(1e-300), turn_before = BC(1e-300);
  UNROLL for (int i = 0; i < N; i++) {
    e->allowed[i] = i < ND ? SAFETY * (o->atol + o->rtol * ABS(s->x[i])) : BC(0);
    if (i >= ND) continue;
    bound(e->c[i][P], e->c[i][P - 1], ROUGH_INVERSE(e->allowed[i]), &last, &before);
    sum += e->c[i][P] + e->c[i][P - 1];
  }
  UNROLL for (int j = 0; j < SLOTS; j++) if (j != LIMIT_SLOT || mode == ON) sum += e->g[j][P] + e->g[j][P - 1] + e->g[j][0];
  guard_bounds(s, w, e, mode, &last, &before);
  UNROLL for (int i = 0; i < K; i++) {
    if (mode == ON) continue;
    T one = mode == AWAY ? e->ends[2 * i + 1] : e->unknowns[i][P], two = mode == AWAY ? e->ends[2 * i] : e->unknowns[i][P - 1];
    sum += one + two;
    if (mode == AWAY) { one = SELECT(s->behind, one, BC(0)); two = SELECT(s->behind, two, BC(0)); }
    if (mode == GOING) bound(one, two, BC(1), &turn, &turn_before);
    else bound(one, two, per, &last, &before);
  }
  *finite = ABS(sum) < INFINITY;
  if (mode == AWAY) e->g[0][0] -= e->fall;
  if (mode == ON) {
    T *g = e->g[LIMIT_SLOT], first = 1.0 / g[0];
    e->radius = g[0];
    I moves = g[0] != 0;
    UNROLL for (int k = 1; k <= P; k++) g[k] = SELECT(moves, g[k] * first, BC(0));
    g[0] = BC(1 - LIMIT_FALL);
  }
  if (mode != GOING) return size_of(last * (1 / LAST_TERM), before * (1 / BEFORE_LAST), 0);
  T h = size_of(last, before, 0);
  /* Where the set is far behind at the end h has to be known to the tolerance, nearer its direction. */
  T rate = e->g[0][0], part = rate / e->level;
  T far = MIN(size_of(turn * (1 / TURNED), turn_before * (1 / TURNED), 0), size_of(turn * part, turn_before * part, 2));
  far = SELECT((rate > 0) & (rate * far * far * (SAFETY * o->rtol) > LEFT * e->level), far, BC(0));
  return MIN(h, MAX(far, size_of(turn * per, turn_before * per, 0)));
}

/* Roots ------------------------------------------------------------------------------------------ */

/* Hard cases by sign changes of all Bernstein coefficients: those with one become ``one``, those without are
 * none, the others stay. */
static __attribute__((noinline)) void count_changes(const T *a, I wrong_way, I *one, I *hard) {
  T b[P + 1];
  I first, changes;
  UNROLL for (int k = 0; k <= P; k++) b[k] = a[k];
  changes = sign_changes(b, &first);
  *one |= *hard & first & (changes == 1) & ~wrong_way;
  *hard &= ~(*one | (first & (changes == 0)));
}

/* Time of the first event within h in each lane, its slot + 1 and the guard's slope over the step; lanes that
 * are not clear. */
INLINE I first_hit(const Lanes *s, Step *e, int mode, T *steps, T *dt, I *slot, T *slope) {
  T a[SLOTS][P + 1], end[SLOTS];
  I one[SLOTS], hard[SLOTS], flipped[SLOTS], turned[SLOTS], unclear = {0};
  for (int first = 1;; first = 0) {
    T power[P + 1];
    I too_long = {0};
    power[1] = *steps;
    UNROLL for (int k = 2; k <= P; k++) power[k] = power[k / 2] * power[k - k / 2];
    UNROLL for (int j = 0; j < SLOTS; j++) {
      if (j == LIMIT_SLOT && mode != ON) continue;
      I none, unresolved, wrong_way = {0};
      int stops = j > 0 && j <= STOPS, direction = stops ? DIRECTION[stops ? j - 1 : 0] : 0;
      flipped[j] = (I){0};
      if (stops) flipped[j] = e->g[j][0] < 0;
      a[j][0] = e->g[j][0];
      UNROLL for (int k = 1; k <= P; k++) a[j][k] = e->g[j][k] * power[k];
      if (stops) {
        I sign = flipped[j] & INT64_MIN;
        UNROLL for (int k = 0; k <= P; k++) a[j][k] = (T)((I)a[j][k] ^ sign);
        if (direction) wrong_way = direction < 0 ? flipped[j] : ~flipped[j];
      }
      screen(a[j], &none, &one[j], &unresolved, &end[j]);
      I zero = ~(I)(a[j][0] > 0), counts = s->live;
      too_long |= counts & unresolved;
      if (first && any(counts & unresolved)) resolve_step(e->g[j], counts & unresolved, steps);
      if (!stops) { unclear |= counts & zero; counts &= ~zero; }
      hard[j] = counts & ((~none & ~one[j]) | (one[j] & wrong_way) | zero);
      one[j] &= counts & ~hard[j];
      turned[j] = wrong_way;
    }
    if (!first || !any(too_long)) break;
  }
  T h = *steps, best = BC(INFINITY), second = BC(INFINITY), tie = NEAR * MAX(BC(1), ABS(s->t));
  *slot = (I){0};
  UNROLL for (int j = 0; j < SLOTS; j++) {
    if (j == LIMIT_SLOT && mode != ON) continue;
    T root = BC(INFINITY), d = BC(0);
    if (any(hard[j])) count_changes(a[j], turned[j], &one[j], &hard[j]);
    for EACH(l, hard[j]) {
      double at = hard_root(a[j], l, j <= STOPS ? j - 1 : -1, LANE_I(flipped[j], l) != 0, j > 0 && j <= STOPS, &LANE(d, l));
      if (at >= 0) LANE(root, l) = at;
      else if (at != at) LANE_I(unclear, l) = ~(int64_t)0;
    }
    if (any(one[j])) {
      const T *series = a[j];
      T at;
      polish(1, &series, &end[j], &one[j], &at, &d);
      root = SELECT(one[j], at, root);
    }
    I sooner = root < best;
    second = SELECT(sooner, best, MIN(second, root));
    best = SELECT(sooner, root, best);
    *slot = SELECT_I(sooner, (I){0} + (j + 1), *slot);
    *slope = SELECT(sooner, d, *slope);
  }
  I hit = *slot != 0;
  *dt = SELECT(hit, best * h, h);
  return unclear | (hit & ((second - best) * h <= tie));
}

/* Checks ----------------------------------------------------------------------------------------- */

INLINE T series_at(const T *c, int degree, T at) {
  T v = c[degree];
  UNROLL for (int k = degree - 1; k >= 0; k--) v = v * at + c[k];
  return v;
}

/* The polynomials and their slopes. */
INLINE void follow(const Step *e, T at, int degree, T *x, T *slope) {
  UNROLL for (int i = 0; i < N; i++) {
    const T *c = e->c[i];
    T v = c[degree], d = v;
    UNROLL for (int k = degree - 1; k >= 1; k--) { v = v * at + c[k]; d = d * at + v; }
    x[i] = v * at + c[0];
    slope[i] = d;
  }
}

/* Lanes where the field and what ends the mode at a time of the step are not those of the polynomials; the states
 * then. */
INLINE I disagrees(const Lanes *s, const Step *e, int mode, T *x, T at, T dt, int degree) {
  I wrong = {0};
  T f[N], d[N], stop[STOPS + 1], rate = rate_of(e, at);
  const int rows = mode == ON ? ON_ROWS : ROWS, *const row_of = mode == ON ? ON_ROW : ROW;
  follow(e, at, degree, x, d);
  if (mode == AWAY) off_check(x, s->q, LAMBDA(s->lam), f, stop);
  if (mode == ON) on_check(x, s->q, LAMBDA(s->lam), f, stop);
  if (mode == GOING) {
    T whole[N], u[K], length;
    UNROLL for (int i = 0; i < K; i++) u[i] = series_at(e->unknowns[i], degree, at);
    length = length_of(u);
    UNROLL for (int i = 0; i < K; i++) u[i] /= length;
    field_values(x, s->q, LAMBDA(u), whole);
    UNROLL for (int m = 0; m < ROWS; m++) f[m] = whole[ROW[m]];
    if (BENT_STOPS) off_check(x, s->q, LAMBDA(s->lam), whole, stop);
  }
  UNROLL for (int m = 0; m < rows; m++) {
    T slope = d[row_of[m]];
    wrong |= ~(I)(ABS(f[m] * rate - slope) * dt <= WRONG * e->allowed[row_of[m]] + VANISHES * dt * ABS(slope));
  }
  UNROLL for (int j = 0; j < (BENT_STOPS ? STOPS : 0); j++)
    wrong |= ~(I)(ABS(stop[j] - series_at(e->g[1 + j], degree, at)) <= e->off_stop[j]);
  if (mode == ON && BENT_SLIP) {
    T value[K + 1], gradient[K + 1][N];
    slip_values(x, s->q, LAMBDA(s->lam), value, &gradient[0][0]);
    UNROLL for (int i = 0; i < K; i++)
      wrong |= ~(I)(ABS(value[i] - series_at(e->unknowns[i], degree, at)) <= e->off_slip[i]);
  }
  return wrong;
}

/* Steps that the polynomials bear out, with the states at their ends; shortened lanes have no event. Lanes whose
 * first step in a mode may not see what comes are left to the interpreter. */
INLINE I verify(const Lanes *s, const Work *w, const Step *e, int mode, T by_series, T *dt, I *slot, I *last, T *end) {
  I leaps = {0};
  if (mode == ON && ON_ROWS == 0 && !BENT_SLIP && !BENT_STOPS) {
    T slope[N];
    follow(e, *dt, P, end, slope);
    return leaps;
  }
  UNROLL for (int i = 0; i < N; i++)
    leaps |= (I)(s->length == 0) & (I)(by_series * ABS(e->c[i][1]) > FAR * (ABS(e->c[i][0]) + w->size));
  for (int tries = 0; tries < 20; tries++) {
    T x[N], at = 0.5 * *dt;
    I early = s->live & disagrees(s, e, mode, x, at, *dt, INNER);
    I late = s->live & ~early & disagrees(s, e, mode, end, *dt, *dt, P);
    if (!any(early | late)) return leaps;
    *dt = SELECT(early, 0.5 * at, SELECT(late, at, *dt));
    *slot &= ~(early | late);
    *last &= ~(early | late);
  }
  return ~(I){0};
}

/* Steps ------------------------------------------------------------------------------------------ */

/* Lanes where a stop was passed between two steps: rounding hid it from the first. */
INLINE I passed_between(Lanes *s, const Step *e) {
  I passed = {0};
  UNROLL for (int j = 0; j < STOPS; j++) {
    T value = e->g[1 + j][0];
    I above = value > 0, was = s->above_stop[j];
    if (DIRECTION[j] <= 0) passed |= was & ~above;
    if (DIRECTION[j] >= 0) passed |= ~was & (I)(value >= 0);
    s->above_stop[j] = above;
  }
  return passed;
}

/* Times at which |nu| = |n|, from those at which their squares are equal to rounding. */
INLINE void polish_slip(const Step *e, I which, T h, T *dt) {
  T root = *dt;
  for (int again = 0; again < 2; again++) {
    T square = BC(0), along = BC(0), n = BC(0), of_n = BC(0);
    /* The limit's series stands in its slot over its first value. */
    UNROLL for (int i = 0; i < K; i++) {
      T v = e->unknowns[i][P], d = BC(0);
      UNROLL for (int k = P - 1; k >= 0; k--) { d = d * root + v; v = v * root + e->unknowns[i][k]; }
      square += v * v;
      along += v * d;
    }
    n = e->g[LIMIT_SLOT][P];
    UNROLL for (int k = P - 1; k >= 0; k--) { of_n = of_n * root + n; n = n * root + (k ? e->g[LIMIT_SLOT][k] : BC(1)); }
    n *= e->radius;
    of_n *= e->radius;
    T size = SQRT_(square), sign = SELECT(n < 0, BC(-1), BC(1)), slope = sign * of_n - along / size;
    T next = MIN(MAX(root - (ABS(n) - size) / slope, BC(0)), h);
    root = SELECT((size > 0) & (slope < 0), next, root);
  }
  *dt = SELECT(which & (ABS(root - *dt) <= 1e-6 * *dt), root, *dt);
}

INLINE void take_step(Lanes *s, Work *w, Step *e, int mode) {
  const Options *o = w->o;
  T dt, slope = BC(0), end[N];
  I finite, slot;
  Start from;
  keep_start(s, &from);
  T by_series = series_size(s, w, e, mode, &finite);
  T h = by_series, left = o->t_end - s->t, longest = SELECT(s->length > 0, GROWTH * s->length, BC(INFINITY));
  longest = MIN(longest, BC(o->max_step));
  I held = time_of(e, h) > longest, last, unclear = ~finite | by_chance(s, w);
  if (any(held)) h = SELECT(held, place_of(e, longest), h);
  last = time_of(e, h) >= left;
  unclear |= ~last & ((time_of(e, h) <= SHORTEST * MAX(ABS(s->t), ABS(s->t - w->b->t0))) | (h >= LONGEST));
  unclear |= (s->steps >= o->max_steps) | passed_between(s, e);
  if (any(last)) h = SELECT(last, place_of(e, left + AT_END * MAX(ABS(s->t), ABS(s->t + left))), h);
  T whole = h;
  unclear |= first_hit(s, e, mode, &h, &dt, &slot, &slope);
  if (mode == ON && any(slot == 1)) polish_slip(e, slot == 1, h, &dt);
  last &= h == whole;
  I over = last & (time_of(e, dt) >= left);
  unclear |= over & (slot == 1); /* a mode without a step */
  if (any(over)) dt = SELECT(over, place_of(e, left), dt);
  T wanted = dt;
  unclear |= verify(s, w, e, mode, by_series, &dt, &slot, &last, end);
  T passed = time_of(e, dt);
  over &= last;
  s->length = SELECT(dt < wanted, passed, MIN(time_of(e, h), left));
  UNROLL for (int i = 0; i < N; i++) s->x[i] = end[i];
  s->t += passed;
  s->since += passed;
  if (TIMED) s->x[N - 1] = s->t;
  s->steps += 1;
  T sum = BC(0);
  UNROLL for (int i = 0; i < ND; i++) sum += end[i] - end[i];
  unclear |= ~(I)(sum == 0);
  I live = s->live & ~unclear, met = live & (slot == 1), stopped = live & (slot > 1) & (slot <= STOPS + 1);
  s->t = SELECT(live & over, BC(o->t_end), s->t);
  last &= live & (slot == 0);
  I gone = {0};
  if (mode == AWAY) {
    T height[K], g[K][N], scale = heights(s, w, height, g), radius = length_of(height);
    if (any(s->behind)) s->behind &= radius <= LEFT * scale;
    I small = (radius <= CLOSE * scale) | ((e->stretch > 0) & (radius * radius * radius <= SMALL * o->rtol * scale * scale * scale));
    gone = met | (live & ~stopped & ~last & small);
    s->fell = met;
  } else if (mode == ON) {
    unclear |= project(s, w, s->live);
    gone = met;
    if (any(gone)) {
      unclear |= gone & ~(I)(slope < -1e-10 * e->g[0][0]);
      unclear |= release(s, w, gone);
      unclear |= change_mode(s, w, gone & ~unclear, EXIT, SLIP_GUARD, 0);
      s->left_at = SELECT(gone & ~unclear, s->t, s->left_at);
    }
  } else {
    unclear |= met | (live & ~(I)(e->g[0][0] > 0));
    gone = live & ~stopped & ~last;
    T distance = series_at(e->g[0], P, dt) * dt * dt, height[K], g[K][N], u[K];
    UNROLL for (int i = 0; i < K; i++) u[i] = series_at(e->unknowns[i], P, dt);
    if (NAMED) UNROLL for (int i = 0; i < K; i++) s->x[OWN[i]] = SELECT(s->live, distance * u[i], s->x[OWN[i]]);
    T scale = heights(s, w, height, g);
    s->behind = distance <= LEFT * scale;
    if (!NAMED) unclear |= gone & s->behind;
    s->length = BC(0);
  }
  if (STOPS > 0 && any(stopped & ~unclear)) {
    count(s, w, STOP, stopped & ~unclear);
    finish_lanes(s, w, mode, stopped & ~unclear, STOPPED);
  }
  finish_lanes(s, w, mode, last & ~unclear, REACHED_END);
  send(s, w, mode, gone & ~unclear, mode == AWAY ? NEAR_SET : mode == ON ? GOING : AWAY);
  if (any(unclear &= s->live)) step_elsewhere(s, w, unclear, &from);
}

/* The parts of a step one after the other for all groups: the text of each is long, and read once for them all. */
INLINE void step_in(Lanes *groups, Work *w, int mode) {
  Step e[GROUPS];
  for (int group = 0; group < w->groups; group++)
    if (any(groups[group].live)) expand_step(&groups[group], &e[group], mode);
  for (int group = 0; group < w->groups; group++)
    if (any(groups[group].live)) take_step(&groups[group], w, &e[group], mode);
}

static __attribute__((noinline)) void step_off(Lanes *s, Work *w) { step_in(s, w, AWAY); }
static __attribute__((noinline)) void step_on(Lanes *s, Work *w) { step_in(s, w, ON); }
static __attribute__((noinline)) void step_leaving(Lanes *s, Work *w) { step_in(s, w, GOING); }

/* What is near the set reaches it, or goes on off it. */
INLINE void come_near(Lanes *s, Work *w) {
  Start from;
  keep_start(s, &from);
  I unclear = by_chance(s, w), there = reach(s, w, s->live & ~unclear, &unclear) & ~unclear;
  if (any(there)) unclear |= change_mode(s, w, there, ENTRY, NEAR_GUARD, 1);
  there &= ~unclear;
  send(s, w, NEAR_SET, there, ON);
  send(s, w, NEAR_SET, ~(there | unclear), AWAY);
  if (any(unclear &= s->live)) step_elsewhere(s, w, unclear, &from);
}

static __attribute__((noinline)) void step_near(Lanes *groups, Work *w) {
  for (int group = 0; group < w->groups; group++) if (any(groups[group].live)) come_near(&groups[group], w);
}

typedef struct { Lanes lanes[POOLS][GROUPS]; Work work; int begun; } Many;

int64_t many_size(void) { return sizeof(Many); }

static void begin_all(Many *many, const Batch *b, const Options *o, Tree *tree, const Core *core) {
  Work *w = &many->work;
  double q[NQ];
  w->b = b;
  w->o = o;
  w->core = core;
  w->words.tree = tree;
  w->size = o->atol / o->rtol;
  w->groups = b->count >= OFTEN * GROUPS * W ? GROUPS : 1 + (int)(b->count / (OFTEN * W));
  w->column = WORDS - (b->p_stride ? 0 : NQ);
  prepare(b->p, q);
  for (int pool = 0; pool < POOLS; pool++) {
    for (int group = 0; group < GROUPS; group++)
      for (int k = 0; k < NQ; k++) many->lanes[pool][group].q[k] = BC(q[k]);
  }
  many->begun = 1;
}

static void load_lanes(Lanes *s, Work *w) {
  I fresh = {0};
  for EACH(l, ~s->live) if (load(s, w, l)) LANE_I(fresh, l) = -1;
  if (any(fresh)) begin(s, w, fresh);
}

/* The mode whose lanes take a step: the last one of a run that has enough of them. */
static int chosen(const Work *w) {
  for (int pool = POOLS - 1; pool >= AWAY; pool--) if (w->alive[pool] + w->waiting[pool] >= w->groups * W) return pool;
  if (w->next < w->b->count) return AWAY;
  for (int pool = AWAY; pool < POOLS; pool++) if (w->alive[pool] + w->waiting[pool]) return pool;
  return -1;
}

/* Run a batch, ``budget`` steps of it at most; whether something is left for another call. ``many``
 * is zero before the first, and aligned like a vector. */
int run_many(Many *many, const Batch *b, const Options *o, Tree *tree, const Core *core, int64_t budget) {
  Work *w = &many->work;
  if (!many->begun) begin_all(many, b, o, tree, core);
  for (;;) {
    int pool = chosen(w);
    if (pool < 0) return 0;
    Lanes *s = many->lanes[pool];
    for (int group = 0; group < w->groups; group++) receive(&s[group], w, pool);
    w->pool = pool;
    if (pool == AWAY && w->alive[AWAY] < w->groups * W && w->next < b->count) {
      for (int group = 0; group < w->groups; group++) load_lanes(&s[group], w);
      continue;
    }
    if ((budget -= w->groups) < 0) return 1;
    if (pool == AWAY) step_off(s, w);
    else if (pool == ON) step_on(s, w);
    else if (pool == GOING) step_leaving(s, w);
    else step_near(s, w);
  }
}
