/* Flows of known durations that decay faster than they change: implicit steps, with columns of derivatives.
 *
 * Columns are the exact derivatives of the discrete step: (A/h - J) dz = J y at the stages, each with its own J.
 */

/* A flow, the collocation of its field, and of a step with columns: derivatives of the field at the stages, the matrix
 * of all stages with its pivots, a column's changes at the stages. */
typedef struct {
  Flow *w;
  Collocation c;
  int32_t *pivot;
  double *at_stages, *matrix, *changes;
  void *memory;
} ImplicitFlow;

/* The field's derivatives by the states, and by parameters (behind, for each column by one). */
static void flow_derivatives(const Flow *w, double *to) {
  const Field *f = w->field;
  const Entries *g = &f->derivatives;
  int n = f->n, width = n + f->columns - f->starts;
  memset(to, 0, sizeof(double) * n * width);
  for (int q = 0; q < g->count; q++)
    if (g->column[q] < width)
      to[(int64_t)g->row[q] * width + g->column[q]] = w->rules[f->series.output[n + f->watched + q]];
}

static int flow_rate_at(void *of, int stage, const double *x, double *rate) {
  ImplicitFlow *m = of;
  (void)stage;
  field_at(m->w, x, rate);
  return finite_all(rate, m->c.n);
}

/* The field's derivative by the states where the program has it, else differences: it only steers Newton's method. */
static int flow_jacobian(Flow *w, const double *x, double *all, double *work, double *jacobian) {
  const Field *f = w->field;
  int n = f->n, width = n + f->columns - f->starts;
  double *rate = work, *moved = work + n, *there = moved + n, most = 0;
  field_at(w, x, rate);
  flow_derivatives(w, all);
  for (int i = 0; i < n; i++) {
    memcpy(jacobian + i * n, all + (int64_t)i * width, sizeof(double) * n);
    most = larger(fabs(x[i]), most);
  }
  memcpy(there, x, sizeof(double) * n);
  for (int k = 0; k < n && !f->derivatives.count; k++) {
    double by = sqrt(EPSILON) * larger(fabs(x[k]), ROOT_SHARE * most > 0 ? ROOT_SHARE * most : 1);
    there[k] = x[k] + by;
    field_at(w, there, moved);
    for (int i = 0; i < n; i++) jacobian[i * n + k] = (moved[i] - rate[i]) / (there[k] - x[k]);
    there[k] = x[k];
  }
  return finite_all(jacobian, n * n);
}

static int flow_jacobian_at(void *of, int stage, const double *x, double *jacobian) {
  ImplicitFlow *m = of;
  (void)stage;
  return flow_jacobian(m->w, x, m->at_stages, m->c.work, jacobian);
}

static size_t place_flow(ImplicitFlow *m, char *base) {
  const Field *f = m->w->field;
  size_t n = f->n, s = m->c.method->s, width = n + f->columns - f->starts, used = place_collocation(&m->c, base, 0);
  m->at_stages = DOUBLES(s * n * width);
  m->matrix = DOUBLES(f->columns ? s * n * s * n : 0);
  m->changes = DOUBLES(2 * s * (n > (size_t)f->watched ? n : (size_t)f->watched));
  m->pivot = INTEGERS(s * n);
  return used;
}

/* Move all columns by the step whose stages are known; 0 where that is not possible. */
static int move_flow_columns(ImplicitFlow *m, double h, double *z) {
  const Field *f = m->w->field;
  const Radau *t = m->c.method;
  int n = f->n, s = t->s, size = s * n, width = n + f->columns - f->starts;
  if (!f->columns) return 1;
  for (int i = 0; i < s; i++) {
    double *x = m->c.work;
    for (int k = 0; k < n; k++) x[k] = m->c.x[k] + m->c.z[i * n + k];
    field_at(m->w, x, m->c.rates);
    flow_derivatives(m->w, m->at_stages + (int64_t)i * n * width);
  }
  if (!finite_all(m->at_stages, size * width)) return 0;
  memset(m->matrix, 0, sizeof(double) * size * size);
  for (int i = 0; i < s; i++)
    for (int k = 0; k < n; k++) {
      double *row = m->matrix + (int64_t)(i * n + k) * size;
      for (int j = 0; j < s; j++) row[j * n + k] = t->slopes[i * s + j] / h;
      for (int l = 0; l < n; l++) row[i * n + l] -= m->at_stages[(int64_t)(i * n + k) * width + l];
    }
  if (!factor_real(m->matrix, size, size - 1, m->pivot)) return 0;
  for (int column = 0; column < f->columns; column++) {
    double *y = z + (int64_t)(column + 1) * n;
    for (int i = 0; i < size; i++) {
      const double *row = m->at_stages + (int64_t)i * width;
      m->changes[i] = column < f->starts ? 0 : row[n + column - f->starts];
      for (int l = 0; l < n; l++) m->changes[i] += row[l] * y[l];
    }
    solve_real(m->matrix, size, size - 1, m->pivot, m->changes);
    for (int k = 0; k < n; k++) y[k] += m->changes[(s - 1) * n + k];
  }
  return 1;
}

/* Scales of errors: of a group of states its size. */
static void weigh_flow(ImplicitFlow *m, const double *z) {
  const Field *f = m->w->field;
  for (int i = 0; i < f->n; i++) {
    double size = 0, rate = 0;
    for (int j = 0; j < f->n; j++)
      if (f->group[j] == f->group[i]) {
        size = larger(fabs(z[j]), size);
        rate = larger(fabs(m->c.start_rate[j]), rate);
      }
    m->c.weight[i] = f->group[i] < 0 ? INFINITY : m->c.rtol * (size > 0 ? size : rate > 0 ? rate * m->w->whole : 1);
  }
}

/* Implicit steps from one of a length on; 0 where there is no memory. */
static int begin_flow(Flow *w, double h) {
  const Field *f = w->field;
  ImplicitFlow *m = calloc(1, sizeof(ImplicitFlow));
  if (!m) return 0;
  m->w = w;
  m->c = (Collocation){.method = RADAU + 1, .n = f->n, .moving = f->n, .rtol = IMPLICIT_FLOW, .h = h, .error = 1};
  m->c.of = m;
  m->c.rate_at = flow_rate_at;
  m->c.jacobian_at = flow_jacobian_at;
  m->memory = calloc(1, place_flow(m, 0));
  if (!m->memory) { free(m); return 0; }
  place_flow(m, m->memory);
  w->implicit = m;
  return 1;
}

static void end_flow(Flow *w) {
  ImplicitFlow *m = w->implicit;
  if (!m) return;
  free(m->memory);
  free(m);
  w->implicit = 0;
}

/* Series of what is watched, through its values at the stages. */
static void interpolate_watched(ImplicitFlow *m, const double *z, double h) {
  const Flow *w = m->w;
  const Field *f = w->field;
  int s = m->c.method->s, stride = f->order + 1;
  double *values = m->changes, *x = m->c.work;
  for (int i = 0; i <= s; i++) {
    for (int k = 0; k < f->n; k++) x[k] = z[k] + (i ? m->c.z[(i - 1) * f->n + k] : 0);
    series_inputs(&f->series, 0, x, w->rules);
    series_values(&f->series, f->series.values.rule, f->series.values.count, stride, w->rules);
    for (int j = 0; j < f->watched; j++) {
      double value = w->rules[f->series.output[f->n + j]], *begun = w->watched + (int64_t)j * stride;
      if (i) values[(i - 1) * f->watched + j] = value - *begun; else *begun = value;
    }
  }
  powers_of(m->c.method, values, f->watched, values + s * f->watched);
  write_powers(m->c.method, values + s * f->watched, f->watched, h, stride, w->watched);
}

/* The length of an implicit step, whose polynomials are those of the flow; 0 where there is none. */
static double implicit_flow_step(Flow *w, const double *z) {
  ImplicitFlow *m = w->implicit;
  const Field *f = w->field;
  if (!flow_rate_at(m, 0, z, m->c.start_rate)) return 0;
  memcpy(m->c.x, z, sizeof(double) * f->n);
  weigh_flow(m, z);
  double h = collocate(&m->c, w->left, FIXED_SHORTEST * w->whole);
  if (h == 0 || !f->watched) return h;
  for (int i = 0; i < f->n; i++) w->states[(int64_t)i * (f->order + 1)] = z[i];
  write_powers(m->c.method, m->c.powers, f->n, h, f->order + 1, w->states);
  interpolate_watched(m, z, h);
  return h;
}

/* Whether a decay rate holds a step of the flow. */
static int is_held(Flow *w, const double *z, double h) {
  const Field *f = w->field;
  int n = f->n, width = n + f->columns - f->starts;
  double *all = calloc((int64_t)n * width + (int64_t)n * n + 5 * n, sizeof(double)), rho = 0;
  if (!all) return 0;
  double *jacobian = all + (int64_t)n * width;
  Collocation c = {.n = n, .fast = jacobian + n * n, .work = jacobian + n * n + n};
  if (flow_jacobian(w, z, all, c.work, jacobian)) rho = fastest(&c, jacobian, 8);
  free(all);
  return h * rho > HELD_PART * (3 - 0.5 * log10(w->tol));
}

/* The length of the next step, of the kind that costs less; not above zero where there is none. */
static double next_step(Flow *w, const double *z, int64_t step) {
  const Field *f = w->field;
  int is_whole = f->columns == 0 || (f->derivatives.count > 0 && f->starts == f->n);
  if (w->implicit) {
    double h = implicit_flow_step(w, z);
    if (h > 0) return h;
    end_flow(w);
  }
  double h = expand_flow(w, z) ? flow_step(w) : 0;
  if (step % LOOK_AGAIN < LOOK_AGAIN - 1 || !(w->left > FAR_AWAY * h) || w->sign < 0 || !is_whole) return h;
  if (f->order < RADAU[1].s || RADAU[1].s * f->n > MOST_STATES / 2 || !is_held(w, z, h) || !begin_flow(w, EIGHTFOLD * h)) return h;
  double longer = implicit_flow_step(w, z);
  if (longer > 0) return longer;
  end_flow(w);
  return expand_flow(w, z) ? h : 0;
}

/* Move z by a step. */
static void make_step(Flow *w, double h, double *z) {
  ImplicitFlow *m = w->implicit;
  if (!m) { advance_flow(w, h, z); return; }
  if (!move_flow_columns(m, h, z)) z[0] = NAN;
  else memcpy(z, m->c.end, sizeof(double) * w->field->n);
  go_on_from(&m->c, 1);
  w->left = h == w->left ? 0 : w->left - h;
}

/* A flow to its end, by the steps that cost less. */
static void run_whole_flow(Flow *w, double *z, int64_t most_steps) {
  for (int64_t step = 0; step < most_steps && w->left > 0; step++) {
    double h = next_step(w, z, step);
    if (!(h > 0)) break;
    make_step(w, h, z);
  }
  end_flow(w);
}
