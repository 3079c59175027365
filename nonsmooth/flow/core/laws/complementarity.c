/* Jumps by complementarity conditions: 0 <= y, nu >= 0, y nu = 0, where nu enters the rate of y(x, t), or y itself.
 *
 * A state with y < 0 jumps by impulses p of the unknowns, x+ = x + B(x+) p with 0 <= y(x+), p >= 0, y p = 0 and
 * B = df/dnu: the projection onto y >= 0 in the metric in which B is the gradient of y. Newton's method makes a linear
 * complementarity problem of it, once where y and B are affine. Of y = C x + D nu impulses are those with D p >= 0 and p D
 * p = 0: the limit of small e of C x + (D + e C B) nu, with p = e nu, says which conditions take them (Camlibel, Iannelli
 * & Vasca 2014, Passivity and complementarity).
 *
 * Source: Moreau 1977, Evolution problem associated with a moving convex set; Acary & Brogliato 2008, chapter 2.
 */

/* Conditions of degree one, or all with ``every``; whether one of them is negative. */
static int find_jumping(Run *r, int every, int32_t *own, int *is_due) {
  int n = 0;
  *is_due = every;
  for (int i = 0; i < r->m; i++)
    if (has_law(r, i, COMPLEMENTARITY_LAW) && (every || degree_of(r, i) == 1)) own[n++] = i;
  if (!n) return 0;
  const double *h = surface_values(r, r->x), *scale = surface_scales(r, r->x);
  for (int i = 0; i < n; i++) *is_due |= h[own[i]] < 0 && fabs(h[own[i]]) > ON_SURFACE * scale[own[i]];
  return n;
}

/* The jump of impulses p at a point. */
static void impulses_at(Run *r, const double *x, const int32_t *own, int n, const double *p, double *change) {
  memset(r->lam, 0, sizeof(double) * r->width);
  for (int i = 0; i < n; i++) r->lam[own[i]] = p[i];
  memset(change, 0, sizeof(double) * r->n);
  add_impulses(r, x, r->letter, r->lam, change);
}

/* The inverse of the derivative of x - B(x) p by x, by differences, in ``inverse``; 0 where there is none. */
static int invert_change(Run *r, const int32_t *own, int n, const double *p, double *inverse) {
  int nd = r->s->dimension;
  double *a = inverse + (int64_t)nd * nd, *x = r->vector, *base = r->at_work, *moved = r->aside;
  memcpy(x, r->x, sizeof(double) * r->n);
  impulses_at(r, x, own, n, p, base);
  for (int j = 0; j < nd; j++) {
    double kept = x[j], step = DIFFERENCED * (r->size + fabs(kept));
    x[j] += step;
    impulses_at(r, x, own, n, p, moved);
    for (int i = 0; i < nd; i++) a[i * nd + j] = (i == j) - (moved[i] - base[i]) / (x[j] - kept);
    x[j] = kept;
  }
  return invert(a, nd, inverse);
}

/* One step of Newton's method to x = from + B(x) p, 0 <= y(x), p >= 0, y p = 0; whether x still changes, -1 where it
 * fails. */
static int step_jump(Run *r, const int32_t *own, int n, const double *from, double *p, int is_first) {
  const Entries *g = &r->s->surface_gradient;
  int nd = r->s->dimension, all = r->kept_rows, changes = 0;
  double *q = r->decision->block, *m = q + n, *k = r->jump_work, *columns = k + 2 * (int64_t)nd * nd, *change = r->at_work;
  double *rest = columns + (int64_t)n * nd, *rows = r->gradient_row, *one = r->small;
  if (!is_first && !invert_change(r, own, n, p, k)) return -1;
  for (int j = 0; j <= n; j++) { /* columns of B, then the residual */
    double *to = j < n ? columns + (int64_t)j * nd : rest;
    for (int i = 0; i < n; i++) one[i] = i == j;
    if (j < n) impulses_at(r, r->x, own, n, one, change);
    for (int i = 0; i < nd; i++) if (j == n) change[i] = from[i] - r->x[i];
    for (int i = 0; i < nd; i++) {
      to[i] = is_first ? change[i] : 0;
      for (int l = 0; l < nd && !is_first; l++) to[i] += k[i * nd + l] * change[l];
    }
  }
  const double *h = surface_values(r, r->x);
  memset(rows, 0, sizeof(double) * n * nd);
  for (int i = 0; i < n; i++) {
    for (int e = 0; e < g->count; e++)
      if (g->row[e] == own[i] && g->column[e] < nd) rows[i * nd + g->column[e]] = out_of(&r->s->surfaces, r->heights, all + e);
    q[i] = h[own[i]];
    for (int l = 0; l < nd; l++) q[i] += rows[i * nd + l] * rest[l];
    for (int j = 0; j < n; j++) {
      m[i * n + j] = 0;
      for (int l = 0; l < nd; l++) m[i * n + j] += rows[i * nd + l] * columns[(int64_t)j * nd + l];
    }
  }
  if (!lemke_scaled(m, q, n, p, r->decision->work, r->decision->pivot)) return -1;
  for (int i = 0; i < nd; i++) {
    for (int j = 0; j < n; j++) rest[i] += columns[(int64_t)j * nd + i] * p[j];
    changes |= !(fabs(rest[i]) <= VANISHES * (r->size + fabs(r->x[i])));
    r->x[i] += rest[i];
  }
  return finite_all(r->x, nd) ? changes : -1;
}

/* Impulses of the conditions and the state to which they lead, as r->x; 0 where there are none. */
static int find_jump(Run *r, const int32_t *own, int n, const double *from, double *p) {
  for (int steps = 0; steps < JUMP_STEPS; steps++) {
    int changes = step_jump(r, own, n, from, p, steps < 2);
    if (changes <= 0) return !changes;
  }
  return 0;
}

/* Letters of the conditions that take impulses, with e scaled so that e C B is ``share`` of D, or letters after an implicit
 * step of length e; 0 where there are none. */
static int find_taking(Run *r, const int32_t *own, int n, double share, int goes_on, int8_t *letter) {
  double *q = r->decision->block, *m = q + n, *nu = r->decision->large, of_d = 0, of_rates = 0;
  int w = r->width, count = 0;
  read_conditions(r, r->x);
  plain_rows(r, RATE_ROWS);
  error_scales(r, r->x, r->none, r->none);
  const double *h = surface_values(r, r->x);
  for (int i = 0; i < r->s->combined * w; i++) of_d = larger(fabs(r->equations.slope[i]), of_d);
  for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) of_rates = larger(fabs(r->slope[own[i] * w + own[j]]), of_rates);
  double e = of_rates > 0 ? of_d > 0 ? share * of_d / of_rates : 1 : 0;
  for (int i = 0; i < n; i++) {
    int is_given = degree_of(r, own[i]) == 0;
    q[i] = h[own[i]] + (goes_on ? e * layer_of(r, own[i]) : 0);
    for (int j = 0; j < n; j++)
      m[i * n + j] = e * r->slope[own[i] * w + own[j]] + (is_given ? r->equations.slope[count * w + own[j]] : 0);
    count += is_given;
  }
  if (!lemke_scaled(m, q, n, nu, r->decision->work, r->decision->pivot)) return 0;
  for (int i = 0; i < n; i++) letter[own[i]] = nu[i] > 0 ? 0 : 1;
  return 1;
}

/* Impulses of the closed conditions of ``letter``, to the zeros of their functions; 0 where they do not reach them. */
static int take_impulses(Run *r, const int8_t *letter, const int32_t *own, int n, const double *from, double *p) {
  double *a = r->work, *b = a + (int64_t)n * n, *change = r->at_work;
  int w = r->width, k = 0, *which = r->decision->order;
  for (int i = 0; i < n; i++) if (letter[own[i]] == 0) which[k++] = i;
  memset(p, 0, sizeof(double) * n);
  for (int steps = 0; steps < JUMP_STEPS && k; steps++) {
    double worst = 0, most = 0;
    combine_rows(r, letter, r->x);
    error_scales(r, r->x, r->none, r->none);
    const double *h = surface_values(r, r->x), *scale = surface_scales(r, r->x);
    for (int i = 0; i < k; i++) {
      int row = own[which[i]], is_given = degree_of(r, row) == 0, found = !is_given;
      double value = is_given ? 0 : h[row], size = scale[row];
      for (int j = 0; j < r->equations.count; j++) {
        if (r->equations.own[r->equations.row[j]] != row) continue;
        value = hidden_value(r, r->equations.row[j], h);
        size = hidden_scale(r, r->equations.row[j], scale);
        found = 1;
      }
      b[i] = value;
      if (found) worst = larger(fabs(value) / size, worst);
      for (int j = 0; j < k; j++) a[i * k + j] = r->slope[row * w + own[which[j]]];
    }
    if (worst <= (steps ? VANISHES : ON_SURFACE)) break;
    if (!solve_any(a, b, k, TIED, r->decision->work, r->decision->pivot)) return 0;
    for (int i = 0; i < k; i++) p[which[i]] -= b[i];
    impulses_at(r, r->x, own, n, p, change);
    for (int i = 0; i < r->s->dimension; i++) r->x[i] = from[i] + change[i];
    for (int i = 0; i < n; i++) most = larger(fabs(p[i]), most);
    for (int i = 0; i < n; i++) if (!(p[i] >= -TIED * most)) return 0;
  }
  return finite_all(r->x, r->n) && satisfies(r, letter);
}

/* The jump where closed conditions may leave equations of the states. */
static int find_hidden_jump(Run *r, const int32_t *own, int n, const double *from, double *p) {
  int8_t *letter = r->tried_letter;
  memcpy(letter, r->letter, r->width);
  for (double share = IMPULSIVE; share < WEAK; share *= IMPULSIVE_STEP) {
    if (find_taking(r, own, n, share, 0, letter) && take_impulses(r, letter, own, n, from, p)) return 1;
    memcpy(r->x, from, sizeof(double) * r->n);
  }
  return 0;
}

/* Choose the mode of a short implicit step as r->chosen, if it can continue: for too many modes to try all. */
static int follow_step(Run *r, const int8_t *letter, const Known *known, int known_count) {
  int32_t *own = r->decision->own;
  int8_t *trial = r->tried_letter;
  int due, n;
  Solutions all = {0};
  for (double share = IMPULSIVE; share < WEAK; share *= IMPULSIVE_STEP) {
    memcpy(trial, letter, r->width);
    n = find_jumping(r, 1, own, &due);
    if (!find_taking(r, own, n, share, 1, trial)) continue;
    lay_out(r, trial, &r->trial.l);
    mode_solutions(r, &r->trial.l, &all);
    if (all.count != 1) continue;
    memcpy(r->found.unknowns, all.each, sizeof(double) * r->width);
    if (!continues(r, trial, known, known_count, &r->found)) continue;
    choose_found(r);
    return 1;
  }
  return 0;
}

/* Jump to y >= 0 where a condition is negative; whether a jump occurred. The state before is r->jumped_from. */
static int become_consistent(Run *r) {
  int due, count = 0, is_hidden = r->s->combined > 0;
  int32_t *own = r->decision->own, *closed = r->involved;
  double *p = r->decision->large;
  int n = r->status == RUNNING ? find_jumping(r, is_hidden, own, &due) : 0;
  if (!n || !due) return 0;
  memcpy(r->jumped_from, r->x, sizeof(double) * r->n);
  if (!(is_hidden ? find_hidden_jump(r, own, n, r->jumped_from, p) : find_jump(r, own, n, r->jumped_from, p))) {
    memcpy(r->x, r->jumped_from, sizeof(double) * r->n);
    const double *h = surface_values(r, r->x);
    for (int i = 1; i < n; i++) if (h[own[i]] < h[own[0]]) own[0] = own[i];
    finish(r, INCONSISTENT, NO_JUMP, own[0]);
    return 0;
  }
  if (is_hidden && !memcmp(r->x, r->jumped_from, sizeof(double) * r->n)) return 0;
  for (int i = 0; i < n; i++) if (p[i] > 0 && keeps_height(r, own[i])) closed[count++] = own[i];
  project(r, closed, count);
  for (int i = 0; i < n && !count; i++) if (p[i] > 0) closed[count++] = own[i];
  r->guard = (Guard){SURFACE_GUARD, count ? closed[0] : own[0], 1};
  note(r);
  return 1;
}
