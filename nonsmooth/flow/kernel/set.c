/* Clear decisions at a set of codimension two or three, whose modes have pools of their own. */
#define LIMIT 1 /* friction's limit, among the guards on the set */
#define FALLEN 0.01 /* a step ends where |h| has fallen to this part, closer to rounding to FALL */
#define PASSED 1e-11 /* below this part of its terms h may cross zero: left to the driver */
#define TURNED 1e-7 /* accuracy of the direction in which a set is left */
#define THIRD 3 /* factor of the error estimate of the last part of the way */
#define LAST_WAY 0.1 /* its part of the tolerance, once for each arrival at a set */
#define SMALL 0.05 /* it is tried where |h| is a third of the cube root of the tolerance */
#define AT_LIMIT 10 /* at the end of rolling |lambda| is 1 to so many times the tolerance */
#define ROOM_TO_ROLL 1e-6 /* |lambda| is clearly below 1 */

static void send(Lanes *s, Work *w, I which, int to);

INLINE I has_second(const Lanes *s, int mode) { return NONE - (mode == ON); }
INLINE I is_bent(const Lanes *s, int mode) { return NONE - !AFFINE_MODES[mode]; }

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

/* Friction near the set: h' = |h| a - M h, where M is symmetric positive definite. M y = a gives the friction that cancels a;
 * |y| < 1 where the mode on the set is admissible. Exact where M is isotropic, with the mean diagonal c. */
typedef struct { T a[M], m[M * M], y[M], c; I definite, holds, exact; } Pull;

INLINE T inner(const T *u, const T *v) {
  T sum = BC(0);
  UNROLL for (int i = 0; i < M; i++) sum += u[i] * v[i];
  return sum;
}

OUTLINED void find_pull(const Lanes *s, Pull *p) {
  T most = BC(0), *m = p->m;
  frozen_values(OF(s), p->a, m);
  p->c = BC(0);
  UNROLL for (int i = 0; i < M * M; i++) most = MAX(most, ABS(m[i]));
  UNROLL for (int i = 0; i < M; i++) p->c += m[i * M + i] * (1.0 / M);
  p->definite = p->exact = most > 0;
  UNROLL for (int i = 0; i < M; i++)
    UNROLL for (int j = 0; j < M; j++) {
      T minor = i == j ? most * m[i * M + i] : m[i * M + i] * m[j * M + j] - m[i * M + j] * m[j * M + i];
      p->definite &= (I)(minor > 1e-13 * most * most) & (ABS(m[i * M + j] - m[j * M + i]) <= 1e-12 * most);
      p->exact &= ABS(m[i * M + j] - (i == j ? p->c : BC(0))) <= 1e-12 * p->c;
    }
#if M == 3
  T whole = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
  p->definite &= whole > 1e-13 * most * most * most;
#endif
  solve_block(m, p->a, p->y);
  p->holds = p->definite & (inner(p->y, p->y) < 1);
  p->exact &= p->holds;
}

/* 1 over the time in which h = 0 is reached: exact where a and M do not change and M is isotropic, rough otherwise. */
INLINE T nearness(const Pull *p, const T *h, T radius) {
  T rate[M];
  UNROLL for (int i = 0; i < M; i++) rate[i] = p->a[i] * radius - inner(p->m + i * M, h);
  T falls = MAX(-inner(h, rate), BC(0)), cubed = radius * (radius * radius);
  return SELECT(p->exact, p->c * p->c - inner(p->a, p->a), falls)
         / SELECT(p->exact, p->c * radius + inner(p->a, h), cubed);
}

/* The last part of the way to h = 0 where M is isotropic, to second order in its length.
 *
 * With dt = |h| ds states and h have the rates |h| f(x, 0) + B(x) h, and |h| has a.h - c |h|: linear in (h, |h|), with
 * slowly varying coefficients. Their integrals to h = 0 follow order by order from the frozen solution and its products;
 * derivatives along the way are differences. The error is of third order. */
typedef struct { T one[N], two[N], time, later; } Rest; /* by frozen a and M, what their change adds; times */

/* y of L y = (b, t) with L = (-c, a; a, -c). */
INLINE void solve_frozen(const Pull *p, const T *b, T *y) {
  y[M] = -(p->c * b[M] + inner(p->a, b)) / (p->c * p->c - inner(p->a, p->a));
  UNROLL for (int i = 0; i < M; i++) y[i] = (p->a[i] * y[M] - b[i]) / p->c;
}

/* Integrals of products of two components of the frozen solution (h, |h|), which decays at rates c and c -+ |a|. */
INLINE void frozen_products(const Pull *f, const T *h, T radius, T p[M + 1][M + 1]) {
  T c = f->c, size = length_of(f->a), u[M], across[M], along;
  UNROLL for (int i = 0; i < M; i++) u[i] = SELECT(size > 1e-100, f->a[i] / size, h[i] / radius);
  along = inner(u, h);
  UNROLL for (int i = 0; i < M; i++) across[i] = h[i] - along * u[i];
  T slow = 0.5 * (along + radius), fast = 0.5 * (along - radius); /* of (u, 1) and of (u, -1) */
  T ss = slow * slow / (2.0 * (c - size)), ff = fast * fast / (2.0 * (c + size)), sf = slow * fast / (2.0 * c);
  T s = slow / (2.0 * c - size), t = fast / (2.0 * c + size);
  UNROLL for (int i = 0; i < M; i++) {
    UNROLL for (int j = 0; j < M; j++)
      p[i][j] = u[i] * u[j] * (ss + ff + 2.0 * sf) + (u[i] * across[j] + across[i] * u[j]) * (s + t) + across[i] * across[j] / (2.0 * c);
    p[i][M] = p[M][i] = u[i] * (ss - ff) + across[i] * (s - t);
  }
  p[M][M] = ss + ff - 2.0 * sf;
}

/* Directions of the frozen solution, along h and across it, and that of |h|. They rotate and reflect with h and a, and so do
 * differences along them. */
INLINE void own_directions(const T *a, const T *h, T radius, T e[3][M + 1]) {
  T size = length_of(a);
  UNROLL for (int i = 0; i < M; i++) { e[0][i] = h[i] / radius; e[1][i] = a[i]; e[2][i] = e[0][M] = e[1][M] = BC(0); }
  for (int again = 0; again < 2; again++) {
    T along = inner(e[1], e[0]);
    UNROLL for (int i = 0; i < M; i++) e[1][i] -= along * e[0][i];
  }
  T across = length_of(e[1]);
  UNROLL for (int i = 0; i < M; i++) e[1][i] = SELECT(across > 1e-13 * size, e[1][i] / across, BC(0));
  e[2][M] = BC(1);
}

INLINE void second_order(const Lanes *s, const T *h, T radius, const Pull *p, Rest *rest) {
  T way[M + 1], q[M + 1][M + 1], e[3][M + 1], g[M + 1][N], full[M + 1], change[M + 1] = {BC(0)}, more[M + 1], back = -1.0 / radius;
  UNROLL for (int i = 0; i < M; i++) full[i] = -h[i];
  full[M] = -radius;
  solve_frozen(p, full, way);
  UNROLL for (int j = 0; j <= M; j++) {
    T unit[M + 1];
    UNROLL for (int i = 0; i <= M; i++) unit[i] = BC(i == j);
    flow_values(s->x, s->q, UNPACK(unit), unit[M], g[j]);
  }
  frozen_products(p, h, radius, q);
  UNROLL for (int n = 0; n < N; n++) {
    rest->one[n] = rest->two[n] = BC(0);
    UNROLL for (int j = 0; j <= M; j++) rest->one[n] += g[j][n] * way[j];
  }
  own_directions(p->a, h, radius, e);
  UNROLL for (int j = 0; j < 3; j++) { /* the change of all as the state moves along one direction */
    T y[M + 1], w[M + 1], x[N], f[N], a1[M], m1[M * M], c1 = BC(0), from = radius * e[j][M] + inner(h, e[j]);
    UNROLL for (int i = 0; i <= M; i++) {
      w[i] = -from * way[i];
      UNROLL for (int k = 0; k <= M; k++) w[i] += q[i][k] * e[j][k];
    }
    solve_frozen(p, e[j], y);
    UNROLL for (int n = 0; n < N; n++) {
      T direction = BC(0);
      UNROLL for (int i = 0; i <= M; i++) direction += y[i] * g[i][n];
      x[n] = s->x[n] - radius * direction;
    }
    flow_values(x, s->q, UNPACK(w), w[M], f);
    frozen_values(x, s->q, LAMBDA(s->lam), a1, m1);
    UNROLL for (int i = 0; i < M; i++) c1 += m1[i * M + i] * (1.0 / M);
    UNROLL for (int i = 0; i < M; i++) {
      a1[i] -= p->a[i];
      change[i] += (a1[i] * w[M] - (c1 - p->c) * w[i]) * back;
    }
    change[M] += (inner(a1, w) - (c1 - p->c) * w[M]) * back;
    UNROLL for (int n = 0; n < N; n++) {
      T before = BC(0);
      UNROLL for (int i = 0; i <= M; i++) before += w[i] * g[i][n];
      rest->two[n] += (f[n] - before) * back;
    }
  }
  solve_frozen(p, change, more);
  UNROLL for (int n = 0; n < N; n++)
    UNROLL for (int j = 0; j <= M; j++) rest->two[n] -= g[j][n] * more[j];
  rest->time = way[M];
  rest->later = -more[M];
}

/* Lanes near h = 0: move those that reach it now onto it; add those left to the driver to ``unclear``. */
OUTLINED I reach(Lanes *s, Work *w, I which, I *unclear) {
  const Options *o = limits(w);
  T h[M], g[M][N], u[M], b[M], mean[M], field[N], other[N], end[N];
  T scale = heights(s, h, g), radius = length_of(h), bend = BC(0);
  Pull p, later;
  find_pull(s, &p);
  I holds = p.holds, exact = p.exact;
  T dt = 1.0 / nearness(&p, h, radius);
  double shortest = pow(OVERFLOW, -1.0 / P);
  I floor = (radius <= VANISHES * scale) | (I)(dt < MAX(BC(shortest), TENFOLD * SHORTEST * ABS(s->t)));
  *unclear |= which & ((~holds & (floor | (I)(radius <= PASSED * scale))) | ~(I)(radius > 0));
  I reached = which & holds & (dt > 0) & (dt < INFINITY);
  *unclear |= which & floor & ~reached;
  UNROLL for (int i = 0; i < M; i++) { u[i] = h[i] / radius; b[i] = p.a[i] + h[i] / dt; }
  solve_block(p.m, b, mean);
  field_values(s->x, s->q, LAMBDA(mean), field);
  UNROLL for (int i = 0; i < N; i++) end[i] = s->x[i] + dt * field[i];
  frozen_values(end, s->q, LAMBDA(s->lam), later.a, later.m);
  UNROLL for (int i = 0; i < M; i++) bend += ABS(later.a[i] - p.a[i]);
  UNROLL for (int i = 0; i < M * M; i++) bend += ABS(later.m[i] - p.m[i]);
  bend *= dt;
  I close = bend <= REACHED * radius;
  if (any(which & exact)) {
    Rest rest;
    second_order(s, h, radius, &p, &rest);
    T part = THIRD * bend / radius, first = part * bend / radius; /* of the second order, and of the first */
    T late = part * ABS(rest.later) + first * rest.time;
    UNROLL for (int i = 0; i < N; i++) {
      T whole = i < ND ? LAST_WAY * (o->atol + o->rtol * ABS(s->x[i])) : BC(0);
      T third = MAX(part * ABS(rest.two[i]) + first * ABS(rest.one[i]), late * ABS(field[i]));
      close &= ~exact | (I)(third <= whole + EPSILON * (s->size + ABS(s->x[i])));
      end[i] = SELECT(exact, s->x[i] + (rest.one[i] + rest.two[i]), end[i]);
    }
    dt = SELECT(exact, rest.time + rest.later, dt);
  }
  if (any(which & ~exact)) {
    T turn[N];
    field_values(s->x, s->q, LAMBDA(u), other);
    UNROLL for (int i = 0; i < N; i++) turn[i] = ABS(field[i] - other[i]);
    field_values(end, s->q, LAMBDA(mean), other);
    UNROLL for (int i = 0; i < N; i++) {
      T whole = i < ND ? REACHED * SAFETY * (o->atol + o->rtol * ABS(s->x[i])) : BC(0);
      close &= exact | (I)((turn[i] + ABS(field[i] - other[i])) * dt <= whole + EPSILON * (s->size + ABS(s->x[i])));
    }
  }
  reached &= close | floor;
  *unclear |= reached & ((I)(dt > o->t_end - s->t) | (floor & ~(I)(bend <= radius)));
  if (!any(reached)) return reached;
  UNROLL for (int i = 0; i < N; i++) s->x[i] = SELECT(reached, end[i], s->x[i]);
  s->t = SELECT(reached, s->t + dt, s->t);
  s->since = SELECT(reached, s->since + dt, s->since);
  if (TIMED) s->x[N - 1] = s->t;
  s->steps -= reached;
  *unclear |= project(s, reached);
  find_pull(s, &later);
  *unclear |= reached & ~(later.definite & (length_of(later.y) < 1 - ROOM_TO_ROLL));
  return reached;
}

/* Lanes on the set at friction's limit leave it in the direction of friction; returns lanes that are not at the limit. */
INLINE I release(Lanes *s, const Work *w, I which) {
  Pull p;
  find_pull(s, &p);
  T size = length_of(p.y);
  UNROLL for (int i = 0; i < M; i++) s->lam[i] = SELECT(which, p.y[i] / size, s->lam[i]);
  return which & ~(p.definite & (ABS(size - 1) <= larger(1e-9, AT_LIMIT * limits(w)->rtol)));
}

/* Modes of lanes just loaded: off the set. Returns lanes that are on it, or without friction. */
INLINE I begin_modes(Lanes *s, I fresh) {
  T h[M], g[M][N], scale = heights(s, h, g);
  I unclear = ~(I)(length_of(h) > CLOSE * scale), moved = {0};
  for (int trial = 0; trial < 3; trial++) {
    T x[N], a[M], m[M * M];
    UNROLL for (int i = 0; i < N; i++) x[i] = s->x[i] + trial * (0.37 + 0.11 * i);
    frozen_values(x, s->q, LAMBDA(s->lam), a, m);
    UNROLL for (int i = 0; i < M * M; i++) moved |= m[i] != 0;
  }
  s->left_at = SELECT(fresh, BC(-INFINITY), s->left_at);
  s->behind &= ~fresh;
  return fresh & (unclear | ~moved);
}
INLINE I mode_of(const Lanes *s) { return NONE; } /* of these lanes */

/* Series --------------------------------------------------------------------------------------- */

OUTLINED void expand_series(const Lanes *s, Step *e, int mode) {
  T *c = &e->c[0][0], *g = &e->g[0][0];
  e->stretch = BC(0);
  if (mode == ON) on_jet(OF(s), c, g);
  if (mode == GOING) leave_jet(OF(s), c, g);
  if (mode != AWAY) return;
  T h[M], gradient[M][N];
  Pull p;
  surface_values(OF(s), h, &gradient[0][0]);
  find_pull(s, &p);
  T per = nearness(&p, h, length_of(h));
  e->stretch = SELECT(p.holds & (per >= 0), per, -1.0 / (s->t - s->left_at));
  off_jet(s->x, s->q, UNPACK(s->lam), e->stretch, c, g, e->ends, &e->radius);
}

INLINE T weighed(const T *gradient, const T *allowed) {
  T sum = BC(0);
  UNROLL for (int i = 0; i < ND; i++) sum += ABS(gradient[i]) * allowed[i];
  return sum;
}

INLINE void bound(T last_one, T before_one, T per, T *last, T *before) {
  *last = MAX(*last, ABS(last_one) * per);
  *before = MAX(*before, ABS(before_one) * per);
}

/* Ratios of the last two terms of the set's guards and of directions to their tolerances. */
INLINE void law_ratios(const Lanes *s, const Options *o, Step *e, int mode, T *last, T *before, T *sum) {
  T h[M], gradient[M][N], *g = e->g[0], *limit = e->g[LIMIT];
  surface_values(OF(s), h, &gradient[0][0]);
  e->level = BC(0);
  UNROLL for (int i = 0; i < M; i++) e->level += NAMED ? e->allowed[OWN_STATE[i]] : weighed(gradient[i], e->allowed);
  UNROLL for (int j = 0; j <= (mode == ON ? LIMIT : 0); j++) *sum += e->g[j][P] + e->g[j][P - 1] + e->g[j][0];
  e->turn[0] = e->turn[1] = BC(1e-300);
  UNROLL for (int i = 0; i < M && mode != ON; i++) {
    T one = mode == AWAY ? e->ends[2 * i + 1] : e->g[SLOTS + i][P], two = mode == AWAY ? e->ends[2 * i] : e->g[SLOTS + i][P - 1];
    *sum += one + two;
    if (mode == GOING) bound(one, two, BC(1), &e->turn[0], &e->turn[1]);
    else bound(SELECT(s->behind, one, BC(0)), SELECT(s->behind, two, BC(0)), BC(1.0 / (SAFETY * o->rtol)), last, before);
  }
  if (mode == GOING) bound(g[P - 2], g[P - 3], 1.0 / e->level, last, before);
  if (mode == AWAY) {
    bound(g[P], g[P - 1], e->radius * ROUGH_INVERSE(e->level + o->rtol * e->radius * ABS(g[0])), last, before);
    e->fall = SELECT(e->radius * (SAFETY * o->rtol) > LEFT * e->level, BC(FALLEN), BC(FALL));
    g[0] -= e->fall;
  }
  if (mode != ON) return;
  T value[M + 1], slope[M + 1][N], part[M + 1], all = BC(0), first = 1.0 / limit[0];
  slip_values(OF(s), value, &slope[0][0]);
  UNROLL for (int i = 0; i <= M; i++) part[i] = weighed(slope[i], e->allowed);
  UNROLL for (int i = 0; i < M; i++) {
    all += 2.0 * (ABS(value[i]) + ABS(value[M])) * (part[i] + part[M]);
    e->of_guards[SLOTS + i] = part[i] + (VANISHES / WRONG) * rounding_scale(s, slope[i]);
  }
  /* At the end of rolling the motion is smooth to second order: the time needs only the tolerance itself. */
  bound(g[P], g[P - 1], SAFETY * BEFORE_LAST(ON) * ROUGH_INVERSE(all + o->rtol * ABS(g[0]) + 1e-290), last, before);
  e->radius = limit[0];
  I moves = limit[0] != 0;
  UNROLL for (int k = 1; k <= P; k++) limit[k] = SELECT(moves, limit[k] * first, BC(0));
  limit[0] = BC(1 - LIMIT_FALL);
}

INLINE T size_of(T last, T before, int more);

/* At the end of a step away from the set h has to be known to the tolerance if the set is far, else its direction. */
INLINE T law_size(const Step *e, const Options *o, int mode, T h) {
  if (mode != GOING) return h;
  T rate = e->g[0][0], part = rate / e->level, per = BC(1.0 / (SAFETY * o->rtol));
  T far = MIN(size_of(e->turn[0] * (1 / TURNED), e->turn[1] * (1 / TURNED), 0), size_of(e->turn[0] * part, e->turn[1] * part, 2));
  far = SELECT((rate > 0) & (rate * far * far * (SAFETY * o->rtol) > LEFT * e->level), far, BC(0));
  return MIN(h, MAX(far, size_of(e->turn[0] * per, e->turn[1] * per, 0)));
}

/* The unit direction of slip as a step leaves the set; its length before normalisation. */
INLINE T direction_at(const Step *e, T at, int degree, T *u) {
  UNROLL for (int i = 0; i < M; i++) u[i] = values_at(e->g[SLOTS + i], degree, at, at * at);
  return length_of(u);
}

INLINE void check_series(const Lanes *s, const Step *e, int mode, const T *x, T at, int degree, T *f, T *guard) {
  if (mode == ON) on_check(x, s->q, LAMBDA(s->lam), f, guard);
  else off_check(x, s->q, LAMBDA(s->lam), f, guard);
  if (mode != GOING) return;
  T whole[N], u[M], length = direction_at(e, at, degree, u);
  UNROLL for (int i = 0; i < M; i++) u[i] /= length;
  field_values(x, s->q, LAMBDA(u), whole);
  UNROLL for (int m = 0; m < ROWS; m++) f[m] = whole[ROW[m]];
}

/* Events --------------------------------------------------------------------------------------- */

static Past *past_of(const Lanes *s, int l) { return &s->past[LANE_I(s->own, l)]; }

/* Change the mode of lanes; returns the lanes left to the driver, unchanged. */
INLINE I change_mode(Lanes *s, Work *w, I which, int kind, int guard, int mode) {
  I unclear = which & (s->events + 1 >= limits(w)->max_events);
  for EACH(l, which & ~unclear) {
    Past *p = past_of(s, (int)l);
    p->event[p->count++ % HISTORY] = (Recent){LANE(s->since, l), ((int64_t)kind << 40) + ((int64_t)guard << 32)};
    if (!may_accumulate(p)) continue;
    p->count--;
    LANE_I(unclear, l) = -1;
  }
  which &= ~unclear;
  count(s, w, kind, which);
  s->since = SELECT(which, BC(0), s->since);
  s->length = SELECT(which, BC(0), s->length);
  note_modes(s, w, which, NONE + mode);
  return unclear;
}

/* Times at which |nu| = |n|, from those at which their squares are equal to rounding. */
INLINE void polish_slip(Step *e) {
  I which = e->slot == 1;
  T root = e->dt;
  for (int again = 0; again < 2; again++) {
    T square = BC(0), along = BC(0), n = e->g[LIMIT][P], of_n = BC(0);
    UNROLL for (int i = 0; i < M; i++) {
      T v = e->g[SLOTS + i][P], d = BC(0);
      UNROLL for (int k = P - 1; k >= 0; k--) { d = d * root + v; v = v * root + e->g[SLOTS + i][k]; }
      square += v * v;
      along += v * d;
    }
    /* The series of the limit is divided by its first value. */
    UNROLL for (int k = P - 1; k >= 0; k--) { of_n = of_n * root + n; n = n * root + (k ? e->g[LIMIT][k] : BC(1)); }
    n *= e->radius;
    of_n *= e->radius;
    T size = SQRT_(square), sign = SELECT(n < 0, BC(-1), BC(1)), slope = sign * of_n - along / size;
    T next = MIN(MAX(root - (ABS(n) - size) / slope, BC(0)), e->h);
    root = SELECT((size > 0) & (slope < 0), next, root);
  }
  e->dt = SELECT(which & (ABS(root - e->dt) <= 1e-6 * e->dt), root, e->dt);
}

/* The end of a step: lanes that continue in the next pool are ``gone``. Returns undecided lanes. */
OUTLINED I land(Lanes *s, Work *w, Step *e, int mode, I live) {
  T h[M], g[M][N], u[M];
  I unclear = {0}, reached = live & (e->slot == 1), goes_on = live & (e->slot == 0) & ~e->last;
  if (mode == AWAY) {
    T scale = heights(s, h, g), radius = length_of(h);
    if (any(s->behind)) s->behind &= radius <= LEFT * scale;
    I small = (radius <= CLOSE * scale) | ((e->stretch > 0) & (radius * radius * radius <= SMALL * limits(w)->rtol * scale * scale * scale));
    e->gone = reached | (goes_on & small);
    s->fell = reached;
  } else if (mode == ON) {
    unclear |= project(s, s->live);
    e->gone = reached & ~unclear;
    if (!any(e->gone)) return unclear;
    unclear |= e->gone & ~(I)(e->slope < -1e-10 * e->g[0][0]);
    unclear |= release(s, w, e->gone);
    unclear |= change_mode(s, w, e->gone & ~unclear, EXIT, SLIP_GUARD, 0);
    s->left_at = SELECT(e->gone & ~unclear, s->t, s->left_at);
  } else {
    unclear |= reached | (live & ~(I)(e->g[0][0] > 0));
    e->gone = goes_on;
    T distance = values_at(e->g[0], P, e->dt, e->dt * e->dt) * e->dt * e->dt;
    direction_at(e, e->dt, P, u);
    if (NAMED) UNROLL for (int i = 0; i < M; i++) s->x[OWN_STATE[i]] = SELECT(s->live, distance * u[i], s->x[OWN_STATE[i]]);
    s->behind = distance <= LEFT * heights(s, h, g);
    if (!NAMED) unclear |= e->gone & s->behind;
    s->length = BC(0);
  }
  return unclear;
}

INLINE void keep_mode(Lanes *s, Step *e) { e->behind = s->behind; }
INLINE void undo_mode(Lanes *s, const Step *e, I which) { s->behind = (s->behind & ~which) | (e->behind & which); }

static void write_mode(const Lanes *s, int l, Suspended *m) {
  int pool = s->pool, behind = pool == AWAY && LANE_I(s->behind, l);
  T h[M], g[M][N];
  if (behind) heights(s, h, g);
  for (int i = 0; i < M; i++) {
    m->letter[i] = pool == ON ? 0 : pool == GOING ? LEAVING : behind ? LEFT_BEHIND : OFF;
    m->unknowns[i] = pool == GOING ? LANE(s->lam[i], l) : behind ? LANE(h[i], l) : 0;
  }
  m->drop = pool == GOING ? 2 : 0;
  m->near = pool != NEAR_SET ? 0 : LANE_I(s->fell, l) ? 2 : 1;
}

/* Returns the pool of the mode. */
static int read_mode(Lanes *s, int l, const Suspended *m) {
  LANE(s->left_at, l) = m->letter[0] && m->events ? m->t - m->since : -INFINITY;
  LANE_I(s->behind, l) = 0;
  return m->letter[0] ? AWAY : ON;
}
