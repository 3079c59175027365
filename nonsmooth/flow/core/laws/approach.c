/* Sets of codimension two and more in a run ----------------------------------------------------------------- */

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
    if (!solve_any(d, b, count, INFINITY, b + count, r->decision->pivot)) return 0;
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
    if (!solve_any(d, b, count, INFINITY, b + count, r->decision->pivot)) return 0;
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
    if (!(fabs(n - 1) > SOLVED)) break;
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
static int is_met(Run *r, const int8_t *letter, int f, const double *h, const double *scales_of) {
  int k = size_of(r, f);
  int32_t own[3];
  double a[3], m[9], scale = 0, radius = length_of(h + f, k), speed = 0;
  for (int i = 0; i < k; i++) { own[i] = f + i; scale = larger(scales_of[f + i], scale); }
  if (!(radius > 0) || radius <= VANISHES * scale || radius > CLOSE * scale) return !(radius > VANISHES * scale);
  if (!freeze(r, letter, r->x, r->unknowns, own, k, a, m)) return 0;
  for (int i = 0; i < k * k; i++) speed += m[i] * m[i];
  return radius < shortest(r) * (length_of(a, k) + sqrt(speed));
}

/* |h| has fallen tenfold, or is small: the set is reached or passed now, or the test is repeated nearer. What has
 * fallen to rounding is zero, whatever its direction says. */
static void near_set(Run *r, int row, int fell) {
  int f = r->now.index[row], k = size_of(r, f), n = r->n, before = r->mode;
  int32_t own[3];
  double h[3], a[3], m[9], u[3], b[3], mean[3], scale = 0, dt, c = 0;
  r->met = (Met){NEAR_GUARD, f, 0};
  if (r->letter[f] == 0) return; /* friction's limit has fallen: the next step sees its digits */
  const double *height = surface_values(r, r->x), *scales_of = surface_scales(r, r->x);
  for (int i = 0; i < k; i++) {
    own[i] = f + i;
    h[i] = r->letter[f] == LEFT_BEHIND ? r->unknowns[f + i] : height[f + i];
    scale = larger(scales_of[f + i], scale);
  }
  double radius = unit_of(h, k, u);
  if (!freeze(r, r->letter, r->x, r->unknowns, own, k, a, m)) { finish(r, NOT_FINITE, FIELD, 0); return; }
  int at_floor = radius <= VANISHES * scale;
  int hits = definite(r, m, k) && solve_block(m, k, k, 0, a, b);
  hits = hits && length_of(b, k) < 1;
  for (int i = 0; i < k; i++) c += m[i * k + i] / k;
  int same = 1;
  double along = 0, square = 0, rate = 0;
  for (int i = 0; i < k; i++) {
    double g = a[i];
    for (int j = 0; j < k; j++) {
      same &= fabs(m[i * k + j] - (i == j ? c : 0)) <= SYMMETRIC * c;
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
    if (!good) { finish(r, NOT_FINITE, FIELD, 0); return; }
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
  EACH_SET(r, f) {
    int k = size_of(r, f), letter = r->letter[f];
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
  if (!definite(r, m, n) || !symmetric(m, n, SYMMETRIC)) return 0;
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

/* Coefficients of det(M + s)^2 - |adj(M + s) a|^2 in s (Faddeev and LeVerrier); its degree is 2 k. */
static void secular(const double *a, const double *m, int k, double *polynomial) {
  double adjugate[9] = {0}, determinant[4] = {1}, numerator[3][3], next[9];
  for (int i = 0; i <= 2 * k; i++) polynomial[i] = 0;
  for (int i = 0; i < k; i++) adjugate[i * (k + 1)] = 1;
  for (int j = 1; j <= k; j++) { /* of highest powers first */
    double trace = 0;
    for (int i = 0; i < k; i++) {
      numerator[j - 1][i] = 0;
      for (int l = 0; l < k; l++) {
        numerator[j - 1][i] += adjugate[i * k + l] * a[l];
        next[i * k + l] = 0;
        for (int q = 0; q < k; q++) next[i * k + l] -= m[i * k + q] * adjugate[q * k + l];
      }
      trace += next[i * k + i];
    }
    determinant[j] = -trace / j;
    for (int i = 0; i < k; i++) next[i * (k + 1)] += determinant[j];
    memcpy(adjugate, next, sizeof next);
  }
  for (int i = 0; i <= k; i++) for (int j = 0; j <= k; j++) polynomial[2 * k - i - j] += determinant[i] * determinant[j];
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++)
      for (int l = 0; l < k; l++) polynomial[2 * k - 2 - i - j] -= numerator[i][l] * numerator[j][l];
}

/* Direction u = (M + s)^-1 a where its length is 1 close to s; 0 where Newton's method leads away. */
static int direction_at(const double *a, const double *m, int k, double s, double *u) {
  double d[3], w[3], start = s, n = 0;
  for (int again = 0; again < LAYER_NEWTON; again++) {
    if (!solve_block(m, k, k, s, a, d) || !solve_block(m, k, k, s, d, w)) return 0;
    double slope = 0;
    for (int i = 0; i < k; i++) slope += d[i] * w[i];
    n = length_of(d, k);
    double step = (n * n - 1) / (-2 * slope);
    if (!(fabs(step) < INFINITY)) return 0;
    s -= step;
    if (fabs(step) <= EPSILON * fabs(s)) break;
  }
  if (!(fabs(n - 1) <= LAYER_APART && fabs(s - start) <= LEFT * (1 + fabs(start)))) return 0;
  unit_of(d, k, u);
  return 1;
}

/* Directions in which a set h' = a - M u is left at a rate that is not negative: all of (M + s) u = a, |u| = 1. */
static int limit_directions(const double *given, const double *matrix, int k, double (*u)[3]) {
  double a[3], m[9], p[P + 1], size = largest_of(given, k) + largest_of(matrix, k * k), at = -LAYER_RESIDUAL;
  int degree = 2 * k, count = 0, zeros = 0;
  if (!(size > 0)) return 0;
  for (int i = 0; i < k; i++) a[i] = given[i] / size;
  for (int i = 0; i < k * k; i++) m[i] = matrix[i] / size;
  secular(a, m, k, p);
  for (int i = 0; i < degree; i++) for (int j = degree - 1; j >= i; j--) p[j] += at * p[j + 1];
  while (count < 2 * k && zeros < degree) {
    double sign = ns_sign(p[zeros]), c[P + 1], left = 2 * k - at, root;
    if (sign == 0) { zeros++; continue; }
    for (int i = 0; i <= degree; i++) c[i] = sign * p[i];
    root = first_root(c + zeros, degree - zeros, left);
    if (root < 0) break;
    at += root;
    for (int i = 0; i < degree; i++) for (int j = degree - 1; j >= i; j--) p[j] += root * p[j + 1];
    p[0] = 0;
    zeros = 1;
    count += direction_at(a, m, k, at, u[count]);
  }
  return count;
}

/* All unknowns of a mode in which sets are left; as mode_solutions. */
static void solutions_of_leaving(Run *r, const Layout *l, Solutions *found) {
  int n = 0, sets = 0, w = r->width, count = 1;
  int32_t *own = r->involved, *first = own + w;
  double *a = r->laws, *lam = a + w, *m = lam + w, u[6][3], *unknowns = r->tried;
  for (int i = 0; i < r->m; i++) {
    if (l->letter[i] != LEAVING) continue;
    if (i == set_of(r, i)) first[sets++] = n;
    own[n++] = i;
    unknowns[i] = 1; /* some direction, until it is known */
  }
  first[sets] = n;
  if (!freeze(r, l->letter, r->x, unknowns, own, n, a, m)) return;
  if (sets > 1) {
    if (!bounded_multipliers(r, a, m, n, first, sets, lam)) return;
  } else if (definite(r, m, n) && symmetric(m, n, VANISHES)) {
    if (!leaving_direction(a, m, n, n, u[0])) return;
  } else count = limit_directions(a, m, n, u);
  for (int q = 0; q < count; q++) {
    for (int i = 0; i < n; i++) unknowns[own[i]] = sets > 1 ? lam[i] : u[q][i];
    if (l->slides && !improve(r, l, r->x, unknowns, 2)) continue;
    memcpy(found->each + found->count++ * w, unknowns, sizeof(double) * w);
  }
}

/* Whether the point is on sets: those are decided here. */
static int meets_sets(const Run *r) {
  for (int i = 0; i < r->active_count; i++) if (set_of(r, r->active[i]) >= 0) return 1;
  return 0;
}

/* Whether the symmetric part of a matrix has a negative direction: a principal minor of it, shifted by a margin. */
static int has_negative(const double *m, int k) {
  double a[9], most = largest_of(m, k * k);
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++) a[i * k + j] = 0.5 * (m[i * k + j] + m[j * k + i]) + (i == j ? LAYER_ROUNDING * most : 0);
  for (int set = 1; set < 1 << k; set++) {
    int rows[3], count = 0;
    for (int i = 0; i < k; i++) if (set >> i & 1) rows[count++] = i;
    if (determinant(a, k, rows, count) < 0) return 1;
  }
  return 0;
}

/* Letters that are possible at sets, as bits: of sets leaving (1) and holding (4). One where the law of
 * sets alone decides. 0 where the run ends. */
static int sets_by_rates(Run *r, const int8_t *letter, const Known *known, int known_count, int8_t *possible) {
  int w = r->width, n = 0, sets = 0, *first = r->involved + w, bounded;
  int32_t *own = r->involved;
  double *a = r->laws, *lam = a + w, *m = lam + w, block[9];
  for (int i = 0; i < r->active_count; i++) {
    int which = r->active[i], s = set_of(r, which);
    possible[i] = s < 0 && which < r->m ? 7 : 5;
    if (s < 0) continue;
    if (which == s) first[sets++] = n;
    own[n++] = which;
  }
  first[sets] = n;
  if (!freeze(r, letter, r->x, r->unknowns, own, n, a, m)) return 1;
  for (int s = 0; s < sets; s++) {
    int f = first[s], k = first[s + 1] - f;
    for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) block[i * k + j] = m[(f + i) * n + f + j];
    if (has_negative(block, k)) { finish(r, NON_UNIQUE, INDEFINITE, own[f]); return 0; }
  }
  bounded = n == r->active_count && bounded_multipliers(r, a, m, n, first, sets, lam);
  for (int s = 0; bounded && s < sets; s++) {
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
    for (int i = f; i < f + k && !left; i++) possible[i] = room > LAYER_BEYOND ? 4 : length_of(rates, k) > LAYER_BEYOND * size ? 1 : 5;
  }
  return 1;
}

/* Choose, as r->chosen, the motion that continues from h = 0 of some sets, and of surfaces and contacts there. */
static int decide_sets(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int8_t *trial = r->tried_letter, *possible = trial + r->width, *each = (int8_t *)r->lam + sizeof(double) * r->width;
  Solutions all = {0};
  Tally tally = {0};
  if (!sets_by_rates(r, letter, known, known_count, possible)) return 0;
  for (int i = 0; i < r->active_count; i++) { /* a set has one letter, that of its first function */
    int s = set_of(r, r->active[i]);
    each[i] = s < 0 || r->active[i] == s ? possible[i] : 4;
  }
  int total = choices_of(each, r->active_count);
  if (total > TRIED) { many_may_hold(r); return 0; }
  r->several_count = 0;
  for (int number = 0; number < total && r->status == RUNNING; number++) {
    spell_choice(r, letter, each, number, trial);
    for (int i = 0; i < r->active_count; i++) {
      int s = set_of(r, r->active[i]);
      if (s >= 0) trial[r->active[i]] = trial[s] ? LEAVING : 0;
    }
    lay_out(r, trial, &r->trial.l);
    mode_solutions(r, &r->trial.l, &all);
    for (int q = 0; q < all.count && r->status == RUNNING; q++) {
      memcpy(r->found.unknowns, all.each + q * r->width, sizeof(double) * r->width);
      if (continues(r, trial, known, known_count, &r->found)) count_found(r, &tally);
    }
  }
  for (int i = 1, same = 1; i < r->several_count && same; i++) {
    same = r->several[i] == r->several[0];
    if (same && i == r->several_count - 1) finish(r, NON_UNIQUE, SEVERAL_DIRECTIONS, tally.strict);
  }
  return r->status == RUNNING && (choose_of(r, &tally) || no_motion(r, letter));
}

/* Nodes of a program that are zero whatever moves, from the values of those that do not. */
static void find_zeros(const Values *t, const double *w, int8_t *zero) {
  memset(zero, 0, t->size);
  for (int32_t k = 0; k < t->still_count; k++) zero[t->still[k]] = w[t->still[k]] == 0;
  for (int32_t k = 0; k < t->moving_count; k++) {
    int32_t j = t->moving[k];
    int a = zero[t->a[j]], b = zero[t->b[j]];
    switch (t->op[j]) {
      case OP_input: zero[j] = 0; break;
      case OP_mul: case OP_if_else_zero: zero[j] = (int8_t)(a || b); break;
      case OP_add: case OP_sub: case OP_hypot: case OP_fmin: case OP_fmax: zero[j] = (int8_t)(a && b); break;
      case OP_assign: case OP_neg: case OP_twice: case OP_sq: case OP_sqrt: case OP_fabs: case OP_sign: case OP_sin:
      case OP_tan: case OP_asin: case OP_atan: case OP_sinh: case OP_tanh: case OP_div: zero[j] = (int8_t)a; break;
      default: zero[j] = 0;
    }
  }
}

/* Sets whose multiplier does not enter the field with these parameters: no friction. */
static void find_idle(Run *r) {
  const Entries *column = &r->s->column;
  if (!r->s->sets) return;
  memset(r->idle, 1, r->m);
  find_zeros(&r->s->columns, r->columns, r->vanishes);
  for (int q = 0; q < column->count; q++) {
    int s = set_of(r, column->column[q]);
    if (s >= 0 && !r->vanishes[r->s->columns.output[q]]) r->idle[s] = 0;
  }
  find_zeros(&r->s->point, r->point, r->vanishes);
  EACH_SET(r, s) r->idle[s] |= r->vanishes[r->s->point.output[r->width + s]];
}

/* After a step that ended with no guard: sets that are close may be reached to rounding. */
static void look_at_sets(Run *r) {
  for (int row = 0; row < r->now.rows; row++) {
    int f = r->now.index[row], k = size_of(r, f);
    if (r->now.kind[row] != NEAR_GUARD || r->letter[f] < OFF || r->drop[row]) continue;
    const double *h = surface_values(r, r->x), *scales_of = surface_scales(r, r->x);
    double scale = 0, radius = length_of(r->letter[f] == LEFT_BEHIND ? r->unknowns + f : h + f, k);
    for (int i = f; i < f + k; i++) scale = larger(scales_of[i], scale);
    if (radius <= CLOSE * scale) { near_set(r, row, 0); return; }
  }
}
