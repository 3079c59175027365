/* Sets of codimension two and more in a run: nonsmooth/flow/reference/{sets,laws_of_sets}.py --------------- */

static int choose(Run *r, const int8_t *letter, const Known *known, int known_count);
static int change_kind(const Run *r, int before, int after);


/* h' = a - M lambda of the functions ``own``, with what else slides eliminated; 0 where that is impossible. */
static int freeze(Run *r, const int8_t *letter, const double *x, const double *unknowns, const int32_t *own, int k,
                  double *a, double *m) {
  int w = r->width, count = 0;
  int32_t *others = r->pending;
  aim(r, letter, x, unknowns);
  held_of(r, letter);
  for (int i = 0; i < w; i++) {
    int mine = 0;
    for (int j = 0; j < k; j++) mine |= own[j] == i;
    if (mine) r->held[i] = 0;
    else if (letter[i] == 0 && !is_idle(r, letter, i)) others[count++] = i;
  }
  error_scales(r, x, r->held, r->none);
  for (int i = 0; i < k; i++) {
    a[i] = layer_of(r, own[i]);
    for (int j = 0; j < k; j++) m[i * k + j] = -r->slope[own[i] * w + own[j]] * factor_of(r, own[j]);
  }
  for (int column = 0; count && column <= k; column++) {
    double *d = r->work, *b = d + (int64_t)count * count;
    for (int i = 0; i < count; i++) {
      for (int j = 0; j < count; j++) d[i * count + j] = r->slope[others[i] * w + others[j]];
      b[i] = column == k ? layer_of(r, others[i]) : r->slope[others[i] * w + own[column]] * factor_of(r, own[column]);
    }
    if (!solve(d, b, count)) return 0;
    for (int i = 0; i < k; i++) {
      double through = 0;
      for (int j = 0; j < count; j++) through += r->slope[own[i] * w + others[j]] * b[j];
      if (column == k) a[i] -= through; else m[i * k + column] += through;
    }
  }
  return finite_all(a, k) && finite_all(m, k * k);
}

/* The field with given multipliers of a set, and what slides elsewhere in balance. */
static int field_with(Run *r, const int8_t *letter, const double *x, const double *unknowns, int first, int k,
                      const double *lam, double *field) {
  int w = r->width, count = 0;
  int32_t *others = r->pending;
  double *acting = r->later;
  aim(r, letter, x, unknowns);
  held_of(r, letter);
  for (int i = 0; i < k; i++) r->held[first + i] = lam[i];
  for (int i = 0; i < w; i++) {
    acting[i] = 0;
    if (letter[i] == 0 && (i < first || i >= first + k) && !is_idle(r, letter, i)) others[count++] = i;
  }
  if (count) {
    double *d = r->work, *b = d + (int64_t)count * count;
    error_scales(r, x, r->held, r->none);
    for (int i = 0; i < count; i++) {
      for (int j = 0; j < count; j++) d[i * count + j] = r->slope[others[i] * w + others[j]];
      b[i] = -layer_of(r, others[i]);
    }
    if (!solve(d, b, count)) return 0;
    for (int i = 0; i < count; i++) acting[others[i]] = b[i];
  }
  set_inputs(r, x, r->held, acting);
  first_values(r, 0);
  for (int i = 0; i < r->n; i++) field[i] = row_of(r, i)[0];
  return 1;
}

static double largest_of(const double *m, int count) {
  double most = 0;
  for (int i = 0; i < count; i++) most = larger(fabs(m[i]), most);
  return most;
}

/* Whether the symmetric part is positive definite; M has no more than so many rows as r->work has room for. */
static int definite(Run *r, const double *m, int k) {
  double *a = r->work, most = largest_of(m, k * k);
  for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) a[i * k + j] = 0.5 * (m[i * k + j] + m[j * k + i]) / most;
  return most > 0 && is_definite(a, k, VANISHES * k);
}

static int symmetric(const double *m, int k, double part) {
  double most = largest_of(m, k * k);
  for (int i = 0; i < k; i++) for (int j = 0; j < i; j++) if (fabs(m[i * k + j] - m[j * k + i]) > part * most) return 0;
  return 1;
}

/* y of M y = b, M (k, k) at most 3 rows of a larger matrix. */
static int solve_block(const double *m, int stride, int k, double shift, const double *b, double *y) {
  double a[9];
  for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) a[i * k + j] = m[i * stride + j] + (i == j ? shift : 0);
  for (int i = 0; i < k; i++) y[i] = b[i];
  return solve(a, y, k);
}

/* The direction u with (M + s) u = a, |u| = 1 and the largest s, which is not negative: Newton's method from the
 * left, where it is monotone (1/|(M + s)^-1 a| is concave). */
static int leaving_direction(const double *a, const double *m, int stride, int k, double *u) {
  double d[3], w[3], s = 0;
  for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) s += m[i * stride + j] * m[i * stride + j];
  s = larger(0, length_of(a, k) - sqrt(s));
  for (int again = 0; again < 100; again++) {
    if (!solve_block(m, stride, k, s, a, d) || !solve_block(m, stride, k, s, d, w)) return 0;
    double n = length_of(d, k), slope = 0;
    for (int i = 0; i < k; i++) slope += d[i] * w[i];
    s += (n - 1) * n * n / slope;
    if (!(fabs(n - 1) > 4e-16)) break;
  }
  if (!solve_block(m, stride, k, s, a, d)) return 0;
  unit_of(d, k, u);
  return finite_all(u, k);
}

/* The step along a straight line that is too short for a series. */
static void jump(Run *r, const double *rate, double dt) {
  int n = r->n, stride = r->stride;
  Expansion *e = &r->trial;
  for (int i = 0; i < n; i++) {
    double *c = e->states + (int64_t)i * stride;
    memset(c, 0, sizeof(double) * stride);
    c[0] = r->x[i]; c[1] = rate[i];
  }
  note_step(r, e);
  if (r->times) sample_step(r, e, dt);
  for (int i = 0; i < n; i++) r->x[i] += dt * rate[i];
  pass_time(r, dt);
  r->since += dt;
  r->step_count++;
  r->segment_steps++;
  memset(r->drop, 0, sizeof(int32_t) * r->guards);
  note(r);
}

/* Time to a set below which coefficients of series are too large for numbers. */
static double shortest(const Run *r) { return pow(OVERFLOW, -1.0 / r->order); }

/* Whether the state is on a set, or as close as no series can begin; after surface_values. */
static int is_met(Run *r, const int8_t *letter, int set, const double *h, const double *scales_of) {
  int f = first_of(r, set), k = size_of(r, set);
  int32_t own[3];
  double a[3], m[9], scale = 0, radius = length_of(h + f, k), speed = 0;
  for (int i = 0; i < k; i++) { own[i] = f + i; scale = larger(scales_of[f + i], scale); }
  if (!(radius > 0) || radius <= VANISHES * scale || radius > 1e-8 * scale) return !(radius > VANISHES * scale);
  if (!freeze(r, letter, r->x, r->unknowns, own, k, a, m)) return 0;
  for (int i = 0; i < k * k; i++) speed += m[i] * m[i];
  return radius < shortest(r) * (length_of(a, k) + sqrt(speed));
}

/* |h| has fallen tenfold, or is small: the set is reached or passed now, or looked at again nearer. What has
 * fallen to rounding is zero, whatever its direction says. */
static void near_set(Run *r, int row, int fell) {
  int f = r->now.index[row], s = set_of(r, f), k = size_of(r, s), n = r->n, before = r->mode;
  int32_t own[3];
  double h[3], a[3], m[9], u[3], b[3], mean[3], scale = 0, dt, c = 0;
  if (r->letter[f] == 0) return; /* friction's limit has fallen: the next step sees its digits */
  const double *height = surface_values(r, r->x), *scales_of = surface_scales(r, r->x);
  for (int i = 0; i < k; i++) {
    own[i] = f + i;
    h[i] = r->letter[f] == LEFT_BEHIND ? r->unknowns[f + i] : height[f + i];
    scale = larger(scales_of[f + i], scale);
  }
  double radius = unit_of(h, k, u);
  if (!freeze(r, r->letter, r->x, r->unknowns, own, k, a, m)) { finish(r, HAND_OVER, NO_REASON, 0); return; }
  int at_floor = radius <= VANISHES * scale;
  int hits = definite(r, m, k) && solve_block(m, k, k, 0, a, b);
  hits = hits && length_of(b, k) < 1;
  for (int i = 0; i < k; i++) c += m[i * k + i] / k;
  int same = 1;
  double along = 0, square = 0, rate = 0;
  for (int i = 0; i < k; i++) {
    double g = a[i];
    for (int j = 0; j < k; j++) {
      same &= fabs(m[i * k + j] - (i == j ? c : 0)) <= 1e-12 * c;
      g -= m[i * k + j] * u[j];
    }
    rate += u[i] * g;
    along += a[i] * h[i];
    square += a[i] * a[i];
  }
  dt = hits && same ? (c * radius + along) / (c * c - square) : rate < 0 ? radius / -rate : INFINITY;
  at_floor |= dt < larger(shortest(r), TENFOLD * SHORTEST * time_scale(r));
  if (!hits && !at_floor) return;
  if (!(dt > 0 && dt < INFINITY)) {
    if (!(at_floor && (hits || fell))) return;
    dt = 0;
  }
  if (dt > 0) {
    double *field = r->at_work, *end = r->before, *other = r->aside, *turn = other + n, a2[3], m2[9], bend = 0;
    memcpy(mean, u, sizeof u);
    if (hits) {
      for (int i = 0; i < k; i++) b[i] = a[i] + h[i] / dt;
      solve_block(m, k, k, 0, b, mean);
    }
    int good = field_with(r, r->letter, r->x, r->unknowns, f, k, mean, field);
    for (int i = 0; i < n; i++) end[i] = r->x[i] + dt * field[i];
    good = good && freeze(r, r->letter, end, r->unknowns, own, k, a2, m2);
    if (!good) { finish(r, HAND_OVER, NO_REASON, 0); return; }
    for (int i = 0; i < k; i++) bend += fabs(a2[i] - a[i]);
    for (int i = 0; i < k * k; i++) bend += fabs(m2[i] - m[i]);
    bend *= dt;
    if (!at_floor) {
      field_with(r, r->letter, r->x, r->unknowns, f, k, u, other);
      for (int i = 0; i < n; i++) turn[i] = fabs(field[i] - other[i]);
      field_with(r, r->letter, end, r->unknowns, f, k, mean, other);
      for (int i = 0; i < n; i++) {
        double allowed = i < r->s->dimension ? REACHED * SAFETY * (r->o.atol + r->o.rtol * fabs(r->x[i])) : 0;
        allowed += EPSILON * (r->size + fabs(r->x[i]));
        if ((turn[i] + fabs(field[i] - other[i])) * dt > allowed) return;
      }
      if (bend > REACHED * radius) return;
    }
    if (bend <= radius) jump(r, field, smaller(dt, r->o.t_end - r->t - r->t_low));
  }
  active_surfaces(r, f, r->letter);
  if (r->status != RUNNING) return;
  int kept = 0;
  for (int i = 0; i < r->active_count; i++) r->involved[kept++] = r->active[i];
  project(r, r->involved, kept);
  renote(r);
  memcpy(r->start, r->letter, r->width);
  if (choose(r, r->start, 0, 0) && r->mode != before) event(r, change_kind(r, before, r->mode), before, row, r->x);
}

/* Sets that were left a step ago: h is carried along until it is far above rounding. */
static void after_step(Run *r) {
  int changed = 0, carried = 0;
  double *level = r->later;
  const double *scales_of = 0;
  for (int s = 0; s < r->s->sets; s++) {
    int f = first_of(r, s), k = size_of(r, s), letter = r->letter[f];
    if (letter != LEAVING && letter != LEFT_BEHIND) continue;
    if (!scales_of) { surface_values(r, r->x); scales_of = surface_scales(r, r->x); }
    double scale = 0;
    for (int i = f; i < f + k; i++) scale = larger(scales_of[i], scale);
    int next = letter == LEAVING || length_of(r->unknowns + f, k) <= LEFT * scale ? LEFT_BEHIND : OFF;
    for (int i = f; i < f + k; i++) {
      r->letter[i] = (int8_t)next;
      if (next == OFF) r->unknowns[i] = 0;
      else { r->involved[carried] = i; level[carried++] = r->unknowns[i]; }
    }
    changed |= next != letter;
  }
  if (carried) project_to(r, r->involved, carried, level);
  if (!changed) return;
  lay_out(r, r->letter, &r->now);
  r->mode = r->now.mode;
}

/* Multipliers of sets at h = 0 together; 0 where M is not symmetric and positive definite. */
static int bounded_multipliers(Run *r, const double *a, const double *m, int n, const int *first, int sets, double *lam) {
  if (!definite(r, m, n) || !symmetric(m, n, 1e-12)) return 0;
  for (int i = 0; i < n; i++) lam[i] = 0;
  for (int again = 0; again < 2000; again++) {
    double change = 0;
    for (int s = 0; s < sets; s++) {
      int f = first[s], k = first[s + 1] - f;
      double rest[3], y[3];
      for (int i = 0; i < k; i++) {
        rest[i] = a[f + i];
        for (int j = 0; j < n; j++) if (j < f || j >= f + k) rest[i] -= m[(f + i) * n + j] * lam[j];
      }
      const double *block = m + (int64_t)f * n + f;
      if (!solve_block(block, n, k, 0, rest, y)) return 0;
      if (length_of(y, k) > 1 && !leaving_direction(rest, block, n, k, y)) return 0;
      for (int i = 0; i < k; i++) { change = larger(fabs(y[i] - lam[f + i]), change); lam[f + i] = y[i]; }
    }
    if (change <= 4 * EPSILON) break;
  }
  return finite_all(lam, n);
}

/* Whether sets are met: those are decided here. */
static int meets_sets(const Run *r) {
  for (int i = 0; i < r->active_count; i++) if (set_of(r, r->active[i]) >= 0) return 1;
  return 0;
}

/* Whether the motion can continue in a mode: its guards that vanish here become positive. */
static int continuation(Run *r, const int8_t *letter, const Known *known, int known_count, Continuation *result) {
  Expansion *e = &r->trial;
  lay_out(r, letter, &e->l);
  if (e->l.slides) {
    if (!is_known(r, &e->l)) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    if (!improve(r, &e->l, r->x, result->unknowns, 1)) return 0;
    error_scales(r, r->x, held_of(r, letter), result->unknowns);
  }
  expand(r, letter, r->x, result->unknowns, e);
  if (!e->finite) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  memcpy(result->letter, letter, r->width);
  result->strict = 1;
  memset(result->drop, 0, sizeof(int32_t) * r->guards);
  for (int row = 0; row < e->l.rows; row++) {
    int kind = e->l.kind[row], index = e->l.index[row], of = index, active = 0, zeros = 0;
    if (kind == STOP_GUARD || kind == RESET_GUARD) continue;
    if (kind == NEAR_GUARD && letter[index] == 0) continue; /* ends steps only */
    if (kind == IMPACT_GUARD || kind == RELEASE_GUARD) of += r->m;
    for (int i = 0; i < r->active_count; i++) active |= r->active[i] == of;
    if (!active) continue;
    for (int i = 0; i < known_count; i++)
      if (known[i].kind == kind && known[i].index == index && known[i].side == e->l.side[row]) zeros = known[i].zeros;
    if ((kind == SURFACE_GUARD || kind == NEAR_GUARD) && zeros < 1) zeros = 1;
    if (kind == IMPACT_GUARD && zeros < 2) zeros = 2;
    double value;
    int k = leading(r, e, row, zeros, &value);
    if (value < 0) return 0;
    if (value == 0) result->strict = 0;
    result->drop[row] = value != 0 ? (k < r->order ? k : r->order) : r->order + 1;
  }
  return 1;
}

static void copy_continuation(const Run *r, Continuation *to, const Continuation *from) {
  memcpy(to->letter, from->letter, r->width);
  memcpy(to->drop, from->drop, sizeof(int32_t) * r->guards);
  memcpy(to->unknowns, from->unknowns, sizeof(double) * r->width);
  to->strict = from->strict;
}

static int rests(const Run *r, const int8_t *letter) {
  for (int i = 0; i < r->width; i++) if (letter[i] == 0) return 1;
  return 0;
}

/* Choose, as r->chosen, the motion that continues from h = 0 of some sets. Surfaces or contacts that are met
 * too, and what is not known to be unique, are the reference driver's. */
static int decide_sets(Run *r, const int8_t *letter, const Known *known, int known_count) {
  enum { MOST = 24 };
  int n = r->active_count, sets = 0, first[MOST + 1], undecided[MOST], open = 0, strict = 0, found = 0, resting = 0;
  double a[MOST], m[MOST * MOST], lam[MOST];
  int8_t *trial = (int8_t *)r->lam + sizeof(double) * r->width + r->width;
  int32_t own[MOST];
  if (n > MOST || n * n > r->width * r->width) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  for (int i = 0; i < n; i++) {
    own[i] = r->active[i];
    if (set_of(r, own[i]) < 0) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
    if (own[i] == first_of(r, set_of(r, own[i]))) first[sets++] = i;
  }
  first[sets] = n;
  if (!freeze(r, letter, r->x, r->unknowns, own, n, a, m) || !bounded_multipliers(r, a, m, n, first, sets, lam)) {
    finish(r, HAND_OVER, NO_REASON, 0);
    return 0;
  }
  memcpy(trial, letter, r->width);
  for (int s = 0; s < sets; s++) {
    int f = first[s], k = first[s + 1] - f, left = 0;
    double size = 0, rates[3];
    for (int i = 0; i < k; i++) {
      rates[i] = a[f + i];
      size += fabs(a[f + i]);
      for (int j = 0; j < n; j++) rates[i] -= m[(f + i) * n + j] * lam[j];
      for (int j = f; j < f + k; j++) size += fabs(m[(f + i) * n + j]);
    }
    for (int i = 0; i < known_count; i++) left |= known[i].kind == SLIP_GUARD && known[i].index == own[f];
    double room = 1 - length_of(lam + f, k);
    int which = left ? -1 : room > 1e-9 ? 0 : length_of(rates, k) > 1e-9 * size ? LEAVING : -1;
    if (which < 0) undecided[open++] = s;
    for (int i = f; i < f + k; i++) trial[own[i]] = (int8_t)(which < 0 ? 0 : which);
  }
  if (open > 6) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  for (int number = 0; number < 1 << open && r->status == RUNNING; number++) {
    for (int q = 0; q < open; q++)
      for (int i = first[undecided[q]]; i < first[undecided[q] + 1]; i++)
        trial[own[i]] = (int8_t)(number >> q & 1 ? LEAVING : 0);
    double *unknowns = r->found.unknowns;
    keep_carried(r, trial, unknowns);
    for (int s = 0; s < sets; s++)
      if (trial[own[first[s]]] == LEAVING) unit_of(lam + first[s], first[s + 1] - first[s], unknowns + own[first[s]]);
    if (!continuation(r, trial, known, known_count, &r->found)) continue;
    if (r->found.strict && strict++ == 0) copy_continuation(r, &r->one, &r->found);
    if (found++ == 0) copy_continuation(r, &r->first, &r->found);
    if (rests(r, trial) && resting++ == 0) copy_continuation(r, &r->rest, &r->found);
  }
  if (r->status != RUNNING) return 0;
  if (strict == 1) copy_continuation(r, &r->chosen, &r->one);
  else if (strict == 0 && found == 1) copy_continuation(r, &r->chosen, &r->first);
  else if (strict == 0 && resting) copy_continuation(r, &r->chosen, &r->rest);
  else { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  return 1;
}

/* Whether the multiplier of a set is seen to make no difference, here and elsewhere: no friction. */
static int without_friction(Run *r) {
  double *x = r->at_work;
  for (int s = 0; s < r->s->sets; s++) {
    int f = first_of(r, s), k = size_of(r, s), enters = 0;
    for (int trial = 0; trial < 3 && !enters; trial++) {
      for (int i = 0; i < r->n; i++) x[i] = r->x[i] + trial * (0.37 + 0.11 * i);
      error_scales(r, x, r->none, r->none);
      for (int i = f; i < f + k; i++)
        for (int j = f; j < f + k; j++) enters |= r->slope[i * r->width + j] * factor_of(r, j) != 0;
    }
    if (!enters) return 1;
  }
  return 0;
}

/* After a step that ended with no guard: sets that are close may be reached to rounding. */
static void look_at_sets(Run *r) {
  for (int row = 0; row < r->now.rows; row++) {
    int f = r->now.index[row], s, k;
    if (r->now.kind[row] != NEAR_GUARD || r->letter[f] < OFF || r->drop[row]) continue;
    s = set_of(r, f);
    k = size_of(r, s);
    const double *h = surface_values(r, r->x), *scales_of = surface_scales(r, r->x);
    double scale = 0, radius = length_of(r->letter[f] == LEFT_BEHIND ? r->unknowns + f : h + f, k);
    for (int i = f; i < f + k; i++) scale = larger(scales_of[i], scale);
    if (radius <= 1e-8 * scale) { near_set(r, row, 0); return; }
  }
}
