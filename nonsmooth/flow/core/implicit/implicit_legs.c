/* Implicit steps of legs of known duration, where a motion decays faster than it changes (implicit.c).
 *
 * Columns are the exact derivatives of the discrete step: (A/h - J) dz = J y at the stages, each with its own J; rows are
 * pulled back through the transposed equations.
 */

/* Whether a decay rate holds steps of such a length, so that implicit ones are tried. */
static int is_step_held(Run *r, const Leg *l, double h) {
  if (l->duration < 0 || !r->s->implicit || !can_collocate(r) || r->order < RADAU[1].s || RADAU[1].s * r->n > MOST_STATES / 2) return 0;
  if (!(l->left > FAR_AWAY * h) || !begin_implicit(r)) return 0;
  Collocation *c = &r->implicit->c;
  memcpy(r->implicit->unknowns, r->unknowns, sizeof(double) * r->width);
  if (!jacobian_at_stage(r, 0, r->x, c->jacobian)) return 0;
  if (!(h * fastest(c, c->jacobian, 8) > HELD_PART * (3 - 0.5 * log10(l->tol)))) return 0;
  c->rtol = IMPLICIT_FLOW;
  c->h = EIGHTFOLD * h;
  c->length = 0;
  c->is_fresh = 0;
  c->error = 1;
  return 1;
}

/* Solve for the stages of a step from the expansion at its start; its length, or 0. */
static double solve_step(Run *r, const Leg *l, double most) {
  Implicit *m = r->implicit;
  Collocation *c = &m->c;
  double size = 0, rate = 0;
  memcpy(c->x, r->x, sizeof(double) * r->n);
  for (int k = 0; k <= c->method->s; k++) memcpy(m->unknowns + k * r->width, r->unknowns, sizeof(double) * r->width);
  for (int i = 0; i < r->n; i++) c->start_rate[i] = r->e.states[(int64_t)i * r->stride + 1];
  for (int i = 0; i < c->moving; i++) {
    size = larger(fabs(r->x[i]), size);
    rate = larger(fabs(c->start_rate[i]), rate);
  }
  for (int i = 0; i < c->moving; i++) c->weight[i] = c->rtol * (size > 0 ? size : rate > 0 ? rate * l->duration : 1);
  return collocate(c, most, FIXED_SHORTEST * l->duration);
}

/* Add A/h - J of a stage to the matrix of all, or to its transpose. */
static int add_stage(Run *r, const Radau *t, int stage, const double *x, double h, int transposed, double *matrix) {
  int n = r->n, size = t->s * n;
  double *jacobian = r->implicit->c.jacobian;
  if (!jacobian_at_stage(r, stage + 1, x, jacobian)) return 0;
  for (int k = 0; k < n; k++) {
    int64_t own = stage * n + k, row = transposed ? 1 : size, column = transposed ? size : 1;
    for (int j = 0; j < t->s; j++) matrix[own * row + (j * n + k) * column] += t->slopes[stage * t->s + j] / h;
    for (int l = 0; l < n; l++) matrix[own * row + (stage * n + l) * column] -= jacobian[k * n + l];
  }
  return 1;
}

/* Values and slopes at a stage. */
static void expand_stage(Run *r, const double *x, const double *unknowns, Slopes *g) {
  int order = r->order;
  r->order = 1;
  expand(r, r->letter, x, unknowns, &r->e);
  r->order = order;
  measure_slopes(r, &r->e, g, 0);
}

/* Move state and columns by the step whose stages are known; 0 where that is not possible. */
static int move_implicit(Run *r, Leg *l, Slopes *g, double h, double begun) {
  Implicit *m = r->implicit;
  const Radau *t = m->c.method;
  int n = r->n, s = t->s, size = s * n, is_solved = 1;
  double *matrix = calloc((int64_t)size * size + (int64_t)l->columns * size + n + size, sizeof(double));
  if (!matrix) return 0;
  double *change = matrix + (int64_t)size * size, *x = change + (int64_t)l->columns * size;
  int32_t *pivot = (int32_t *)(x + n);
  record(r, l, h, begun, s, r->x, r->unknowns);
  for (int i = 0; i < s && is_solved; i++) {
    double *unknowns = m->unknowns + (i + 1) * r->width;
    for (int k = 0; k < n; k++) x[k] = m->c.x[k] + m->c.z[i * n + k];
    record(r, l, 0, begun, -1, x, unknowns);
    is_solved = add_stage(r, t, i, x, h, 0, matrix);
    expand_stage(r, x, unknowns, g);
    for (int k = 0; k < l->columns; k++) {
      begin_column(r, l, g, k);
      column_series(r, &r->e, g, 0);
      for (int j = 0; j < n; j++) change[(int64_t)k * size + i * n + j] = g->v->sum[(int64_t)j * r->stride];
    }
  }
  is_solved = is_solved && factor_real(matrix, size, size - 1, pivot);
  for (int k = 0; k < l->columns && is_solved; k++) {
    double *own = change + (int64_t)k * size;
    solve_real(matrix, size, size - 1, pivot, own);
    for (int i = 0; i < n; i++) l->y[k * n + i] += own[(s - 1) * n + i];
  }
  memcpy(r->x, m->c.end, sizeof(double) * n);
  memcpy(r->unknowns, m->unknowns + s * r->width, sizeof(double) * r->width);
  go_on_from(&m->c, 1);
  free(matrix);
  return is_solved;
}

/* From the end of a recorded implicit step, and samples there, to its start; 0 where that is not possible. */
static int pull_implicit(Run *r, Leg *l, Slopes *g, const double *row, int64_t *sample) {
  const Variation *v = g->v;
  const Radau *t = RADAU + 1;
  int n = r->n, s = t->s, size = s * n, is_solved = 1;
  double *matrix = calloc((int64_t)size * size + 2 * size, sizeof(double));
  if (!matrix || !begin_implicit(r)) { free(matrix); return 0; }
  double *own = matrix + (int64_t)size * size;
  int32_t *pivot = (int32_t *)(own + size);
  lay_out(r, r->letter, &r->e.l);
  for (; *sample > 0 && is_within(l, row[1], l->sample_t[*sample - 1]); --*sample)
    for (int i = 0; i < n; i++) l->row[i] += l->at_samples[(*sample - 1) * n + i];
  for (int i = 0; i < s && is_solved; i++) {
    const double *at = row + (i + 1) * row_width(r) + 3;
    memcpy(r->implicit->unknowns + (i + 1) * r->width, at + n, sizeof(double) * r->width);
    is_solved = add_stage(r, t, i, at, row[0], 1, matrix);
  }
  memcpy(own + (s - 1) * n, l->row, sizeof(double) * n);
  is_solved = is_solved && factor_real(matrix, size, size - 1, pivot);
  if (is_solved) solve_real(matrix, size, size - 1, pivot, own);
  for (int i = 0; i < s && is_solved; i++) {
    const double *at = row + (i + 1) * row_width(r) + 3;
    expand_stage(r, at, at + n, g);
    clear_variation(v);
    for (int k = 0; k < n; k++) v->sum[(int64_t)k * r->stride] = own[i * n + k];
    pull_series(r, &r->e, g, 0);
    for (int k = 0; k < n; k++) l->row[k] += v->states[(int64_t)k * r->stride];
  }
  free(matrix);
  return is_solved;
}
