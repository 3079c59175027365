/* Implicit steps of a run, for stiff systems.
 *
 * Sliding multipliers follow from the layer in every stage. The polynomial through the stages replaces the Taylor
 * polynomial; guards are interpolated at the same nodes. A step with an event is repeated with the event as its end, so
 * that the event is a stage.
 */

/* Collocation; multipliers and guards at the stages; the program of the field's derivatives and parts of it. Counts: limited
 * Taylor steps to wait for, consecutive implicit steps that cost more, implicit steps, events before the present leg; modes
 * in which steps are implicit. */
struct Implicit {
  Collocation c;
  int32_t wait, idle, steps, is_end_known, modes;
  int64_t leg;
  int8_t *known;
  double *unknowns, *guards, *program, *layer, *by_unknown, *slope, *inverse;
  void *arena;
};

/* Coefficients of a row of that program. */
static int stride_of_implicit(const Run *r) { return r->s->implicit == &r->s->series ? r->stride : 1; }

static size_t place_implicit(Implicit *m, const Run *r, char *base) {
  size_t n = r->n, w = r->width, s = m->c.method->s, used = place_collocation(&m->c, base, 0);
  m->unknowns = DOUBLES((s + 1) * w);
  m->guards = DOUBLES(2 * s * (w > (size_t)r->guards ? w : (size_t)r->guards));
  m->program = DOUBLES(r->s->implicit ? series_room(r->s->implicit, stride_of_implicit(r)) : 0);
  m->layer = DOUBLES(w * n);
  m->by_unknown = DOUBLES(w * n);
  m->slope = DOUBLES(w * w);
  m->inverse = DOUBLES(w * w);
  return used;
}

/* Field and its derivatives ---------------------------------------------------------------------------------- */

static int rate_at_stage(void *of, int stage, const double *x, double *rate) {
  Run *r = of;
  const Expansion *e = &r->e;
  double *unknowns = r->implicit->unknowns + stage * r->width;
  if (!improve(r, &e->l, x, unknowns, 2)) return 0;
  evaluate(r, e, x, unknowns);
  for (int i = 0; i < r->n; i++) rate[i] = row_of(r, i)[0];
  return finite_all(rate, r->n);
}

/* The field's derivative by differences, where there is no program: only Newton's method uses it. */
static int differences(Run *r, int stage, const double *x, double *jacobian) {
  int n = r->n;
  double *rate = r->implicit->c.work, *moved = rate + n, *there = moved + n, most = largest_of(x, n);
  if (!rate_at_stage(r, stage, x, rate)) return 0;
  memcpy(there, x, sizeof(double) * n);
  for (int k = 0; k < n; k++) {
    there[k] = x[k] + sqrt(EPSILON) * larger(fabs(x[k]), ROOT_SHARE * most > 0 ? ROOT_SHARE * most : 1);
    if (!rate_at_stage(r, stage, there, moved)) return 0;
    for (int i = 0; i < n; i++) jacobian[i * n + k] = (moved[i] - rate[i]) / (there[k] - x[k]);
    there[k] = x[k];
  }
  return finite_all(jacobian, n * n);
}

/* The field's derivative by the states, with sliding multipliers as their functions. */
static int jacobian_at_stage(void *of, int stage, const double *x, double *jacobian) {
  Run *r = of;
  Implicit *m = r->implicit;
  const Layout *l = &r->e.l;
  const double *unknowns = m->unknowns + stage * r->width;
  const Series *t = r->s->implicit;
  const Entries *g = &r->s->derivatives;
  int n = r->n, w = r->width, slides = l->slides, size = moving_size(r), *where = r->pending;
  int first = n + 3 * w + r->s->rules.atoms + r->s->slope_outputs;
  if (!g->count) return differences(r, stage, x, jacobian);
  for (int i = 0; i < w; i++) where[i] = -1;
  for (int i = 0; i < slides; i++) where[l->sliding[i]] = i;
  aim(r, l->letter, x, unknowns);
  set_inputs(r, x, held_of(r, l->letter), unknowns);
  series_at(t, &t->values, 0, stride_of_implicit(r), r->input, m->program);
  memset(jacobian, 0, sizeof(double) * n * n);
  memset(m->layer, 0, sizeof(double) * slides * n);
  memset(m->by_unknown, 0, sizeof(double) * slides * n);
  memset(m->slope, 0, sizeof(double) * slides * slides);
  for (int q = 0; q < g->count; q++) {
    int row = g->row[q], column = g->column[q], i = row < n ? -1 : row < n + w ? where[row - n] : -1;
    if (column >= size || (row >= n && i < 0)) continue;
    int unknown = column < n ? -1 : unknown_at(r, column), j = unknown < 0 ? -1 : where[unknown];
    if (column >= n && j < 0) continue;
    double value = m->program[t->output[first + q]];
    if (!isfinite(value)) return 0;
    if (row < n && column < n) jacobian[(int64_t)row * n + column] = value;
    else if (row < n) m->by_unknown[j * n + row] += value;
    else if (column < n) m->layer[i * n + column] = value;
    else m->slope[i * slides + j] += value;
  }
  if (!slides) return 1;
  if (!invert(m->slope, slides, m->inverse)) return 0;
  for (int i = 0; i < slides; i++)
    for (int j = 0; j < slides; j++) {
      double part = m->inverse[i * slides + j];
      for (int a = 0; a < n && part != 0; a++) {
        double push = m->by_unknown[i * n + a] * part;
        if (push != 0) for (int b = 0; b < n; b++) jacobian[(int64_t)a * n + b] -= push * m->layer[j * n + b];
      }
    }
  return 1;
}

/* Evaluate the parts that depend on parameters only. */
static void prepare_implicit(Run *r) {
  if (!r->implicit || !r->s->implicit) return;
  series_prepare(r->s->implicit, r->p, r->implicit->program);
  pairs_begin(r->s->implicit->size, stride_of_implicit(r), r->begun, r->implicit->program);
}

/* Allocate implicit steps; 0 where that fails. */
static int begin_implicit(Run *r) {
  Implicit *m = r->implicit;
  if (m) return 1;
  m = calloc(1, sizeof(Implicit));
  if (!m) return 0;
  m->c = (Collocation){.method = RADAU + (r->o.rtol < SEVEN_STAGES && r->order >= 7), .n = r->n};
  m->c.moving = r->s->dimension;
  m->c.ordering = r->s->ordering;
  m->c.of = r;
  m->c.rtol = r->o.rtol;
  m->c.rate_at = rate_at_stage;
  m->c.jacobian_at = jacobian_at_stage;
  m->arena = calloc(1, place_implicit(m, r, 0));
  if (!m->arena) { free(m); return 0; }
  place_implicit(m, r, m->arena);
  r->implicit = m;
  prepare_implicit(r);
  m->wait = HELD_STEPS;
  m->leg = -1;
  return 1;
}

static void end_implicit(Run *r) {
  if (!r->implicit) return;
  free(r->implicit->known);
  free(r->implicit->arena);
  free(r->implicit);
  r->implicit = 0;
}

/* Polynomials ------------------------------------------------------------------------------------------------ */

/* The guards' series, through their values at the stages. */
static void interpolate_guards(Run *r, Expansion *e, double h) {
  Implicit *m = r->implicit;
  const Radau *t = m->c.method;
  int n = r->n, s = t->s, w = r->width, rows = e->l.rows;
  double *values = m->guards, *x = m->c.work;
  for (int i = 0; i < s; i++) {
    double *unknowns = m->unknowns + (i + 1) * w;
    for (int k = 0; k < n; k++) x[k] = e->states[(int64_t)k * r->stride] + m->c.z[i * n + k];
    evaluate(r, e, x, unknowns);
    const double *g = guards_at(r, e, unknowns);
    for (int row = 0; row < rows; row++)
      values[i * rows + row] = g[(int64_t)row * r->stride] - e->guards[(int64_t)row * r->stride];
  }
  interpolate(t, values, rows, h, r->stride, e->guards);
}

/* Series of states, of unknowns and of guards. */
static void write_step(Run *r, Expansion *e, double h) {
  Implicit *m = r->implicit;
  const Radau *t = m->c.method;
  int n = r->n, s = t->s, w = r->width;
  double *values = m->guards;
  write_powers(t, m->c.powers, n, h, r->stride, e->states);
  for (int i = 0; i < w; i++) e->series[(int64_t)i * r->stride] = r->unknowns[i];
  for (int i = 0; i < s; i++)
    for (int k = 0; k < w; k++) values[i * w + k] = m->unknowns[(i + 1) * w + k] - r->unknowns[k];
  interpolate(t, values, w, h, r->stride, e->series);
  interpolate_guards(r, e, h);
  e->end = m->c.end;
}

/* Whether guards that may vanish agree with their polynomials between the stages. */
static int guards_agree(Run *r, Expansion *e, double h) {
  Implicit *m = r->implicit;
  const Radau *t = m->c.method;
  double *x = r->vector, *unknowns = x + r->n;
  scales(r, e);
  for (int gap = 1; gap < 4; gap++) {
    double time = 0.5 * h * (t->nodes[gap] + t->nodes[gap + 1]);
    at_time(r, e, time, x, unknowns);
    if (!improve(r, &e->l, x, unknowns, 2)) return 0;
    evaluate(r, e, x, unknowns);
    const double *g = guards_at(r, e, unknowns);
    for (int q = 0; q < e->l.bent_count; q++) {
      int row = e->l.bent[q];
      const double *c = e->guards + (int64_t)row * r->stride;
      double of_guard = e->of_guards[row] + SAFETY * r->o.rtol * fabs(c[0]), least = fabs(c[0]);
      double miss = fabs(g[(int64_t)row * r->stride] - value_at(c, r->order, time));
      for (int i = 0; i < t->s; i++) least = smaller(fabs(value_at(c, r->order, h * t->nodes[i])), least);
      if (!(miss <= WRONG * of_guard + VANISHES * e->scale[row] || TENFOLD * miss < least)) return 0;
    }
  }
  return 1;
}

/* A step ------------------------------------------------------------------------------------------------------ */

/* Values and first coefficients of a mode. */
static void expand_first(Run *r, const double *x, const double *unknowns, Expansion *e) {
  int order = r->order;
  r->order = 1;
  expand(r, r->letter, x, unknowns, e);
  r->order = order;
}

/* Begin a step from the present state with a known expansion. */
static void begin_stages(Run *r, const Expansion *e) {
  Implicit *m = r->implicit;
  memcpy(m->c.x, r->x, sizeof(double) * r->n);
  for (int k = 0; k <= m->c.method->s; k++) memcpy(m->unknowns + k * r->width, r->unknowns, sizeof(double) * r->width);
  for (int i = 0; i < r->n; i++) m->c.start_rate[i] = e->states[(int64_t)i * r->stride + 1];
}

/* Begin a step: first coefficients of guards, tolerances, the field. */
static int begin_step(Run *r, Expansion *e) {
  Collocation *m = &r->implicit->c;
  expand_first(r, r->x, r->unknowns, e);
  if (!e->finite) return 0;
  begin_stages(r, e);
  for (int i = 0; i < r->s->dimension; i++) m->weight[i] = r->o.atol + r->o.rtol * fabs(r->x[i]);
  return 1;
}

/* Make a step from the present state; its length, or 0. */
static double implicit_step(Run *r, Expansion *e, double most) {
  Implicit *m = r->implicit;
  if (!begin_step(r, e)) return 0;
  for (int again = 0; again < SHORTENED; again++) {
    double h = collocate(&m->c, most, SHORTEST * time_scale(r));
    m->is_end_known = 1;
    if (h == 0) return 0;
    write_step(r, e, h);
    if (guards_agree(r, e, h)) return h;
    m->c.h = 0.5 * h;
    m->c.rejected = 1;
  }
  return 0;
}

/* Repeat the step with the length at which a guard is zero, or with a given length. */
static int end_at(Run *r, Expansion *e, int row, double *dt) {
  Implicit *m = r->implicit;
  Collocation *c = &m->c;
  int n = r->n, s = c->method->s;
  int is_exact = row < 0 || (is_atom(e->l.kind[row]) && clock_of(r, row - e->l.atoms) >= 0);
  double time = *dt, slope = 0, before = 0, at = 0, *unknowns = m->unknowns + s * r->width;
  if (!is_exact) horner(e->guards + (int64_t)row * r->stride, r->order, time, &slope);
  for (int again = 0; again < POLISHED + 3; again++) {
    if (!try_length(c, time)) return 0;
    for (int k = 0; k < n; k++) c->end[k] = c->x[k] + c->z[(s - 1) * n + k];
    if (is_exact || slope == 0) break;
    evaluate(r, e, c->end, unknowns);
    double value = guards_at(r, e, unknowns)[(int64_t)row * r->stride];
    if (again && value != before) slope = (value - before) / (time - at);
    double change = value / slope;
    before = value;
    at = time;
    if (!(fabs(change) < 0.5 * time) || fabs(change) <= SOLVED * (time_scale(r) + time)) break;
    time -= change;
  }
  powers_of(c->method, c->z, n, c->powers);
  write_step(r, e, time);
  c->length = time;
  m->is_end_known = 0;
  *dt = time;
  return 1;
}
