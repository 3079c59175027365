/* Implicit steps of legs of known duration, for stiff systems (implicit.c).
 * Rows are pulled back through the transposed equations of the stages.
 */

/* Whether a decay rate limits steps of this length, so that implicit ones are tried. */
static int is_step_held(Run *r, const Leg *l, double h) {
  if (l->duration < 0 || !r->s->implicit || !can_collocate(r) || r->order < RADAU[1].s || RADAU[1].s * r->n > MOST_STATES / 2) return 0;
  if (!(l->left > FAR_AWAY * h) || !begin_implicit(r)) return 0;
  Collocation *c = &r->implicit->c;
  memcpy(r->implicit->unknowns, r->unknowns, sizeof(double) * r->width);
  if (!jacobian_at_stage(r, 0, r->x, c->jacobian)) return 0;
  c->rtol = IMPLICIT_FLOW;
  return begin_lengths(c, h, l->tol);
}

/* Solve for the stages of a step from the expansion at its start; its length, or 0. */
static double solve_step(Run *r, const Leg *l, double most) {
  Collocation *c = &r->implicit->c;
  begin_stages(r, &r->e);
  double size = largest_of(r->x, c->moving), rate = largest_of(c->start_rate, c->moving);
  for (int i = 0; i < c->moving; i++) c->weight[i] = c->rtol * (size > 0 ? size : rate > 0 ? rate * l->duration : 1);
  return collocate(c, most, FIXED_SHORTEST * l->duration);
}

/* Values and slopes at a stage. */
static void expand_stage(Run *r, const double *x, const double *unknowns, Slopes *g) {
  expand_first(r, x, unknowns, &r->e);
  measure_slopes(r, &r->e, g, 0);
}

/* A leg within an implicit step that begins at a time since its start. */
typedef struct { Run *r; Leg *l; Slopes *g; double begun; } Stages;

static void push_at_stage(void *with, int stage, const double *x, double *rates, int64_t apart) {
  const Stages *of = with;
  Run *r = of->r;
  const double *unknowns = r->implicit->unknowns + (stage + 1) * r->width;
  record(r, of->l, 0, of->begun, -1, x, unknowns);
  expand_stage(r, x, unknowns, of->g);
  for (int k = 0; k < of->l->columns; k++) {
    begin_column(r, of->l, of->g, k);
    column_series(r, &r->e, of->g, 0);
    for (int j = 0; j < r->n; j++) rates[k * apart + j] = of->g->v->sum[(int64_t)j * r->stride];
  }
}

/* Advance state and columns by the step with known stages; 0 where that is not possible. */
static int move_implicit(Run *r, Leg *l, Slopes *g, double h, double begun) {
  Implicit *m = r->implicit;
  Stages of = {r, l, g, begun};
  record(r, l, h, begun, m->c.method->s, r->x, r->unknowns);
  int is_solved = move_through_stages(&m->c, h, l->columns, l->y, &of, push_at_stage);
  memcpy(r->x, m->c.end, sizeof(double) * r->n);
  memcpy(r->unknowns, m->unknowns + m->c.method->s * r->width, sizeof(double) * r->width);
  go_on_from(&m->c, 1);
  return is_solved;
}

/* Pull a row back from the end of a recorded implicit step, with samples there, to its start; 0 where that fails. */
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
    is_solved = add_stage(&r->implicit->c, i, at, row[0], 1, matrix);
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
