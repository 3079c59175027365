/* Flows of known durations that decay faster than they change: implicit steps, with columns of derivatives.
 */

/* A flow, the collocation of its field, derivatives of the field at a stage, columns, values of what is watched. */
typedef struct {
  Flow *w;
  Collocation c;
  double *at_stage, *watched;
  const double *y;
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
  return finite_all(all, n * width) && finite_all(jacobian, n * n);
}

static int flow_jacobian_at(void *of, int stage, const double *x, double *jacobian) {
  ImplicitFlow *m = of;
  (void)stage;
  return flow_jacobian(m->w, x, m->at_stage, m->c.work, jacobian);
}

static size_t place_flow(ImplicitFlow *m, char *base) {
  const Field *f = m->w->field;
  size_t n = f->n, s = m->c.method->s, width = n + f->columns - f->starts, used = place_collocation(&m->c, base, 0);
  m->at_stage = DOUBLES(n * width);
  m->watched = DOUBLES(2 * s * f->watched);
  return used;
}

/* Rates of all columns at a stage, of which the derivatives are known. */
static void push_flow(void *with, int stage, const double *x, double *rates, int64_t apart) {
  const ImplicitFlow *m = with;
  const Field *f = m->w->field;
  int n = f->n, width = n + f->columns - f->starts;
  (void)stage, (void)x;
  for (int column = 0; column < f->columns; column++)
    for (int i = 0; i < n; i++) {
      const double *row = m->at_stage + (int64_t)i * width, *y = m->y + (int64_t)column * n;
      double rate = column < f->starts ? 0 : row[n + column - f->starts];
      for (int l = 0; l < n; l++) rate += row[l] * y[l];
      rates[column * apart + i] = rate;
    }
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

static void end_flow(Flow *w) {
  ImplicitFlow *m = w->implicit;
  if (m) free(m->memory);
  free(m);
  w->implicit = 0;
}

/* Whether a decay rate holds a step of the flow; steps are implicit then. */
static int begin_flow(Flow *w, const double *z, double h) {
  const Field *f = w->field;
  ImplicitFlow *m = calloc(1, sizeof(ImplicitFlow));
  if (!m) return 0;
  m->w = w;
  m->c = (Collocation){.method = RADAU + 1, .n = f->n, .moving = f->n, .rtol = IMPLICIT_FLOW};
  m->c.of = m;
  m->c.rate_at = flow_rate_at;
  m->c.jacobian_at = flow_jacobian_at;
  m->memory = calloc(1, place_flow(m, 0));
  if (!m->memory) { free(m); return 0; }
  place_flow(m, m->memory);
  w->implicit = m;
  if (flow_jacobian_at(m, 0, z, m->c.jacobian) && begin_lengths(&m->c, h, w->tol)) return 1;
  end_flow(w);
  return 0;
}

/* Series of what is watched, through its values at the stages. */
static void interpolate_watched(ImplicitFlow *m, const double *z, double h) {
  const Flow *w = m->w;
  const Field *f = w->field;
  int s = m->c.method->s, stride = f->order + 1;
  double *values = m->watched, *x = m->c.work;
  for (int i = 0; i <= s; i++) {
    for (int k = 0; k < f->n; k++) x[k] = z[k] + (i ? m->c.z[(i - 1) * f->n + k] : 0);
    series_inputs(&f->series, 0, x, w->rules);
    series_values(&f->series, f->series.values.rule, f->series.values.count, stride, w->rules);
    for (int j = 0; j < f->watched; j++) {
      double value = w->rules[f->series.output[f->n + j]], *begun = w->watched + (int64_t)j * stride;
      if (i) values[(i - 1) * f->watched + j] = value - *begun; else *begun = value;
    }
  }
  interpolate(m->c.method, values, f->watched, h, stride, w->watched);
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
  if (f->order < RADAU[1].s || RADAU[1].s * f->n > MOST_STATES / 2 || !begin_flow(w, z, h)) return h;
  double longer = implicit_flow_step(w, z);
  if (longer > 0) return longer;
  end_flow(w);
  return expand_flow(w, z) ? h : 0;
}

/* Move z by a step. */
static void make_step(Flow *w, double h, double *z) {
  ImplicitFlow *m = w->implicit;
  if (!m) { advance_flow(w, h, z); return; }
  m->y = z + w->field->n;
  if (w->field->columns && !move_through_stages(&m->c, h, w->field->columns, z + w->field->n, m, push_flow)) z[0] = NAN;
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
