/* Steps: their length, their check, first roots of guards ----------------------------------------------- */

/* Binary logarithm and exponential to 1e-4: enough for a step size, a hundredth of libm's cost. */
static inline double rough_log2(double a) {
  union { double d; int64_t i; } u = {a};
  double e = (double)((u.i >> 52) - 1023);
  u.i = (u.i & 0xfffffffffffffLL) | 0x3ff0000000000000LL;
  double m = u.d - 1.5;
  double z = m * m, low = MULADD(m, 0.9617966939, 0.5849625007), high = MULADD(m, 0.0379969064, -0.0712441996);
  high = MULADD(z, MULADD(z, -0.0211093925, high), MULADD(m, 0.1424883991, -0.3205988980));
  return e + MULADD(z, high, low);
}
static inline double rough_exp2(double a) {
  double k = (a + 6755399441055744.0) - 6755399441055744.0, f = (a - k) * 0.6931471805599453;
  union { double d; int64_t i; } u;
  u.i = ((int64_t)k + 1023) << 52;
  double z = f * f, high = MULADD(z, MULADD(f, 0.0083333333, 0.0416666666), MULADD(f, 0.16666666666, 0.5));
  return u.d * MULADD(z, high, 1 + f);
}

/* The longest step for a term of an order, given relative to the tolerance at length 1. */
static double bound_at(double part, int order) {
  return part > SMALLEST ? rough_exp2(rough_log2(smaller(part, LARGEST)) * (-1.0 / order)) : INFINITY;
}

/* The time since the start is a state of a system with an explicit time. */
static void set_time_state(Run *r) {
  if (r->s->timed) r->x[r->n - 1] = (r->t - r->begun.high) + (r->t_low - r->begun.low);
}

/* Advance the time, in two numbers: its error is the rounding of the steps, not of their sum. */
static void pass_time(Run *r, double dt) {
  Pair t = pair_sum((Pair){r->t, r->t_low}, (Pair){dt, 0});
  r->t = t.high;
  r->t_low = t.low;
  set_time_state(r);
}

/* Round a step's length in a run that begins late, so that the time after it is one number. */
static double to_number(const Run *r, double dt) {
  if (fabs(r->t) <= FAR * (r->o.t_end - r->begun.high)) return dt;
  double to = (r->t + dt) - r->t - r->t_low;
  return fabs(to - dt) <= RESOLVED * dt ? to : dt;
}

/* The duration so far, to which rounding of times is relative. */
static double time_scale(const Run *r) { return fabs(r->t - r->begun.high); }

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

/* Whether a guard is a function of states and time, approximated by its polynomial. */
static int has_height(int kind) {
  return kind == SURFACE_GUARD || kind == IMPACT_GUARD || is_atom(kind);
}
static int is_curved(const Run *r, const Layout *l, int row) {
  int kind = l->kind[row];
  return has_height(kind) && r->s->curved[is_atom(kind) ? r->width + row - l->atoms : l->index[row]];
}

/* Whether a guard is the end of sliding within a bound that depends on the states. */
static int is_scaled_exit(const Run *r, const Layout *l, int row) {
  return l->kind[row] == EXIT_GUARD && is_scaled(r, l->index[row]) && !is_idle(r, l->letter, l->index[row]);
}

/* The longest step in which term k of a guard is below ``allowed``, or below the relative tolerance of one of its first
 * terms: a guard of time alone that begins at zero has no other scale. */
static double reach(const double *g, int k, double allowed, double rtol, int by_terms) {
  double h = allowed > 0 ? bound_at(fabs(g[k]) / allowed, k) : 0;
  for (int j = 1, found = 0; by_terms && j < k && found < 2; j++) {
    if (g[j] == 0) continue;
    found++;
    h = larger(bound_at(fabs(g[k] / g[j]) / rtol, k - j), h);
  }
  return h > 0 ? h : INFINITY;
}

/* The longest step for a series whose last terms are zero; if these underflow, by the last nonzero one. */
static double reach_of_held(const double *c, int order, double allowed) {
  int k = order;
  if (fabs(c[k]) > SMALLEST || fabs(c[k - 1]) > SMALLEST) return INFINITY;
  while (k > 1 && fabs(c[k]) <= SMALLEST) k--;
  return k == 1 || fabs(c[k]) * fabs(c[k] / c[k - 1]) > SMALLEST ? INFINITY : bound_at(fabs(c[k]) / allowed, k);
}

/* Shorten a step until the last two nonzero terms of each guard, of the last four, are small. */
static double reach_of_guards(const Run *r, const Expansion *e, double h) {
  int order = r->order, stride = r->stride;
  double power = 1;
  for (int k = 1; k < order; k++) power *= h;
  for (int row = 0; row < e->l.rows; row++) {
    const double *g = e->guards + (int64_t)row * stride;
    double allowed = e->of_guards[row] + r->o.rtol * fabs(g[0]);
    int by_terms = has_height(e->l.kind[row]);
    if (fabs(g[order - 1]) * power <= allowed && fabs(g[order] * h) * power <= allowed) continue;
    for (int k = order, found = 0; k > order - 4 && found < 2; k--) {
      if (g[k] == 0) continue;
      found++;
      double longest = reach(g, k, allowed, r->o.rtol, by_terms);
      if (longest < h) { h = longest; power = pow(h, order - 1); }
    }
    h = smaller(h, reach_of_held(g, order, allowed));
  }
  return h;
}

/* Shorten the step h of the last two terms, relative to the tolerance at length 1, where earlier ones are far larger: a
 * series may have gaps, as that of sin t - cos t + exp(-t). */
static double with_gaps(int order, double h, double last, double before, double third, double fourth) {
  double least = h < INFINITY ? larger(last * h, before) * h : 0;
  if (!(third <= GAP * least)) h = smaller(h, bound_at(third / GAP, order - 2));
  if (!(fourth <= GAP * least * h)) h = smaller(h, bound_at(fourth / GAP, order - 3));
  return h;
}

/* The step that the states' series allow. */
static double state_step(const Run *r, const Expansion *e) {
  int order = r->order, stride = r->stride;
  double last = 0, before = 0, third = 0, fourth = 0, held = INFINITY;
  for (int i = 0; i < r->s->dimension; i++) {
    const double *c = e->states + (int64_t)i * stride;
    double per = 1 / e->allowed[i];
    held = smaller(held, reach_of_held(c, order, e->allowed[i]));
    last = larger(fabs(c[order]) * per, last);
    before = larger(fabs(c[order - 1]) * per, before);
    third = larger(fabs(c[order - 2]) * per, third);
    fourth = larger(fabs(c[order - 3]) * per, fourth);
  }
  if (r->s->sets) direction_bounds(r, e, &last, &before);
  double h = smaller(bound_at(last, order), bound_at(before, order - 1));
  return smaller(held, with_gaps(order, h, last, before, third, fourth));
}

static double step_size(const Run *r, const Expansion *e) {
  int order = r->order;
  double h = reach_of_guards(r, e, state_step(r, e));
  for (int j = 0; j < e->l.rows; j++) {
    const double *g = e->guards + (int64_t)j * r->stride;
    double a = e->of_guards[j] + r->o.rtol * fabs(g[0]);
    if (!(a > 0) || a > RESOLVED * fabs(g[0])) h = resolve(g, order, h);
  }
  return h;
}

/* By how much the nodes of a program may differ from their values w where inputs differ by ``off``. */
static void spread_of(const Values *t, const double *w, const double *off, double *spread) {
  for (int32_t k = 0; k < t->still_count; k++) spread[t->still[k]] = 0;
  for (int32_t k = 0; k < t->moving_count; k++) {
    int32_t j = t->moving[k], one = t->a[j], two = t->b[j];
    if (t->op[j] == OP_input) { spread[j] = off[two]; continue; }
    double a = spread[one], b = spread[two];
    switch (t->op[j]) {
      case OP_add: case OP_sub: spread[j] = a + b; break;
      case OP_mul: spread[j] = fabs(w[one]) * b + (fabs(w[two]) + b) * a; break;
      case OP_sq: spread[j] = (2 * fabs(w[one]) + a) * a; break;
      case OP_twice: spread[j] = 2 * a; break;
      case OP_neg: case OP_assign: case OP_fabs: spread[j] = a; break;
      case OP_fmin: case OP_fmax: spread[j] = larger(a, b); break;
      case OP_sin: case OP_cos: case OP_tanh: spread[j] = smaller(a, 1 + fabs(w[j])); break;
      default: spread[j] = a == 0 && b == 0 ? 0 : INFINITY;
    }
  }
}

/* Leave curved guards out of a step that cannot vanish in it, as h = x + sin x where x is large, though their series reach
 * far less than those of the states; the length in which that is so, or 0. */
static double leave_out_far(Run *r, Expansion *e, double left, double by_guards) {
  const Values *t[] = {&r->s->surfaces, &r->s->atoms};
  double *w[] = {r->heights, r->atom_work}, *off = r->vector;
  double longest = 0, h = by_guards < left ? smaller(state_step(r, e), left) : 0;
  for (; h > FAR * by_guards && longest == 0; h *= FALL) {
    for (int i = 0; i < r->n; i++) off[i] = 2 * rest_of(e->states + (int64_t)i * r->stride, r->order, h);
    for (int q = 0; q < 2; q++) {
      if (!(q ? r->s->rules.atoms : r->m)) continue;
      values_at(t[q], r->x, r->p, w[q]);
      spread_of(t[q], w[q], off, r->spread);
      for (int row = 0; row < e->l.rows; row++) {
        int i = q ? row - e->l.atoms : e->l.index[row], node = t[q]->output[is_atom(e->l.kind[row]) == q ? i : 0];
        int is_own = q ? is_atom(e->l.kind[row]) : e->l.kind[row] == SURFACE_GUARD && has_law(r, i, SURFACE_LAW);
        if (!is_own || !is_curved(r, &e->l, row) || !(fabs(w[q][node]) > r->spread[node])) continue;
        memset(e->guards + (int64_t)row * r->stride + 1, 0, sizeof(double) * r->order);
        e->of_guards[row] = INFINITY;
        longest = h;
      }
    }
  }
  return longest;
}

/* Whether field and guards are affine, so that no step needs to be checked. */
static int is_linear(const Run *r, const Expansion *e) { return e->l.is_free ? r->s->linear_free : r->s->linear; }

/* A length beyond which the series may miss what follows, within the step h that it allows. */
static double safe_length(const Run *r, const Expansion *e, double h) {
  if (is_linear(r, e)) return INFINITY;
  if (e->l.mode == r->length_mode) return h > GROWTH * r->length ? r->length : INFINITY;
  double natural = INFINITY;
  for (int i = 0; i < r->n; i++) {
    const double *c = e->states + (int64_t)i * r->stride;
    natural = smaller((fabs(c[0]) + size_of_state(r, i)) / fabs(c[1]), natural);
  }
  return h > FAR * natural ? FIRST * natural : INFINITY;
}

/* The state and the multipliers at a time of a step. */
static void at_time(const Run *r, const Expansion *e, double time, double *x, double *lam) {
  int moves = !e->l.is_free || r->s->sets;
  for (int i = 0; i < r->n; i++) x[i] = value_at(e->states + (int64_t)i * r->stride, r->order, time);
  for (int i = 0; i < r->width; i++)
    lam[i] = moves ? value_at(e->series + (int64_t)i * r->stride, r->order, time) : 0;
}

/* Evaluate the functions of a mode's series at a state and multipliers. */
static void evaluate(Run *r, const Expansion *e, const double *x, const double *lam) {
  aim(r, e->l.letter, x, lam);
  r->expansion = e;
  set_inputs(r, x, held_of(r, e->l.letter), lam);
  first_values(r, e->l.is_free);
}

/* Guards there, each as the first of ``stride`` numbers. */
static const double *guards_at(Run *r, const Expansion *e, const double *lam) {
  double *g = r->work, *now = g + (int64_t)e->l.rows * r->stride;
  for (int i = 0; i < r->width; i++) now[(int64_t)i * r->stride] = lam[i];
  guard_rows(r, &e->l, now, 1, g);
  return g;
}

/* Field (n), errors of the multipliers that slide, and guards at a state and multipliers. */
static void sampled(Run *r, const Expansion *e, const double *x, const double *lam, double *found) {
  int n = r->n, slides = e->l.slides;
  evaluate(r, e, x, lam);
  for (int i = 0; i < n; i++) *found++ = row_of(r, i)[0];
  for (int i = 0; i < slides; i++, found++) {
    *found = 0;
    for (int q = e->from[i]; q < e->to[i]; q++)
      *found += fabs(e->inverse[q]) * fabs(row_of(r, n + e->l.sliding[e->column[q]])[0]);
  }
  if (!e->l.bent_count) return;
  const double *g = guards_at(r, e, lam);
  for (int q = 0; q < e->l.bent_count; q++) *found++ = g[(int64_t)e->l.bent[q] * r->stride];
}

/* Rounding of an output, after its value; zero where it has no bound. */
static double output_rounding(const Run *r, int output) {
  double error = EPSILON * r->rounding[r->s->series.output[output]];
  return error < INFINITY ? error : 0;
}

/* Rounding of a guard, or of its terms where it is a distance from a bound. */
static double guard_rounding(const Run *r, const Expansion *e, int row) {
  int kind = e->l.kind[row], i = e->l.index[row];
  const double *lam = r->vector + r->n + i;
  double factor = kind == EXIT_GUARD || kind == SLIP_GUARD ? row_of(r, r->n + 2 * r->width + i)[0] : 0;
  if (kind == EXIT_GUARD) return ROUNDING * (fabs(factor) + fabs(*lam));
  if (kind == SLIP_GUARD) return ROUNDING * (factor * factor + dot(lam, lam, size_of(r, i)));
  if (!has_height(kind)) return 0;
  return output_rounding(r, r->n + (is_atom(kind) ? 3 * r->width + row - e->l.atoms : r->width + e->l.index[row]));
}

/* Rounding of the values of ``sampled``. */
static void rounding_of(Run *r, const Expansion *e, double *noise) {
  int slides = e->l.slides;
  weigh_rounding(r, e->l.is_free, 0);
  for (int i = 0; i < r->n; i++) *noise++ = output_rounding(r, i);
  for (int i = 0; i < slides; i++) *noise++ = 0;
  for (int q = 0; q < e->l.bent_count; q++) *noise++ = guard_rounding(r, e, e->l.bent[q]);
}

/* Whether field and guards at a time of the step agree with the polynomials. */
static int agrees(Run *r, const Expansion *e, double time, double dt) {
  int n = r->n, order = r->order, stride = r->stride, slides = e->l.slides;
  int guards = e->l.bent_count, all = n + slides + guards;
  double *x = r->vector, *lam = x + n;
  double *found = r->sample, *noise = found + all, *moved = noise + all;
  const int32_t *bent = e->l.is_free ? r->s->bent_free : r->s->bent;
  at_time(r, e, time, x, lam);
  sampled(r, e, x, lam, found);
  for (int again = 0; again < 2; again++) {
    int near = 1;
    for (int i = 0; near && i < n; i++) {
      double slope, noisy = again ? noise[i] : 0;
      if (!bent[i]) continue;
      horner(e->states + (int64_t)i * stride, order, time, &slope);
      near = fabs(found[i] - slope) * dt <= WRONG * e->allowed[i] + dt * (VANISHES * fabs(slope) + noisy);
    }
    for (int i = n; near && i < n + slides; i++) { /* reactions may be large */
      double size = larger(1, fabs(lam[e->l.sliding[i - n]]));
      near = found[i] <= size * (WRONG * SAFETY * r->o.rtol + VANISHES) + (again ? noise[i] : 0);
    }
    for (int q = 0; near && q < guards; q++) {
      int j = e->l.bent[q];
      const double *c = e->guards + (int64_t)j * stride;
      double of_guard = e->of_guards[j] + SAFETY * r->o.rtol * fabs(c[0]);
      double miss = fabs(found[n + slides + q] - value_at(c, order, time));
      near = miss <= WRONG * of_guard + VANISHES * e->scale[j] + (again ? noise[n + slides + q] : 0);
    }
    if (near) return 1;
    /* Rounding in the states and in the time may exceed the tolerance far from zero. */
    if (!again) rounding_of(r, e, noise);
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
static double verified(Run *r, Expansion *e, double dt, double end, double safe) {
  double low = isinf(safe) ? dt : 0.5 * dt;
  if (is_linear(r, e)) return dt;
  if (e->l.bent_count) scales(r, e);
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
static int leading(Run *r, Expansion *e, int row, int zeros, double *value) {
  const double *g = e->guards + (int64_t)row * r->stride;
  for (int k = zeros; k <= r->order; k++) {
    double noise;
    if (k == 0) noise = scales(r, e)[row];
    else noise = steepness(r, e)[row] * speed_of(r, e, k) * (k + 1);
    if (fabs(g[k]) > VANISHES * noise) { *value = g[k]; return k; }
  }
  *value = 0;
  return r->order + 1;
}

/* What the distance from a bound is zero to where several elements slide: the law there is decided by what follows. */
static double tie_of_bound(Run *r, Expansion *e, int row) {
  int i = e->l.index[row], w = r->width;
  double most = 0;
  weigh_again(r, e);
  for (int k = i; k < i + size_of(r, i); k++) {
    double terms = 0, own = fabs(r->slope[k * w + k]);
    for (int j = 0; j < e->l.slides; j++) terms += fabs(r->slope[k * w + e->l.sliding[j]] * factor_of(r, e->l.sliding[j]));
    most = larger(most, own > 0 ? 2 * TIED * terms / own : 0);
  }
  return e->l.kind[row] == SLIP_GUARD ? 2 * fabs(factor_of(r, i)) * most : most;
}

static double guard_root(Run *r, Expansion *e, int row, int drop, double h) {
  const double *g = e->guards + (int64_t)row * r->stride, *c = g + drop;
  int kind = e->l.kind[row];
  if (drop > r->order) return -1;
  if (is_atom(kind)) return sure_crossing(r, e, row, drop, h, e->l.side[row]);
  if (c[0] <= 0) {
    double value;
    int is_tied = !drop && e->l.slides > 1 && (kind == SLIP_GUARD || kind == EXIT_GUARD) && -c[0] <= tie_of_bound(r, e, row);
    drop = leading(r, e, row, drop + is_tied, &value);
    if (value == 0) return -1;
    c = g + drop;
  }
  if (has_height(kind)) return sure_root(r, e, row, c, r->order - drop, h, 0, drop, 0);
  double dt = first_root(c, r->order - drop, h);
  return kind == SLIP_GUARD && dt > 0 ? slip_root(r, e, row, dt, h) : dt; /* squares lose digits */
}

/* How far rounding in a guard moves its root; 0 where it has no slope. */
static double blur(const double *c, int order, double dt) {
  double slope, noise = ROOT_ROUNDING * (fabs(c[0]) + rest_of(c, order, dt));
  horner(c, order, dt, &slope);
  slope = fabs(slope);
  return noise < STEEP * dt * slope ? noise / slope : 0;
}

/* Whether a guard passes its root with a slope above rounding. */
static int is_steep(const Run *r, const Expansion *e, int row, double dt) {
  return blur(e->guards + (int64_t)row * r->stride, r->order, dt) > 0;
}

/* The time of a clock's next tick, as the nearest number and what is left, from the number of its ticks. */
static double tick_of(const Run *r, int c, double *low) {
  double period = out_of(&r->s->choices, r->choice_work, 2 * (r->s->stops + r->s->resets) + c);
  const double *first = r->instant.tick + 2 * c;
  Pair since = pair_product((Pair){(double)r->instant.count[c], 0}, (Pair){period, 0});
  Pair time = pair_sum((Pair){first[0], first[1]}, since);
  *low = time.low;
  return time.high;
}

/* The time after a step, in one number: that of a tick which ends it, or of the run's end. */
static double time_after(const Run *r, double dt) {
  double to = pair_sum((Pair){r->t, r->t_low}, (Pair){dt, 0}).high, low;
  for (int c = 0; c < r->s->rules.clocks; c++) {
    double tick = tick_of(r, c, &low);
    if (fabs(tick - to) <= ROUNDING * fabs(to)) to = tick;
  }
  return smaller(to, r->o.t_end);
}

/* Improve the root of a guard's polynomial by the guard itself along the motion, unless its slope is rounding, or the guard
 * does not pass zero near it, or is zero there to rounding, which moves slow impacts, where a zero is left out. */
static double polished(Run *r, const Expansion *e, int row, double root) {
  const double *c = e->guards + (int64_t)row * r->stride;
  double *x = r->vector, *lam = x + r->n, slope, time = root;
  for (int again = 0; again < POLISHED; again++) {
    if (!(blur(c, r->order, time) > 0)) return root;
    horner(c, r->order, time, &slope);
    at_time(r, e, time, x, lam);
    if (e->l.kind[row] == EXIT_GUARD && !improve(r, &e->l, x, lam, 1)) return root;
    evaluate(r, e, x, lam);
    double value = guards_at(r, e, lam)[(int64_t)row * r->stride], change = value / slope;
    if (r->drop[row] && fabs(value) <= LOW * guard_noise(r, e, row, time)) return time;
    if (!(fabs(change) < 0.5 * time)) return root;
    time -= change;
    if (fabs(change) <= CLOSE * time) return time;
  }
  return root;
}

/* The clock whose tick is the event of an atom, or -1. */
static int clock_of(const Run *r, int atom) {
  for (int c = 0; c < r->s->rules.clocks; c++) if (r->s->stops + r->s->rules.clock_reset[c] == atom) return c;
  return -1;
}

/* Set sides at the end of a step for atoms that are located in one direction only. */
static void note_sides(Run *r, Expansion *e, double dt) {
  Instant *i = &r->instant;
  for (int a = 0; a < r->s->rules.atoms; a++) {
    const double *g = e->guards + (int64_t)(e->l.atoms + a) * r->stride;
    if (i->passing[a] || !i->side[a] || r->s->rules.way[a] == UNWATCHED || !r->s->rules.way[a]) continue;
    int side = side_before(g, r->order, dt, ON_SURFACE * scales(r, e)[e->l.atoms + a]);
    if (side) i->side[a] = (int8_t)side;
  }
}

/* Length of a short step from a point where high derivatives do not exist (a power law at zero), or 0. Each series ends
 * before its first nonfinite coefficient; the step is shortened until the defect at its end is below the tolerance. Guards
 * are not located within it: none may fall, and one that leaves zero must do so at its rate. */
static double singular_step(Run *r, Expansion *e, double most) {
  int n = r->n, order = r->order, stride = r->stride, rests = 0;
  Expansion *there = &r->trial;
  double *end = r->before, *unknowns = r->lam, *defect = r->at_work, *through = r->of_defect;
  const double *noise = scales(r, e);
  for (int i = 0; i < n + r->width; i++) {
    double *c = i < n ? e->states + (int64_t)i * stride : e->series + (int64_t)(i - n) * stride;
    int k = 0;
    while (k <= order && fabs(c[k]) < INFINITY) k++;
    if (k < 2 && i < n) return 0;
    for (; k <= order; k++) c[k] = 0;
  }
  for (int i = 0; i < r->width; i++) rests |= e->l.letter[i] == 0;
  if (r->s->sets || (rests && e->l.slides > 1)) return 0;
  for (double h = smaller(most, SINGULAR_LONGEST); h > SINGULAR_SHORTEST; h *= SINGULAR_SHORTER) {
    for (int i = 0; i < n; i++) end[i] = value_at(e->states + (int64_t)i * stride, order, h);
    memcpy(unknowns, r->unknowns, sizeof(double) * r->width);
    if (!improve(r, &e->l, end, unknowns, 2)) continue;
    expand(r, e->l.letter, end, unknowns, there);
    int fits = 1;
    for (int i = 0; i < n; i++) {
      double slope;
      horner(e->states + (int64_t)i * stride, order, h, &slope);
      defect[i] = fabs(there->states[(int64_t)i * stride + 1] - slope);
      fits &= defect[i] * h <= e->allowed[i] / SAFETY;
    }
    if (!fits) continue;
    guard_sums(r, there, defect, 1, through);
    for (int row = 0; row < e->l.rows; row++) {
      const double *g = e->guards + (int64_t)row * stride, after = there->guards[(int64_t)row * stride];
      int leaves = fabs(g[0]) <= VANISHES * noise[row] && fabs(g[1]) < INFINITY && g[1] != 0;
      fits &= !(ns_sign(after) * ns_sign(g[0]) < 0) && !(leaves && through[row] > SINGULAR_RATE * fabs(g[1]));
    }
    if (fits) return h;
  }
  return 0;
}

/* Time within h to the zero of an atom in a direction in which it is located; -1 if there is none. */
static double atom_root(Run *r, Expansion *e, int atom, double h) {
  int row = e->l.atoms + atom, side = r->instant.side[atom], clock = clock_of(r, atom);
  const double *g = e->guards + (int64_t)row * r->stride;
  if (clock >= 0) {
    double low, tick = tick_of(r, clock, &low), left = larger(tick - r->t - r->t_low + low, 0);
    return left <= h ? left : -1;
  }
  if (!side || r->s->rules.way[atom] == UNWATCHED) return -1;
  if (!r->drop[row] && passed(g, r->order, side, e->l.side[row])) return 0;
  return guard_root(r, e, row, r->drop[row], h);
}

/* Record the uncertainty of an event's time, if it moves a state by more than the tolerance. */
static void note_hidden(Run *r, const Expansion *e, int row) {
  for (int i = 0; r->hidden[row] > r->t_error && i < r->s->dimension; i++)
    if (r->hidden[row] * fabs(e->states[(int64_t)i * r->stride + 1]) > e->allowed[i] / SAFETY) r->t_error = r->hidden[row];
}

/* Priority of a guard among simultaneous ones; tables pass with any other, and come last. */
static int rank_of(const Run *r, const Expansion *e, int row) {
  int kind = e->l.kind[row], is_table = kind == SURFACE_GUARD && has_law(r, e->l.index[row], TABLE_LAW);
  return PRIORITY[kind] + (is_table ? KINDS : 0);
}

/* Row of the earliest guard to end the mode within h, and the time; -1 if none. */
static int first_hit(Run *r, Expansion *e, double h, double *dt) {
  double *time = r->root_at;
  int first = -1, found = 0, rows = e->l.rows;
  r->hold = INFINITY;
  memset(r->hidden, 0, sizeof(double) * rows);
  for (int j = 0; j < rows; j++) {
    time[j] = is_atom(e->l.kind[j]) ? atom_root(r, e, j - e->l.atoms, h) : guard_root(r, e, j, r->drop[j], h);
    if (time[j] < 0) continue;
    found++;
    if (first < 0 || time[j] < time[first]) first = j;
  }
  if (first < 0) return -1;
  double latest = time[first] + RESOLVED * h;
  for (int j = 0; j < rows; j++)
    if (time[j] > 0 && time[j] <= latest && (is_curved(r, &e->l, j) || (found > 1 && is_scaled_exit(r, &e->l, j))))
      time[j] = polished(r, e, j, time[j]);
  for (int j = 0; j < rows; j++) if (time[j] >= 0 && time[j] < time[first]) first = j;
  /* Atoms whose times coincide to rounding pass together, at the first time; other guards pass one by one. */
  int best = -1, atom = -1, passed_atoms = r->s->rules.atoms;
  double of_first = blur(e->guards + (int64_t)first * r->stride, r->order, time[first]);
  double near = time[first] + TIE * (time_scale(r) + time[first]) + of_first;
  for (int j = 0; j < rows && (found > 1 || passed_atoms); j++) {
    double own = j == first || time[j] < 0 ? of_first : blur(e->guards + (int64_t)j * r->stride, r->order, time[j]);
    if (time[j] < 0 || time[j] > near + own) continue;
    if (is_atom(e->l.kind[j])) {
      r->instant.passing[j - e->l.atoms] = 1;
      if (atom < 0 || time[j] < time[atom]) atom = j;
      continue;
    }
    int rank = rank_of(r, e, j), best_rank = best < 0 ? rank + 1 : rank_of(r, e, best);
    if (rank < best_rank || (rank == best_rank && time[j] < time[best])) best = j;
  }
  r->instant.tied = atom < 0 ? -1 : best;
  if (atom >= 0) best = atom;
  if (best < 0) best = first;
  *dt = time[best];
  return best;
}
