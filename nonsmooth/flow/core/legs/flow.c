/* Steps of a flow without events: nonsmooth/flow/fixed.py -------------------------------------------------- */

/* A smooth field of n states and functions monitored along it, as the outputs of one program. States of one group share an
 * error scale; those of group -1 are exact. Columns of derivatives by the start and by parameters follow the states; the
 * program's last outputs are entries of the field's derivatives by the states and those parameters, column after column. */
typedef struct {
  int32_t n, watched, order, groups, starts, columns;
  const int32_t *group;
  Series series;
  Entries derivatives;
} Field;

/* A flow in progress: series of the rules, the states, the monitored functions and the columns, and the remaining time. Of
 * the columns and of the field's derivatives: terms up to the last nonzero one. */
typedef struct {
  const Field *field;
  const double *p;
  double *rules, *states, *watched, *input, *columns;
  int32_t *terms, *bend;
  double whole, left, sign, tol;
  void *implicit; /* implicit_flow.c */
} Flow;

static Flow flow_of(const Field *f, const double *p, double duration, double tol, double *work) {
  int64_t stride = f->order + 1;
  Flow w = {.field = f, .p = p, .rules = work, .whole = fabs(duration), .left = fabs(duration)};
  w.sign = duration < 0 ? -1 : 1;
  w.tol = tol;
  w.states = work + series_room(&f->series, stride);
  w.watched = w.states + f->n * stride;
  w.input = w.watched + f->watched * stride;
  w.columns = w.input + f->n;
  w.terms = (int32_t *)(w.columns + (int64_t)f->columns * f->n * stride);
  w.bend = w.terms + f->columns * f->n;
  memset(w.rules, 0, sizeof(double) * series_room(&f->series, stride));
  series_prepare(&f->series, p, w.rules);
  return w;
}

/* The field at a state. */
static void field_at(Flow *w, const double *z, double *rate) {
  const Series *t = &w->field->series;
  int64_t stride = w->field->order + 1;
  series_inputs(t, 0, z, w->rules);
  series_values(t, t->moving.rule, t->moving.count, stride, w->rules);
  for (int i = 0; i < w->field->n; i++) rate[i] = w->rules[t->output[i]];
}

/* Series of a column of derivatives: sums of products with those of the field. */
static void expand_column(Flow *w, int column, const double *z) {
  const Field *f = w->field;
  const Entries *g = &f->derivatives;
  int n = f->n, order = f->order, moves = 0, count = 0;
  int64_t stride = order + 1;
  double *own = w->columns + column * n * stride;
  int32_t *terms = w->terms + column * n, *active = w->bend + g->count;
  memset(own, 0, sizeof(double) * n * stride);
  for (int i = 0; i < n; i++) {
    own[i * stride] = z[(column + 1) * n + i];
    moves |= terms[i] = own[i * stride] != 0;
  }
  for (int q = 0; q < g->count; q++) {
    int of_p = g->column[q] - n == column - f->starts;
    moves |= of_p;
    if (w->bend[q] && (g->column[q] < n || of_p)) active[count++] = q;
  }
  for (int k = 0; moves && k < order; k++) {
    for (int a = 0; a < count; a++) {
      int q = active[a], j = g->column[q];
      const double *c = w->rules + f->series.output[n + f->watched + q];
      own[g->row[q] * stride + k + 1] += j >= n ? c[k] : product_of(own + j * stride, terms[j], c, w->bend[q], k);
    }
    for (int i = 0; i < n; i++) {
      if (own[i * stride + k + 1] == 0) continue;
      own[i * stride + k + 1] *= PART[k + 1];
      terms[i] = k + 2;
    }
  }
}

/* Series of states and monitored functions at a state; whether they are finite. */
static int expand_flow(Flow *w, const double *z) {
  const Field *f = w->field;
  const Series *t = &f->series;
  int n = f->n, order = f->order;
  int64_t stride = order + 1;
  for (int i = 0; i < n; i++) w->states[i * stride] = z[i];
  for (int k = 0; k < order + (f->watched > 0); k++) {
    for (int i = 0; i < n; i++) w->input[i] = w->states[i * stride + k];
    series_inputs(t, k, w->input, w->rules);
    if (k) series_rules(t, &t->later, k, k, stride, w->rules);
    else series_values(t, t->moving.rule, t->moving.count, stride, w->rules);
    if (k < order)
      for (int i = 0; i < n; i++) w->states[i * stride + k + 1] = w->rules[t->output[i] + k] * PART[k + 1];
    for (int j = 0; j < f->watched; j++) w->watched[j * stride + k] = w->rules[t->output[n + j] + k];
  }
  for (int q = 0; q < f->derivatives.count; q++)
    w->bend[q] = terms_of(w->rules + t->output[n + f->watched + q], order);
  for (int column = 0; column < f->columns; column++) expand_column(w, column, z);
  double zero = 0;
  for (int64_t i = 0; i < n * stride; i++) zero += 0 * w->states[i];
  for (int64_t i = 0; i < f->columns * n * stride; i++) zero += 0 * w->columns[i];
  return zero == 0;
}

/* Step for which the last two terms of series with one scale stay below the tolerance. States that are zero up to rounding,
 * compared with their terms of second to fifth order along the leg, ``early``, have no scale. */
static double scaled_step(const Flow *w, double size, double rate, double early, double before, double final) {
  double scale = larger(size, rate * w->whole), allowed = w->tol * scale, h = INFINITY;
  int order = w->field->order;
  if (allowed == 0 || scale < TINY_VALUE * early) return h;
  if (final > 0) h = pow(allowed / final, 1.0 / order);
  if (before > 0) h = smaller(pow(allowed / before, 1.0 / (order - 1)), h);
  return h;
}

/* Sum of the terms of second to fifth order of a series at the end of a leg. */
static double early_terms(const Flow *w, const double *own) {
  double early = 0, power = w->whole;
  for (int k = 2; k <= 5; k++) early = larger(fabs(own[k]) * (power *= w->whole), early);
  return early;
}

/* Step for a range of columns, whose moving parts share one scale. */
static double column_steps(const Flow *w, int from, int to) {
  int order = w->field->order;
  double size = 0, rate = 0, early = 0, before = 0, final = 0;
  for (int64_t i = (int64_t)from * w->field->n; i < (int64_t)to * w->field->n; i++) {
    const double *own = w->columns + i * (order + 1);
    if (w->terms[i] < 2) continue;
    size = larger(fabs(own[0]), size);
    rate = larger(fabs(own[1]), rate);
    early = larger(early_terms(w, own), early);
    before = larger(fabs(own[order - 1]), before);
    final = larger(fabs(own[order]), final);
  }
  return scaled_step(w, size, rate, early, before, final);
}

/* Length of the next step; zero or negative where it is too small. */
static double flow_step(const Flow *w) {
  const Field *f = w->field;
  int order = f->order;
  double h = INFINITY;
  for (int g = 0; g < f->groups; g++) {
    double size = 0, rate = 0, early = 0, before = 0, final = 0;
    for (int i = 0; i < f->n; i++) {
      const double *own = w->states + (int64_t)i * (order + 1);
      if (f->group[i] != g) continue;
      size = larger(fabs(own[0]), size);
      rate = larger(fabs(own[1]), rate);
      early = larger(early_terms(w, own), early);
      before = larger(fabs(own[order - 1]), before);
      final = larger(fabs(own[order]), final);
    }
    h = smaller(scaled_step(w, size, rate, early, before, final), h);
  }
  for (int j = 0; j < f->watched; j++) { /* a guard may vary where the states rest */
    const double *own = w->watched + (int64_t)j * (order + 1);
    h = smaller(scaled_step(w, fabs(own[0]), fabs(own[1]), early_terms(w, own), fabs(own[order - 1]), fabs(own[order])), h);
  }
  h = smaller(column_steps(w, 0, f->starts), smaller(column_steps(w, f->starts, f->columns), h));
  if (!(h > FIXED_SHORTEST * w->whole)) return 0;
  /* Two equal steps rather than a long and a short one. */
  if (h >= w->left) return w->left;
  return w->left < 1.5 * h ? smaller(h, 0.5 * w->left) : h;
}

/* Move z by a step. */
static void advance_flow(Flow *w, double h, double *z) {
  const Field *f = w->field;
  int order = f->order;
  for (int64_t i = 0; i < (int64_t)f->n * (1 + f->columns); i++) {
    const double *c = i < f->n ? w->states + i * (order + 1) : w->columns + (i - f->n) * (order + 1);
    double x = w->sign * h;
    int k = i < f->n ? order : w->terms[i - f->n] - 1;
    double sum = k < 0 ? 0 : c[k];
    for (k--; k >= 0; k--) sum = sum * x + c[k];
    z[i] = sum;
  }
  w->left -= h;
}

static void run_flow(Flow *w, double *z, int64_t most_steps) {
  for (int64_t step = 0; step < most_steps && w->left > 0; step++) {
    double h = expand_flow(w, z) ? flow_step(w) : 0;
    if (!(h > 0)) return;
    advance_flow(w, h, z);
  }
}

/* Legs and the events at their ends. One array has, at the given offsets: parameters, so many of each leg or, with 0, of all;
 * rows for each leg of its state (width), duration, field at its start and at its end (width each), and outputs of the
 * event's program at its end (results); then room for work. A leg without a program ends at a time. */
typedef struct {
  int64_t count, width, results, parameters, states, durations, before, after, events, work;
  const Field *const *field;
  const Values *const *event;
} Legs;

static int64_t integrate_legs(const Legs *l, double *a, double tol, int64_t most_steps, double *left,
                              void (*run)(Flow *w, double *z, int64_t most_steps)) {
  for (int64_t i = 0; i < l->count; i++) {
    const Values *e = l->event[i];
    double *z = a + l->states + i * l->width, *found = a + l->events + i * l->results, *work = a + l->work;
    const double *p = a + i * l->parameters;
    Flow w = flow_of(l->field[i], p, a[l->durations + i], tol, work);
    field_at(&w, z, a + l->before + i * l->width);
    run(&w, z, most_steps);
    *left = w.left;
    if (w.left > 0 || w.left != w.left) return i;
    field_at(&w, z, a + l->after + i * l->width);
    if (!e) continue;
    memset(work, 0, sizeof(double) * e->size);
    values_prepare(e, p, work);
    values_run(e, z, p, work);
    for (int k = 0; k < e->output_count; k++) found[k] = work[e->output[k]];
  }
  return -1;
}
