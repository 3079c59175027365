/* Columns of derivatives along legs of known duration: nonsmooth/flow/variation.py.
 *
 * A leg is one mode, in which nothing is decided. Columns are derivatives of the states by the start and by
 * parameters. The program of a step gives series of its outputs' derivatives too, once for all columns; multipliers
 * of sliding follow by the inverse that the step has. Sets off which the mode is carry h along, so that close to them
 * its direction has all its digits. Neighbours of a state on a set reach the set at once: B M^-1 h is added to their
 * columns.
 */

/* A leg: columns, each a row of n derivatives of the state and one of its parameters. */
typedef struct {
  int32_t columns, hit, kind, index, side; /* hit: the first function of the set that is reached at its end, or -1; then the guard that ends it */
  double duration, tol, left; /* left: of the duration, where it is stuck */
  int64_t most_steps;
  const double *p, *dp;
  const int8_t *letter;
  double *x, *y;
  double *start_rate, *end_rate, *gradient; /* gradient: of the event's function by states, then by parameters */
} Leg;

/* Columns on their way: h of sets (m each), series of states and of unknowns (h is carried there). Of the column that
 * is derived: series by what the program is derived by, with as many terms as are not zero; sums of an order. */
typedef struct {
  double *h, *states, *series, *sum, *dp;
  const double **of;
  int32_t *terms, *bend, *active, count; /* bend: terms of the program's derivatives; active: those that count */
  int8_t *late; /* whether that is an unknown of sliding, or the direction in which a set is left */
} Columns;

enum { LEG_DONE, LEG_STUCK, LEG_NOT_UNIQUE };

static const double *derivative_row(const Run *r, int q) {
  return row_of(r, r->n + 3 * r->width + r->s->rules.atoms + r->s->slope_outputs + q);
}

/* Whether an output's derivative is needed: by the series, and at a point also surfaces, gaps and factors. */
static int is_wanted(const Run *r, const Expansion *e, int row, int at_point) {
  if (row < r->n || row >= r->n + r->width) return row < r->n || at_point;
  int letter = e->l.letter[row - r->n];
  return letter == 0 || letter == LEAVING || letter == LEFT_BEHIND;
}

/* What the program's derivatives are multiplied with, of a column, and those that count. */
static void aim_column(const Run *r, const Expansion *e, const Expansion *d, const double *dp, Columns *c, int at_point) {
  const Entries *g = &r->s->derivatives;
  int size = moving_size(r), stride = r->stride;
  for (int j = 0; j < size + r->s->parameters; j++) {
    int i = j < r->n || j >= size ? -1 : unknown_at(r, j), letter = i < 0 ? 1 : e->l.letter[i];
    c->of[j] = 0;
    c->late[j] = letter == 0 || letter == LEAVING;
    c->terms[j] = j >= size && dp[j - size] != 0;
    if (j < r->n) c->of[j] = d->states + (int64_t)j * stride;
    else if (j >= size) c->of[j] = c->terms[j] ? dp + j - size : 0;
    else if (i >= 0 && is_moving(r, i)) c->of[j] = d->lambda + (int64_t)i * stride;
    else if (letter == 0) c->of[j] = d->series + (int64_t)i * stride;
  }
  c->count = 0;
  for (int q = 0; q < g->count; q++)
    if (c->of[g->column[q]] && c->bend[q] && is_wanted(r, e, g->row[q], at_point)) c->active[c->count++] = q;
}

/* Sums of order k: derivatives of field, layer, surfaces and gaps, factors along the column. */
static void derive(const Run *r, const Columns *c, int k) {
  const Entries *g = &r->s->derivatives;
  int size = moving_size(r);
  memset(c->sum, 0, sizeof(double) * (r->n + 3 * r->width));
  for (int j = 0; j < size; j++) if (c->of[j] && c->of[j][k] != 0) c->terms[j] = k + 1;
  for (int a = 0; a < c->count; a++) {
    int q = c->active[a], j = g->column[q];
    c->sum[g->row[q]] += product_of(c->of[j], c->terms[j], derivative_row(r, q), c->bend[q], k);
  }
}

/* Add what coefficients k of unknowns do that were zero. */
static void derive_late(const Run *r, const Columns *c, int k) {
  const Entries *g = &r->s->derivatives;
  for (int a = 0; a < c->count; a++) {
    int q = c->active[a], j = g->column[q];
    if (!c->late[j] || c->of[j][k] == 0) continue;
    c->sum[g->row[q]] += derivative_row(r, q)[0] * c->of[j][k];
    c->terms[j] = k + 1;
  }
}

/* Coefficient k of the derivative of h/|h| from that of h. */
static void turn_direction(Run *r, const Expansion *e, Expansion *d, int f, int k) {
  int size = size_of(r, f), stride = r->stride;
  const double *length = e->root + (int64_t)f * stride;
  double *root = d->root + (int64_t)f * stride, sum = 0;
  for (int i = f; i < f + size; i++) {
    double *own = d->apart + (int64_t)i * stride;
    own[k] = d->series[(int64_t)i * stride + k] * e->per_radius[f];
    sum += convolve(e->apart + (int64_t)i * stride, own, k, 0, k);
  }
  root[k] = sum - convolve(length, root, k, 1, k);
  for (int i = f; i < f + size; i++) {
    double *u = d->lambda + (int64_t)i * stride;
    u[k] = d->apart[(int64_t)i * stride + k] - convolve(e->lambda + (int64_t)i * stride, root, k, 0, k)
           - convolve(length, u, k, 1, k);
  }
}

/* Coefficients k of the derivatives of directions in which sets are left, with those of what slides. */
static void turn_leaving(Run *r, const Expansion *e, Expansion *d, const Columns *c, int k) {
  int slides = e->l.slides, stride = r->stride, n, all = leaving_matrix(r, e, k, &n), at = slides, column = n;
  const int32_t *which = r->pending;
  double *a = r->work, *b = a + (int64_t)all * all;
  for (int i = 0; i < n; i++) b[i] = -c->sum[r->n + which[i]];
  EACH_SET(r, f) {
    int size = size_of(r, f), last = k < r->order ? k + 1 : k;
    if (e->l.letter[f] != LEAVING) continue;
    const double *radius = e->rates + (int64_t)f * (stride + 1), *change = d->rates + (int64_t)f * (stride + 1);
    b[column] = 0;
    for (int i = f; i < f + size; i++, at++) {
      const double *u = e->lambda + (int64_t)i * stride, *own = d->lambda + (int64_t)i * stride;
      b[at] += (k + 1) * (convolve(own, radius, k + 1, 0, k - 1) + convolve(u, change, k + 1, 1, last));
      b[column] -= convolve(u, own, k, 1, k);
    }
    column++;
  }
  if (!solve(a, b, all)) for (int i = 0; i < all; i++) b[i] = NAN;
  for (int i = 0; i < slides; i++) d->series[(int64_t)which[i] * stride + k] = b[i];
  for (int i = slides; i < n; i++) d->lambda[(int64_t)which[i] * stride + k] = b[i];
  EACH_SET(r, f)
    if (e->l.letter[f] == LEAVING) d->rates[(int64_t)f * (stride + 1) + k + 1] = b[n++];
}

/* Coefficients k of the derivatives of multipliers of sliding. */
static void turn_sliding(const Run *r, const Expansion *e, Expansion *d, const Columns *c, int k) {
  int slides = e->l.slides;
  for (int i = 0; i < slides; i++) {
    double sum = 0;
    for (int j = 0; j < slides; j++) {
      double a = e->inverse[i * slides + j];
      if (a != 0) sum += a * c->sum[r->n + e->l.sliding[j]];
    }
    d->series[(int64_t)e->l.sliding[i] * r->stride + k] = -sum;
  }
}

/* Coefficients k + 1 of the derivatives of states and of h. */
static void next_terms(const Run *r, const Expansion *e, Expansion *d, const Columns *c, int k) {
  int stride = r->stride;
  double part = 1.0 / (k + 1);
  for (int i = 0; i < r->n; i++) d->states[(int64_t)i * stride + k + 1] = c->sum[i] * part;
  for (int i = 0; i < r->m; i++) {
    int letter = e->l.letter[i];
    double *h = d->series + (int64_t)i * stride + k + 1;
    if (letter == LEFT_BEHIND) *h = c->sum[r->n + i] * part;
    if (letter != LEAVING) continue;
    int64_t s = (int64_t)set_of(r, i) * (stride + 1);
    *h = convolve(d->lambda + (int64_t)i * stride, e->rates + s, k + 1, 0, k)
         + convolve(e->lambda + (int64_t)i * stride, d->rates + s, k + 1, 0, k + 1);
  }
}

/* Coefficients of a column to an order, from the first of states and of h; sums of the last order. */
static void column_series(Run *r, const Expansion *e, Expansion *d, const double *dp, Columns *c, int order) {
  int leaving = 0, stride = r->stride;
  EACH_SET(r, f) {
    if (e->l.letter[f] != LEAVING) continue;
    double *change = d->rates + (int64_t)f * (stride + 1);
    leaving = 1;
    change[0] = 0;
    for (int i = f; i < f + size_of(r, f); i++)
      change[0] += e->lambda[(int64_t)i * stride] * d->series[(int64_t)i * stride];
  }
  if (r->s->sets) memset(d->lambda, 0, sizeof(double) * r->m * stride);
  aim_column(r, e, d, dp, c, order == 0);
  for (int k = 0; k <= order; k++) {
    EACH_SET(r, f)
      if (e->l.letter[f] == LEFT_BEHIND) turn_direction(r, e, d, f, k);
    derive(r, c, k);
    if (leaving) turn_leaving(r, e, d, c, k); else turn_sliding(r, e, d, c, k);
    if (leaving || e->l.slides) derive_late(r, c, k);
    if (k < r->order) next_terms(r, e, d, c, k);
  }
}

/* A column as the beginning of its series. */
static Expansion column_of(Run *r, const Columns *c, int k, const double *y) {
  int n = r->n, w = r->width, stride = r->stride;
  Expansion d = r->trial;
  d.states = c->states + (int64_t)k * n * stride;
  d.series = c->series + (int64_t)k * w * stride;
  memset(d.series, 0, sizeof(double) * w * stride);
  for (int i = 0; i < n; i++) d.states[(int64_t)i * stride] = y ? y[i] : 0;
  for (int i = 0; i < r->m; i++) d.series[(int64_t)i * stride] = c->h[k * r->m + i];
  return d;
}

/* Derivatives of h of the sets at the start, and columns from which what leads off sets is taken. */
static void land(Run *r, const Leg *l, Columns *c) {
  const Expansion *e = &r->e;
  const Entries *g = &r->s->derivatives;
  int n = r->n, slides = e->l.slides;
  for (int k = 0; k < l->columns && r->s->sets; k++) {
    double *y = l->y + k * n, *h = c->h + k * r->m;
    memset(h, 0, sizeof(double) * r->m);
    Expansion d = column_of(r, c, k, y);
    memset(d.lambda, 0, sizeof(double) * r->m * r->stride);
    aim_column(r, e, &d, l->dp + k * r->s->parameters, c, 1);
    derive(r, c, 0);
    for (int i = 0; i < r->m; i++) if (set_of(r, i) >= 0) h[i] = c->sum[n + r->width + i];
    for (int i = 0; i < slides; i++)
      for (int j = 0; j < slides; j++)
        if (set_of(r, e->l.sliding[j]) >= 0)
          d.series[(int64_t)e->l.sliding[i] * r->stride] -= e->inverse[i * slides + j] * h[e->l.sliding[j]];
    for (int a = 0; a < c->count; a++) {
      int q = c->active[a], j = g->column[q];
      if (c->late[j] && g->row[q] < n) y[g->row[q]] += derivative_row(r, q)[0] * c->of[j][0];
    }
    for (int i = 0; i < r->m; i++) if (e->l.letter[i] == 0) h[i] = 0;
  }
}

/* The longest step for which the last two terms of columns stay below the tolerance: a part of them, or of what they
 * change by; what multipliers of sliding cancel counts, as its rounding stays. */
static double column_step(const Run *r, const Leg *l, const Columns *c, int first, int count) {
  const Entries *g = &r->s->derivatives;
  int n = r->n, w = r->width, size = moving_size(r), order = r->order, stride = r->stride;
  double most = 0, rate = 0, before = 0, last = 0, h = INFINITY;
  for (int64_t i = (int64_t)first * n; i < (int64_t)(first + count) * n; i++) {
    const double *own = c->states + i * stride;
    most = larger(fabs(own[0]), most);
    rate = larger(fabs(own[1]), rate);
    before = larger(fabs(own[order - 1]), before);
    last = larger(fabs(own[order]), last);
  }
  for (int q = 0; q < g->count && r->e.l.slides; q++) {
    int i = g->row[q] < n && g->column[q] >= n && g->column[q] < size ? unknown_at(r, g->column[q]) : -1;
    double push = i >= 0 && r->letter[i] == 0 ? fabs(derivative_row(r, q)[0]) : 0;
    if (!(push > 0 && push < INFINITY)) continue;
    for (int64_t k = first; k < first + count; k++) rate = larger(push * fabs(c->series[(k * w + i) * stride]), rate);
  }
  double allowed = l->tol * larger(most, rate * l->duration);
  if (last > 0) h = pow(allowed / last, 1.0 / order);
  if (before > 0) h = smaller(pow(allowed / before, 1.0 / (order - 1)), h);
  return h;
}

/* The derivative of the event's function by a column whose first terms are known. */
static double event_slope(const Run *r, const Leg *l, const Expansion *d, const Columns *c) {
  const Expansion *e = &r->e;
  int n = r->n, w = r->width, stride = r->stride, own = l->index;
  double sum = 0;
  if (l->hit >= 0) {
    for (int i = l->hit; i < l->hit + size_of(r, l->hit); i++) sum += e->lambda[(int64_t)i * stride] * c->sum[n + w + i];
    return sum;
  }
  const double *unknown = d->series + (int64_t)own * stride;
  double factor = c->sum[n + 2 * w + own];
  if (l->kind == RELEASE_GUARD) return unknown[0];
  if (l->kind == EXIT_GUARD && is_idle(r, e->l.letter, own)) return -l->side * c->sum[n + own];
  if (l->kind == EXIT_GUARD)
    return turn_of(r, own, row_of(r, n + 2 * w + own), r->order + 1) * (factor - l->side * unknown[0]);
  for (int i = 0; i < size_of(r, own); i++)
    sum -= 2 * e->series[(int64_t)(own + i) * stride] * unknown[(int64_t)i * stride];
  return sum + 2 * factor * row_of(r, n + 2 * w + own)[0];
}

/* The gradient of the event's function by states and parameters. */
static void event_gradient(Run *r, const Leg *l, Columns *c) {
  const Expansion *e = &r->e;
  int n = r->n, q = r->s->parameters;
  memset(c->h, 0, sizeof(double) * r->m);
  for (int k = 0; k < n + q; k++) {
    for (int i = 0; i < q; i++) c->dp[i] = i == k - n;
    Expansion d = column_of(r, c, 0, 0);
    if (k < n) d.states[(int64_t)k * r->stride] = 1;
    if (r->s->sets) { /* h that is carried */
      memset(d.lambda, 0, sizeof(double) * r->m * r->stride);
      aim_column(r, e, &d, c->dp, c, 1);
      derive(r, c, 0);
      for (int i = 0; i < r->m; i++)
        if (e->l.letter[i] == LEFT_BEHIND) d.series[(int64_t)i * r->stride] = c->sum[n + r->width + i];
    }
    column_series(r, e, &d, c->dp, c, 0);
    l->gradient[k] = event_slope(r, l, &d, c);
  }
}

/* The mode of a leg at its start: sets off which it is carry h. 0 where its unknowns are not unique. */
static int begin_leg(Run *r, const Leg *l) {
  Solutions all = {0};
  memcpy(r->x, l->x, sizeof(double) * r->n);
  set_time_state(r);
  memcpy(r->letter, l->letter, r->width);
  find_idle(r);
  const double *h = surface_values(r, r->x);
  EACH_SET(r, f) {
    if (r->letter[f] == 0) continue;
    int k = size_of(r, f), stays = r->idle[f] && !(length_of(h + f, k) > 0); /* friction that a parameter may bring acts */
    for (int i = f; i < f + k; i++) {
      r->letter[i] = stays ? IDLE : r->letter[i] == OFF ? LEFT_BEHIND : LEAVING;
      r->unknowns[i] = h[i];
    }
  }
  lay_out(r, r->letter, &r->now);
  mode_solutions(r, &r->now, &all);
  if (all.count > 1) keep_stable(r, &r->now, &all);
  if (all.count != 1) return 0;
  memcpy(r->unknowns, all.each, sizeof(double) * r->width);
  return 1;
}

/* Move state, unknowns and columns by a step. */
static void move_columns(Run *r, const Leg *l, const Columns *c, double dt) {
  const Expansion *e = &r->e;
  int n = r->n, w = r->width, m = r->m, order = r->order, stride = r->stride;
  for (int i = 0; i < n; i++) r->x[i] = value_at(e->states + (int64_t)i * stride, order, dt);
  for (int i = 0; i < w; i++) r->unknowns[i] = value_at(e->series + (int64_t)i * stride, order, dt);
  for (int64_t k = 0; k < l->columns; k++) {
    for (int i = 0; i < n; i++) l->y[k * n + i] = value_at(c->states + (k * n + i) * stride, order, dt);
    for (int i = 0; i < m; i++)
      if (set_of(r, i) >= 0 && r->letter[i]) c->h[k * m + i] = value_at(c->series + (k * w + i) * stride, order, dt);
  }
  for (int i = 0; i < m; i++) if (r->letter[i] == LEAVING) r->letter[i] = LEFT_BEHIND;
  lay_out(r, r->letter, &r->now);
  improve(r, &r->now, r->x, r->unknowns, 2);
}

/* Whether a set is so close that nothing is left of the way to it. */
static int has_arrived(const Run *r, int f, double *most) {
  int k = size_of(r, f);
  double rate[3], radius = length_of(r->unknowns + f, k);
  for (int i = 0; i < k; i++) rate[i] = r->e.series[(int64_t)(f + i) * r->stride + 1];
  *most = larger(radius, *most);
  return r->letter[f] == LEFT_BEHIND && radius < larger(ARRIVED * *most, TENFOLD * shortest(r) * length_of(rate, k));
}

/* A step that is no longer than until |h| of a set has fallen tenfold. */
static double near_step(const Run *r, int f, double h) {
  const Expansion *e = &r->e;
  for (int row = 0; row < e->l.rows; row++) {
    if (e->l.kind[row] != NEAR_GUARD || e->l.index[row] != f || r->letter[f] == LEAVING) continue;
    double root = first_root(e->guards + (int64_t)row * r->stride, r->order, h);
    if (root > 0) return root;
  }
  return h;
}

static int carry(Run *r, Leg *l, Columns *c) {
  double most = 0, size = 0;
  Expansion *e = &r->e;
  l->left = l->duration;
  if (!begin_leg(r, l)) return LEG_NOT_UNIQUE;
  for (int64_t step = 0; step < l->most_steps; step++) {
    for (int i = 0; i < r->s->dimension; i++) size = larger(fabs(r->x[i]), size);
    r->o.atol = r->o.rtol * (size > 0 ? size : 1);
    r->size = size;
    r->time_size = l->duration;
    expand(r, r->letter, r->x, r->unknowns, e);
    for (int i = 0; i < r->s->dimension; i++)
      size = larger(fabs(e->states[(int64_t)i * r->stride + 1]) * l->duration, size);
    for (int i = 0; i < r->n; i++) l->end_rate[i] = e->states[(int64_t)i * r->stride + 1];
    if (!finite_all(l->end_rate, r->n)) return LEG_STUCK;
    for (int q = 0; q < r->s->derivatives.count; q++) c->bend[q] = terms_of(derivative_row(r, q), r->stride);
    if (step == 0) {
      memcpy(l->start_rate, l->end_rate, sizeof(double) * r->n);
      land(r, l, c);
    }
    if (l->hit < 0 ? l->left <= 0 : has_arrived(r, l->hit, &most)) {
      memcpy(l->x, r->x, sizeof(double) * r->n);
      if (r->s->timed) l->x[r->n - 1] += r->t;
      if (l->gradient) event_gradient(r, l, c);
      return LEG_DONE;
    }
    if (!e->finite) return LEG_STUCK;
    for (int k = 0; k < l->columns; k++) {
      Expansion d = column_of(r, c, k, l->y + k * r->n);
      column_series(r, e, &d, l->dp + k * r->s->parameters, c, r->order);
    }
    double h = step_size(r, e);
    h = smaller(h, column_step(r, l, c, 0, r->n)); /* those by the start, those by parameters */
    h = smaller(h, column_step(r, l, c, r->n, l->columns - r->n));
    if (!(h > (l->hit < 0 ? FIXED_SHORTEST * l->duration : 0))) return LEG_STUCK;
    if (l->hit >= 0) h = near_step(r, l->hit, smaller(h, l->duration));
    else h = h >= l->left ? l->left : l->left < 1.5 * h ? smaller(h, 0.5 * l->left) : h;
    move_columns(r, l, c, h);
    l->left -= h;
  }
  return LEG_STUCK;
}


/* Carry state and columns of a leg to its end: LEG_DONE, or why not. */
int32_t carry_columns(Run *r, Leg *l) {
  const System *s = r->s;
  int64_t count = l->columns > 0 ? l->columns : 1, inputs = moving_size(r) + s->parameters, entries = s->derivatives.count;
  int64_t doubles = count * (r->m + (int64_t)(r->n + r->width) * r->stride) + r->n + 3 * r->width + s->parameters;
  char *memory = calloc(doubles * 8 + inputs * (sizeof(double *) + 5) + entries * 8, 1);
  if (!memory) return LEG_STUCK;
  Columns c = {.h = (double *)memory};
  c.states = c.h + count * r->m;
  c.series = c.states + count * r->n * r->stride;
  c.sum = c.series + count * r->width * r->stride;
  c.dp = c.sum + r->n + 3 * r->width;
  c.of = (const double **)(c.dp + s->parameters);
  c.terms = (int32_t *)(c.of + inputs);
  c.bend = c.terms + inputs;
  c.active = c.bend + entries;
  c.late = (int8_t *)(c.active + entries);
  Options o = {.rtol = l->tol / SAFETY, .atol = l->tol};
  clear(r, &o, (Pair){s->timed ? l->x[r->n - 1] : 0, 0});
  set_parameters(r, l->p);
  int status = carry(r, l, &c);
  free(memory);
  return status;
}
