/* A mode, by its number among the system's, follows. */
static void note_mode(Lanes *s, Work *w, I which, int mode) {
  s->code = SELECT_I(which, (s->code << 2) + (mode + 1), s->code);
  s->entered = SELECT_I(which, s->steps, s->entered);
  for EACH(l, s->code >= LONG_CODE) {
    LANE_I(s->base, l) = walk(w->words.tree, (int32_t)LANE_I(s->base, l), LANE_I(s->code, l));
    LANE_I(s->code, l) = 0;
  }
}

/* Loading, storing, moving on --------------------------------------------------------------------- */

/* A lane is free. */
static void leave(Lanes *s, Work *w, int pool, int l) {
  LANE_I(s->live, l) = 0;
  w->alive[pool]--;
  w->spare[w->spares++] = (int)LANE_I(s->own, l);
}

static void finish_lanes(Lanes *s, Work *w, int pool, I which, int status) {
  for EACH(l, which & s->live) {
    keep_end(s, w, (int)l, status);
    leave(s, w, pool, (int)l);
  }
}

/* Put the next start into a lane; 0 if there is none. */
static int load(Lanes *s, Work *w, int l) {
  const Batch *b = w->b;
  while (w->next < b->count && !finite_all(b->x0 + w->next * N, N)) refuse(b, w->next++);
  if (w->next >= b->count) return 0;
  int64_t i = w->next++;
  for (int j = 0; j < w->column; j++) LANE_I(((I *)s)[j], l) = 0;
  for (int k = 0; k < N; k++) LANE(s->x[k], l) = b->x0[i * N + k];
  if (b->p_stride) {
    double q[NQ];
    prepare(b->p + i * b->p_stride, q);
    for (int k = 0; k < NQ; k++) LANE(s->q[k], l) = q[k];
  }
  LANE(s->t, l) = b->t0;
  LANE(s->left_at, l) = -INFINITY;
  int own = w->spares ? w->spare[--w->spares] : w->begun++;
  LANE_I(s->own, l) = own;
  w->past[own].count = w->past[own].steps = 0;
  w->past[own].shortened = 0;
  LANE_I(s->live, l) = -1;
  LANE_I(s->index, l) = i;
  w->alive[AWAY]++;
  return 1;
}

/* The lanes ``which`` leave this pool for those that wait for another. */
static void send(Lanes *s, Work *w, int pool, I which, int to) {
  for EACH(l, which & s->live) {
    Traveller *one = &w->queue[to][w->waiting[to]++];
    for (int j = 0; j < w->column; j++) one->word[j] = LANE_I(((I *)s)[j], l);
    LANE_I(s->live, l) = 0;
    w->alive[pool]--;
  }
}

static void receive(Lanes *s, Work *w, int pool) {
  for EACH(l, ~s->live) {
    if (!w->waiting[pool]) return;
    const Traveller *one = &w->queue[pool][--w->waiting[pool]];
    for (int j = 0; j < w->column; j++) LANE_I(((I *)s)[j], l) = one->word[j];
    w->alive[pool]++;
  }
}

static Past *past_of(const Lanes *s, Work *w, int l) { return &w->past[LANE_I(s->own, l)]; }

/* The set -------------------------------------------------------------------------------------- */

INLINE T length_of(const T *h) {
  T sum = BC(0);
  UNROLL for (int i = 0; i < K; i++) sum += h[i] * h[i];
  return SQRT_(sum);
}

/* sum of |gradient| (size + |x|), of those that are there: rounding in a function is that times epsilon. */
INLINE T rounding_scale(const Lanes *s, const Work *w, const T *gradient, const char *there) {
  T scale = BC(0);
  UNROLL for (int i = 0; i < N; i++) if (there[i]) scale += ABS(gradient[i]) * (w->size + ABS(s->x[i]));
  return scale;
}

/* h and the scale of its rounding. */
INLINE T heights(const Lanes *s, const Work *w, T *h, T gradient[K][N]) {
  T scale = BC(0);
  height_values(s->x, s->q, LAMBDA(s->lam), h, &gradient[0][0]);
  UNROLL for (int i = 0; i < K; i++) scale = MAX(scale, rounding_scale(s, w, gradient[i], HEIGHT_SLOPES[i]));
  return scale;
}

/* y of M y = b, from cofactors. */
INLINE void solve_block(const T *m, const T *b, T *y) {
#if K == 2
  T per = 1.0 / (m[0] * m[3] - m[1] * m[2]);
  y[0] = (m[3] * b[0] - m[1] * b[1]) * per;
  y[1] = (m[0] * b[1] - m[2] * b[0]) * per;
#else
  T c[3];
  UNROLL for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    c[i] = m[3 + j] * m[6 + k] - m[3 + k] * m[6 + j];
  }
  T per = 1.0 / (m[0] * c[0] + m[1] * c[1] + m[2] * c[2]);
  UNROLL for (int i = 0; i < 3; i++) {
    T d[3];
    int p = (i + 1) % 3, q = (i + 2) % 3;
    UNROLL for (int j = 0; j < 3; j++) {
      int u = (j + 1) % 3, v = (j + 2) % 3;
      d[j] = m[3 * u + p] * m[3 * v + q] - m[3 * u + q] * m[3 * v + p];
    }
    y[i] = (d[0] * b[0] + d[1] * b[1] + d[2] * b[2]) * per;
  }
#endif
}

/* Whether M is symmetric and positive definite, and isotropic, with its mean diagonal. */
INLINE I is_definite(const T *m, I *isotropic, T *mean) {
  T most = BC(0), c = BC(0);
  UNROLL for (int i = 0; i < K * K; i++) most = MAX(most, ABS(m[i]));
  UNROLL for (int i = 0; i < K; i++) c += m[i * K + i] * (1.0 / K);
  I definite = most > 0;
  *isotropic = definite;
  UNROLL for (int i = 0; i < K; i++) {
    definite &= m[i * K + i] > 1e-13 * most;
    UNROLL for (int j = 0; j < K; j++) {
      definite &= ABS(m[i * K + j] - m[j * K + i]) <= 1e-12 * most;
      *isotropic &= ABS(m[i * K + j] - (i == j ? c : BC(0))) <= 1e-12 * c;
    }
  }
  UNROLL for (int i = 0; i < K; i++)
    UNROLL for (int j = 0; j < i; j++)
      definite &= m[i * K + i] * m[j * K + j] - m[i * K + j] * m[j * K + i] > 1e-13 * most * most;
#if K == 3
  T whole = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
  definite &= whole > 1e-13 * most * most * most;
#endif
  *mean = c;
  return definite;
}

/* The time in which h = 0 is reached, exact where a and M do not change and M is isotropic; infinite where |h| does
 * not fall. */
INLINE T time_left(const T *a, const T *m, const T *h, T radius, I exact, T c) {
  T along = BC(0), square = BC(0), rate = BC(0);
  UNROLL for (int i = 0; i < K; i++) {
    T own = a[i] * radius;
    UNROLL for (int j = 0; j < K; j++) own -= m[i * K + j] * h[j];
    rate += h[i] * own;
    along += a[i] * h[i];
    square += a[i] * a[i];
  }
  T straight = SELECT(rate < 0, -(radius * radius) * (radius / rate), BC(INFINITY));
  return SELECT(exact, (c * radius + along) / (c * c - square), straight);
}

/* What remains of the way to h = 0 where M is isotropic, to second order in its length.
 *
 * With dt = |h| ds states and h have the rates |h| f(x, 0) + B(x) h, |h| has a.h - c |h|: linear in (h, |h|), with
 * coefficients that change by as much as the states. Their integrals to h = 0 follow order by order from the frozen
 * solution and its products; derivatives along the way are differences. What is left out is of third order. */
typedef struct { T one[N], two[N], time, later; } Rest; /* by frozen a and M, what their change adds; times */

/* y of L y = (b, t) with L = (-c, a; a, -c). */
INLINE void solve_frozen(const T *a, T c, T per, const T *b, T *y) {
  T along = c * b[K];
  UNROLL for (int i = 0; i < K; i++) along += a[i] * b[i];
  y[K] = -along * per;
  UNROLL for (int i = 0; i < K; i++) y[i] = (a[i] * y[K] - b[i]) / c;
}

/* Integrals of products of two components of the frozen solution (h, |h|), which decays at rates c and c -+ |a|. */
INLINE void frozen_products(const T *a, T c, const T *h, T radius, T p[K + 1][K + 1]) {
  T size = length_of(a), u[K], across[K], along = BC(0);
  UNROLL for (int i = 0; i < K; i++) {
    u[i] = SELECT(size > 1e-100, a[i] / size, h[i] / radius);
    along += u[i] * h[i];
  }
  UNROLL for (int i = 0; i < K; i++) across[i] = h[i] - along * u[i];
  T slow = 0.5 * (along + radius), fast = 0.5 * (along - radius); /* of (u, 1) and of (u, -1) */
  T ss = slow * slow / (2.0 * (c - size)), ff = fast * fast / (2.0 * (c + size)), sf = slow * fast / (2.0 * c);
  T s = slow / (2.0 * c - size), f = fast / (2.0 * c + size);
  UNROLL for (int i = 0; i < K; i++) {
    UNROLL for (int j = 0; j < K; j++)
      p[i][j] = u[i] * u[j] * (ss + ff + 2.0 * sf) + (u[i] * across[j] + across[i] * u[j]) * (s + f) + across[i] * across[j] / (2.0 * c);
    p[i][K] = p[K][i] = u[i] * (ss - ff) + across[i] * (s - f);
  }
  p[K][K] = ss + ff - 2.0 * sf;
}

/* Directions along h and across it in which the frozen solution stays, and that of |h|. As they turn and mirror with
 * h and a, so do differences along them. */
INLINE void own_directions(const T *a, const T *h, T radius, T e[3][K + 1]) {
  T size = length_of(a);
  UNROLL for (int i = 0; i < K; i++) { e[0][i] = h[i] / radius; e[1][i] = a[i]; e[2][i] = e[0][K] = e[1][K] = BC(0); }
  for (int again = 0; again < 2; again++) {
    T along = BC(0);
    UNROLL for (int i = 0; i < K; i++) along += e[1][i] * e[0][i];
    UNROLL for (int i = 0; i < K; i++) e[1][i] -= along * e[0][i];
  }
  T across = length_of(e[1]);
  UNROLL for (int i = 0; i < K; i++) e[1][i] = SELECT(across > 1e-13 * size, e[1][i] / across, BC(0));
  e[2][K] = BC(1);
}

INLINE void second_order(const Lanes *s, const T *h, T radius, const T *a, T c, Rest *rest) {
  T way[K + 1], p[K + 1][K + 1], e[3][K + 1], g[K + 1][N], square = BC(0), along = c * radius, change[K + 1] = {BC(0)}, more[K + 1];
  UNROLL for (int i = 0; i < K; i++) { square += a[i] * a[i]; along += a[i] * h[i]; }
  T per = 1.0 / (c * c - square), back = -1.0 / radius;
  way[K] = along * per;
  UNROLL for (int i = 0; i < K; i++) way[i] = (h[i] + a[i] * way[K]) / c;
  UNROLL for (int j = 0; j <= K; j++) {
    T unit[K + 1];
    UNROLL for (int i = 0; i <= K; i++) unit[i] = BC(i == j);
    flow_values(s->x, s->q, UNPACK(unit), unit[K], g[j]);
  }
  frozen_products(a, c, h, radius, p);
  UNROLL for (int n = 0; n < N; n++) {
    rest->one[n] = rest->two[n] = BC(0);
    UNROLL for (int j = 0; j <= K; j++) rest->one[n] += g[j][n] * way[j];
  }
  own_directions(a, h, radius, e);
  UNROLL for (int j = 0; j < 3; j++) { /* the change of all as the state moves along one direction */
    T y[K + 1], w[K + 1], x[N], f[N], a1[K], m1[K * K], c1 = BC(0), turned = BC(0), from = radius * e[j][K];
    UNROLL for (int i = 0; i < K; i++) from += h[i] * e[j][i];
    UNROLL for (int i = 0; i <= K; i++) {
      w[i] = -from * way[i];
      UNROLL for (int k = 0; k <= K; k++) w[i] += p[i][k] * e[j][k];
    }
    solve_frozen(a, c, per, e[j], y);
    UNROLL for (int n = 0; n < N; n++) {
      T direction = BC(0);
      UNROLL for (int i = 0; i <= K; i++) direction += y[i] * g[i][n];
      x[n] = s->x[n] - radius * direction;
    }
    flow_values(x, s->q, UNPACK(w), w[K], f);
    frozen_values(x, s->q, LAMBDA(s->lam), a1, m1);
    UNROLL for (int i = 0; i < K; i++) c1 += m1[i * K + i] * (1.0 / K);
    UNROLL for (int i = 0; i < K; i++) {
      change[i] += ((a1[i] - a[i]) * w[K] - (c1 - c) * w[i]) * back;
      turned += (a1[i] - a[i]) * w[i];
    }
    change[K] += (turned - (c1 - c) * w[K]) * back;
    UNROLL for (int n = 0; n < N; n++) {
      T before = BC(0);
      UNROLL for (int i = 0; i <= K; i++) before += w[i] * g[i][n];
      rest->two[n] += (f[n] - before) * back;
    }
  }
  solve_frozen(a, c, per, change, more);
  UNROLL for (int n = 0; n < N; n++)
    UNROLL for (int j = 0; j <= K; j++) rest->two[n] -= g[j][n] * more[j];
  rest->time = way[K];
  rest->later = -more[K];
}

/* Newton steps of the states onto h = 0; lanes that they do not lead there. */
INLINE I project(Lanes *s, const Work *w, I which) {
  T h[K], g[K][N];
  for (int again = 0; again < (NAMED ? 1 : 3); again++) {
    T m[K * K], y[K];
    height_values(s->x, s->q, LAMBDA(s->lam), h, &g[0][0]);
    UNROLL for (int i = 0; i < K; i++)
      UNROLL for (int j = 0; j < K; j++) {
        m[i * K + j] = BC(0);
        UNROLL for (int n = 0; n < ND; n++) m[i * K + j] += g[i][n] * g[j][n];
      }
    solve_block(m, h, y);
    UNROLL for (int n = 0; n < ND; n++) {
      T step = BC(0);
      UNROLL for (int i = 0; i < K; i++) step += y[i] * g[i][n];
      s->x[n] = SELECT(which, s->x[n] - step, s->x[n]);
    }
  }
  if (NAMED) return (I){0};
  T scale = heights(s, w, h, g);
  return which & ~(I)(length_of(h) <= VANISHES * scale);
}

/* Events --------------------------------------------------------------------------------------- */

static void write_mode(const Lanes *s, Work *w, int l, Suspended *m) {
  int pool = w->pool, behind = pool == AWAY && LANE_I(s->behind, l);
  T h[K], g[K][N];
  if (behind) heights(s, w, h, g);
  for (int i = 0; i < K; i++) {
    m->letter[i] = pool == ON ? 0 : pool == GOING ? LEAVING : behind ? LEFT_BEHIND : OFF;
    m->unknowns[i] = pool == GOING ? LANE(s->lam[i], l) : behind ? LANE(h[i], l) : 0;
  }
  m->drop = pool == GOING ? 2 : 0;
  m->near = pool != NEAR_SET ? 0 : LANE_I(s->fell, l) ? 2 : 1;
}

static void read_mode(Lanes *s, Work *w, int l, const Suspended *m) {
  w->landed = m->letter[0] ? AWAY : ON;
  LANE(s->left_at, l) = m->letter[0] && m->events ? m->t - m->since : -INFINITY;
  LANE_I(s->behind, l) = 0;
}

/* What a step may have changed in lanes where it is not clear. */
typedef struct { T x[N], t, since, length; I behind, steps, above_stop[STOPS + 1]; } Start;

INLINE void keep_start(const Lanes *s, Start *a) {
  UNROLL for (int i = 0; i < N; i++) a->x[i] = s->x[i];
  UNROLL for (int j = 0; j < STOPS; j++) a->above_stop[j] = s->above_stop[j];
  a->t = s->t;
  a->since = s->since;
  a->length = s->length;
  a->behind = s->behind;
  a->steps = s->steps;
}

static void go_elsewhere(Lanes *s, Work *w, I which, int begun) {
  for EACH(l, which & s->live) {
    I one = {0};
    LANE_I(one, l) = -1;
    if (!driven(s, w, (int)l, begun)) leave(s, w, w->pool, (int)l);
    else if (w->landed != w->pool) send(s, w, w->pool, one, w->landed);
  }
}

static __attribute__((noinline)) void step_elsewhere(Lanes *s, Work *w, I which, const Start *from) {
  for (int i = 0; i < N; i++) s->x[i] = SELECT(which, from->x[i], s->x[i]);
  s->t = SELECT(which, from->t, s->t);
  s->since = SELECT(which, from->since, s->since);
  s->length = SELECT(which, from->length, s->length);
  s->behind = SELECT_I(which, from->behind, s->behind);
  s->steps = SELECT_I(which, from->steps, s->steps);
  for (int j = 0; j < STOPS; j++) s->above_stop[j] = SELECT_I(which, from->above_stop[j], s->above_stop[j]);
  go_elsewhere(s, w, which, 1);
}

/* Whatever changes its mode: the lanes that are left to the driver, unchanged. */
INLINE I change_mode(Lanes *s, Work *w, I which, int kind, int guard, int mode) {
  I unclear = which & (s->events + 1 >= w->o->max_events);
  for EACH(l, which & ~unclear) {
    Past *p = past_of(s, w, (int)l);
    p->event[p->count++ % HISTORY] = (Recent){LANE(s->since, l), ((int64_t)kind << 40) + ((int64_t)guard << 32)};
    if (!may_accumulate(p)) continue;
    p->count--;
    LANE_I(unclear, l) = -1;
  }
  which &= ~unclear;
  count(s, w, kind, which);
  s->since = SELECT(which, BC(0), s->since);
  s->length = SELECT(which, BC(0), s->length);
  note_mode(s, w, which, mode);
  return unclear;
}

/* Lanes near h = 0: those that reach it now are put there; those left to the interpreter are added to
 * ``unclear``. */
static __attribute__((noinline)) I reach(Lanes *s, Work *w, I which, I *unclear) {
  T h[K], g[K][N], a[K], m[K * K], u[K], y[K], b[K], mean[K], c, field[N], other[N], end[N];
  T scale = heights(s, w, h, g), radius = length_of(h);
  frozen_values(s->x, s->q, LAMBDA(s->lam), a, m);
  I isotropic, holds = is_definite(m, &isotropic, &c);
  solve_block(m, a, y);
  holds &= length_of(y) < 1;
  UNROLL for (int i = 0; i < K; i++) u[i] = h[i] / radius;
  T dt = time_left(a, m, h, radius, holds & isotropic, c), since = s->t - w->b->t0, left = w->o->t_end - s->t;
  double shortest = pow(OVERFLOW, -1.0 / P);
  I floor = (radius <= VANISHES * scale) | (I)(dt < MAX(BC(shortest), TENFOLD * SHORTEST * MAX(ABS(s->t), ABS(since))));
  *unclear |= which & ((~holds & (floor | (I)(radius <= PASSED * scale))) | ~(I)(radius > 0));
  I met = which & holds & (dt > 0) & (dt < INFINITY);
  *unclear |= which & floor & ~met;
  UNROLL for (int i = 0; i < K; i++) b[i] = a[i] + h[i] / dt;
  solve_block(m, b, mean);
  field_values(s->x, s->q, LAMBDA(mean), field);
  UNROLL for (int i = 0; i < N; i++) end[i] = s->x[i] + dt * field[i];
  T later[K], than[K * K], bend = BC(0), turn[N];
  frozen_values(end, s->q, LAMBDA(s->lam), later, than);
  UNROLL for (int i = 0; i < K; i++) bend += ABS(later[i] - a[i]);
  UNROLL for (int i = 0; i < K * K; i++) bend += ABS(than[i] - m[i]);
  bend *= dt;
  I close = bend <= REACHED * radius, exact = holds & isotropic;
  if (any(which & exact)) {
    Rest rest;
    second_order(s, h, radius, a, c, &rest);
    T part = THIRD * bend / radius, first = part * bend / radius; /* of the second order, and of the first */
    T late = part * ABS(rest.later) + first * rest.time;
    UNROLL for (int i = 0; i < N; i++) {
      T whole = i < ND ? LAST_WAY * (w->o->atol + w->o->rtol * ABS(s->x[i])) : BC(0);
      T third = MAX(part * ABS(rest.two[i]) + first * ABS(rest.one[i]), late * ABS(field[i]));
      close &= ~exact | (I)(third <= whole + EPSILON * (w->size + ABS(s->x[i])));
      end[i] = SELECT(exact, s->x[i] + (rest.one[i] + rest.two[i]), end[i]);
    }
    dt = SELECT(exact, rest.time + rest.later, dt);
  }
  if (any(which & ~exact)) {
    field_values(s->x, s->q, LAMBDA(u), other);
    UNROLL for (int i = 0; i < N; i++) turn[i] = ABS(field[i] - other[i]);
    field_values(end, s->q, LAMBDA(mean), other);
    UNROLL for (int i = 0; i < N; i++) {
      T allowed = EPSILON * (w->size + ABS(s->x[i]));
      T whole = i < ND ? SAFETY * (w->o->atol + w->o->rtol * ABS(s->x[i])) : BC(0);
      close &= exact | (I)((turn[i] + ABS(field[i] - other[i])) * dt <= allowed + REACHED * whole);
    }
  }
  met &= close | floor;
  *unclear |= met & ((I)(dt > left) | (floor & ~(I)(bend <= radius)));
  UNROLL for (int i = 0; i < N; i++) s->x[i] = SELECT(met, end[i], s->x[i]);
  s->t = SELECT(met, s->t + dt, s->t);
  s->since = SELECT(met, s->since + dt, s->since);
  if (TIMED) s->x[N - 1] = s->t;
  s->steps -= met;
  if (!any(met)) return met;
  *unclear |= project(s, w, met);
  frozen_values(s->x, s->q, LAMBDA(s->lam), a, m);
  holds = is_definite(m, &isotropic, &c);
  solve_block(m, a, y);
  *unclear |= met & ~(holds & (length_of(y) < 1 - ROOM_TO_ROLL));
  return met;
}

/* Lanes on the set at the end of friction's range: they leave it in the direction of friction. */
INLINE I release(Lanes *s, const Work *w, I which) {
  T a[K], m[K * K], y[K], c;
  I isotropic;
  frozen_values(s->x, s->q, LAMBDA(s->lam), a, m);
  I good = is_definite(m, &isotropic, &c);
  solve_block(m, a, y);
  T size = length_of(y);
  good &= ABS(size - 1) <= larger(1e-9, AT_LIMIT * w->o->rtol);
  UNROLL for (int i = 0; i < K; i++) s->lam[i] = SELECT(which, y[i] / size, s->lam[i]);
  return which & ~good;
}

/* Modes of lanes just loaded: all are off the set. */
static void begin(Lanes *s, Work *w, I fresh) {
  T h[K], g[K][N], x[N], a[K], m[K * K];
  T scale = heights(s, w, h, g);
  I unclear = ~(I)(length_of(h) > CLOSE * scale), moved = {0};
  for (int trial = 0; trial < 3; trial++) {
    UNROLL for (int i = 0; i < N; i++) x[i] = s->x[i] + trial * (0.37 + 0.11 * i);
    frozen_values(x, s->q, LAMBDA(s->lam), a, m);
    UNROLL for (int i = 0; i < K * K; i++) moved |= m[i] != 0;
  }
  unclear |= ~moved; /* no friction */
#if STOPS > 0
  T stop[STOPS], gradient[STOPS][N];
  stop_values(s->x, s->q, LAMBDA(s->lam), stop, &gradient[0][0]);
  for (int j = 0; j < STOPS; j++) {
    unclear |= ABS(stop[j]) <= VANISHES * rounding_scale(s, w, gradient[j], STOP_SLOPES[j]);
    s->above_stop[j] = SELECT_I(fresh, (I)(stop[j] > 0), s->above_stop[j]);
  }
#endif
  note_mode(s, w, fresh & ~unclear, 0);
  go_elsewhere(s, w, fresh & unclear, 0);
}
