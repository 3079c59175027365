/* Numbers: nonsmooth/flow/reference/stepper.py ------------------------------------------------------- */

static double bound(double last, double before, int order) {
  double h = INFINITY;
  if (last > 0) h = pow(last, -1.0 / order);
  if (before > 0) h = smaller(pow(before, -1.0 / (order - 1)), h);
  return h;
}

/* Shorten a step until a guard's series converges within it. */
static double resolve(const double *g, int order, double h) {
  while (h < INFINITY) {
    double power = 1;
    for (int k = 1; k < order; k++) power *= h;
    double last = larger(fabs(g[order]) * h, fabs(g[order - 1])) * power;
    double rest = RESOLVED * (fabs(g[0]) + rest_of(g, order - 2, h));
    if (last <= rest || !(rest > 0 && rest < INFINITY)) break;
    h *= 0.99 * pow(rest / last, 1.0 / (order - 1));
  }
  return h;
}

static double step_size(const Run *r, const Expansion *e) {
  int order = r->order, stride = r->stride;
  double last = 0, before = 0;
  for (int i = 0; i < r->s->dimension; i++) {
    const double *c = e->states + (int64_t)i * stride;
    last = larger(fabs(c[order]) / e->allowed[i], last);
    before = larger(fabs(c[order - 1]) / e->allowed[i], before);
  }
  for (int j = 0; j < e->l.rows; j++) {
    const double *g = e->guards + (int64_t)j * stride;
    double a = e->of_guards[j] + r->o.rtol * fabs(g[0]);
    if (!(a > 0)) continue;
    last = larger(fabs(g[order]) / a, last);
    before = larger(fabs(g[order - 1]) / a, before);
  }
  double h = bound(last, before, order);
  for (int j = 0; j < e->l.rows; j++) {
    const double *g = e->guards + (int64_t)j * stride;
    double a = e->of_guards[j] + r->o.rtol * fabs(g[0]);
    if (!(a > 0) || a > RESOLVED * fabs(g[0])) h = resolve(g, order, h);
  }
  return h;
}

/* A length beyond which the step h that the series allows may not see what comes. */
static double safe_length(const Run *r, const Expansion *e, double h) {
  if (r->s->linear) return INFINITY;
  if (e->l.mode == r->length_mode) return h > GROWTH * r->length ? r->length : INFINITY;
  double natural = INFINITY;
  for (int i = 0; i < r->n; i++) {
    const double *c = e->states + (int64_t)i * r->stride;
    natural = smaller((fabs(c[0]) + r->size) / fabs(c[1]), natural);
  }
  return h > FAR * natural ? FIRST * natural : INFINITY;
}

/* Field (n), errors of the multipliers that slide, and guards at a state and multipliers. */
static void sampled(Run *r, const Expansion *e, const double *x, const double *lam, double *found) {
  int n = r->n, w = r->width, stride = r->stride, slides = e->l.slides;
  set_inputs(r, x, held_of(r, e->l.letter), lam);
  advance_series(r, &e->l, 0);
  for (int i = 0; i < n; i++) *found++ = row_of(r, i)[0];
  for (int i = 0; i < slides; i++, found++) {
    *found = 0;
    for (int j = 0; j < slides; j++) {
      double a = fabs(e->inverse[i * slides + j]);
      if (a != 0) *found += a * fabs(row_of(r, n + e->l.sliding[j])[0]);
    }
  }
  double *g = r->work, *now = g + (int64_t)e->l.rows * stride;
  for (int i = 0; i < w; i++) now[(int64_t)i * stride] = lam[i];
  guard_rows(r, &e->l, now, 1, g);
  for (int j = 0; j < e->l.rows - e->l.branches; j++) *found++ = g[(int64_t)j * stride];
}

/* Whether field and guards at a time of the step are those of the polynomials. */
static int agrees(Run *r, const Expansion *e, double time, double dt) {
  int n = r->n, w = r->width, order = r->order, stride = r->stride, slides = e->l.slides;
  int guards = e->l.rows - e->l.branches, all = n + slides + guards;
  double *x = r->vector, *lam = x + n, *slope = lam + w, ignored;
  double *found = r->sample, *noise = found + all, *moved = noise + all;
  for (int i = 0; i < n; i++) x[i] = horner(e->states + (int64_t)i * stride, order, time, &slope[i]);
  for (int i = 0; i < w; i++) lam[i] = horner(e->series + (int64_t)i * stride, order, time, &ignored);
  sampled(r, e, x, lam, found);
  memset(noise, 0, sizeof(double) * all);
  for (int again = 0; again < 2; again++) {
    int near = 1;
    for (int i = 0; near && i < n; i++)
      near = fabs(found[i] - slope[i]) * dt
             <= WRONG * e->allowed[i] + dt * (VANISHES * fabs(slope[i]) + noise[i]);
    for (int i = n; near && i < n + slides; i++)
      near = found[i] <= WRONG * SAFETY * r->o.rtol + VANISHES + noise[i];
    for (int j = 0; near && j < guards; j++) {
      const double *c = e->guards + (int64_t)j * stride;
      double of_guard = e->of_guards[j] + SAFETY * r->o.rtol * fabs(c[0]);
      double miss = fabs(found[n + slides + j] - horner(c, order, time, &ignored));
      near = miss <= WRONG * of_guard + VANISHES * e->scale[j] + noise[n + slides + j];
    }
    if (near) return 1;
    /* What rounding in the states, and in the time, makes of it: far from zero more than a tolerance. */
    for (int k = 0; k < n && !again; k++) {
      double kept = x[k];
      if (kept == 0) continue;
      x[k] += VANISHES * kept;
      sampled(r, e, x, lam, moved);
      x[k] = kept;
      for (int i = 0; i < all; i++) noise[i] += fabs(moved[i] - found[i]);
    }
  }
  return 0;
}

/* dt where the polynomials agree at the part ``end`` of a step and at points inside, else half of the
 * first point where they do not. */
static double verified(Run *r, const Expansion *e, double dt, double end, double safe) {
  double low = isinf(safe) ? dt : 0.5 * dt;
  if (r->s->linear) return dt;
  while (low > safe) low *= 0.5;
  for (; low < dt; low *= 2)
    for (int k = 0; k < OCTAVE; k++) {
      double s = low * (1 + (double)k / OCTAVE);
      if (!agrees(r, e, s, dt)) return s > TINY ? 0.5 * s : 0;
    }
  for (int k = 1; k <= CHECKS; k++) {
    double s = dt * k / (CHECKS + 1);
    if (!agrees(r, e, s, dt)) return s > TINY ? 0.5 * s : 0;
  }
  return agrees(r, e, end * dt, dt) ? dt : dt > TINY ? 0.5 * dt : 0;
}

/* First coefficient of a guard that is not zero to rounding; order + 1 if there is none. */
static int leading(const Run *r, const Expansion *e, int row, int zeros, double *value) {
  const double *g = e->guards + (int64_t)row * r->stride;
  for (int k = zeros; k <= r->order; k++) {
    double noise = e->scale[row];
    if (k) {
      double speed = 0;
      for (int i = 0; i < r->n; i++) speed = larger(fabs(e->states[(int64_t)i * r->stride + k]), speed);
      noise = e->steep[row] * speed * (k + 1);
    }
    if (fabs(g[k]) > VANISHES * noise) { *value = g[k]; return k; }
  }
  *value = 0;
  return r->order + 1;
}

static double guard_root(const Run *r, const Expansion *e, int row, int drop, double h) {
  const double *g = e->guards + (int64_t)row * r->stride, *c = g + drop;
  int kind = e->l.kind[row];
  if (drop > r->order) return -1;
  if (kind == STOP_GUARD || kind == RESET_GUARD) return first_crossing(c, r->order - drop, h, e->l.side[row]);
  if (c[0] <= 0) {
    double value;
    drop = leading(r, e, row, drop, &value);
    if (value == 0) return -1;
    c = g + drop;
  }
  return first_root(c, r->order - drop, h);
}

/* How far rounding in a guard moves its root; nothing where it has no slope. */
static double blur(const double *c, int order, double dt) {
  double slope, noise = ROOT_ROUNDING * (fabs(c[0]) + rest_of(c, order, dt));
  horner(c, order, dt, &slope);
  slope = fabs(slope);
  return noise < 1e-9 * dt * slope ? noise / slope : 0;
}

static int32_t *side_of(const Run *r, const Layout *l, int row) {
  return r->side + l->index[row] + (l->kind[row] == RESET_GUARD ? r->s->stops : 0);
}

static void note_sides(Run *r, const Expansion *e, double dt) {
  for (int j = 0; j < e->l.rows; j++) {
    if (e->l.kind[j] != STOP_GUARD && e->l.kind[j] != RESET_GUARD) continue;
    const double *g = e->guards + (int64_t)j * r->stride;
    *side_of(r, &e->l, j) = side_before(g, r->order, dt, ON_SURFACE * e->scale[j]);
  }
}

/* Row of the earliest guard to end the mode within h, and the time; -1 if none. */
static int first_hit(const Run *r, const Expansion *e, double h, double *dt) {
  double *time = r->work;
  int first = -1, found = 0, rows = e->l.rows;
  for (int j = 0; j < rows; j++) {
    int kind = e->l.kind[j], at_once = 0;
    const double *g = e->guards + (int64_t)j * r->stride;
    if ((kind == STOP_GUARD || kind == RESET_GUARD) && !r->drop[j]) {
      int side = *side_of(r, &e->l, j);
      at_once = side && passed(g, r->order, side, e->l.side[j]);
    }
    time[j] = at_once ? 0 : guard_root(r, e, j, r->drop[j], h);
    if (time[j] < 0) continue;
    found++;
    if (first < 0 || time[j] < time[first]) first = j;
  }
  int best = first;
  if (found > 1) {
    double near = time[first] + TIE * larger(fabs(r->t), 1)
                  + blur(e->guards + (int64_t)first * r->stride, r->order, time[first]);
    for (int j = 0; j < rows; j++) {
      if (time[j] < 0 || time[j] > near + blur(e->guards + (int64_t)j * r->stride, r->order, time[j])) continue;
      int rank = PRIORITY[e->l.kind[j]], best_rank = PRIORITY[e->l.kind[best]];
      if (rank < best_rank || (rank == best_rank && time[j] < time[best])) best = j;
    }
  }
  if (best >= 0) *dt = time[best];
  return best;
}
