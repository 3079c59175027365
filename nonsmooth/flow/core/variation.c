/* Columns of derivatives along legs of known duration: nonsmooth/flow/variation.py.
 *
 * A leg is one mode, in which nothing is decided. Columns are derivatives of the states by the start and by
 * parameters. Beside the series of a step each has those of the tangent program, with multipliers of sliding by the
 * inverse that the step has. Sets off which the mode is carry h along, so that close to them its direction has all
 * its digits. Neighbours of a state on a set reach the set at once: B M^-1 h is added to their columns.
 */

/* What a leg begins with: columns, each a row of n derivatives of the state and one of its parameters. */
typedef struct {
  int32_t columns, hit, kind, index, side; /* the set that is reached at its end, by its first function, or -1; the guard that ends it */
  double duration, tol, left; /* left: of the duration, where it is stuck */
  int64_t most_steps;
  const double *p, *dp;
  const int8_t *letter;
  double *x, *y;
  double *start_rate, *end_rate, *time_row; /* time_row: of the event's time by states, then by parameters */
} Leg;

/* Columns on their way: h of sets (m each), series of states and of unknowns (h is carried there). */
typedef struct { double *h, *states, *series; } Columns;

enum { LEG_DONE, LEG_STUCK, LEG_NOT_UNIQUE };

static int moving_size(const Run *r) {
  int size = r->n + r->width;
  for (int i = 0; i < r->m; i++) size += is_scaled(r, i) != 0;
  return size;
}

static const double *tangent_row(const Run *r, int output) {
  return r->series + (int64_t)r->s->tangent.output[output] * r->stride;
}

/* Coefficient k of a column as the inputs of the tangent program. */
static void tangent_inputs(Run *r, const Expansion *d, int k, const double *dp) {
  int n = r->n, w = r->width, stride = r->stride, size = moving_size(r);
  double *x = r->vector, *unknown = x + n, *of_p = r->input + 2 * size;
  for (int i = 0; i < n; i++) x[i] = d->states[(int64_t)i * stride + k];
  for (int i = 0; i < w; i++) unknown[i] = d->series[(int64_t)i * stride + k];
  for (int i = 0; i < w; i++) r->later[i] = is_moving(r, i) ? d->lambda[(int64_t)i * stride + k] : 0;
  inputs_at(r, r->input + size, x, r->later, unknown);
  for (int i = 0; i < r->s->parameters; i++) of_p[i] = k ? 0 : dp[i];
}

static void tangent_rules(Run *r, const Expansion *d, int k, const double *dp, int late) {
  const Series *t = &r->s->tangent;
  tangent_inputs(r, d, k, dp);
  if (late) series_at(t, t->late, t->late_count, k, r->stride, r->input, r->series);
  else if (k) series_at(t, t->later, t->later_count, k, r->stride, r->input, r->series);
  else series_at(t, t->moving, t->moving_count, k, r->stride, r->input, r->series);
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
static void turn_leaving(Run *r, const Expansion *e, Expansion *d, int k) {
  int slides = e->l.slides, stride = r->stride, n, all = leaving_matrix(r, e, k, &n), at = slides, column = n;
  const int32_t *which = r->pending;
  double *a = r->work, *b = a + (int64_t)all * all;
  for (int i = 0; i < n; i++) b[i] = -tangent_row(r, r->n + which[i])[k];
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

/* Coefficients k + 1 of the derivatives of states and of h. */
static void next_terms(Run *r, const Expansion *e, Expansion *d, int k) {
  int stride = r->stride;
  for (int i = 0; i < r->n; i++) d->states[(int64_t)i * stride + k + 1] = tangent_row(r, i)[k] / (k + 1);
  for (int i = 0; i < r->m; i++) {
    int letter = e->l.letter[i];
    double *h = d->series + (int64_t)i * stride + k + 1;
    if (letter == LEFT_BEHIND) *h = tangent_row(r, r->n + i)[k] / (k + 1);
    if (letter != LEAVING) continue;
    int64_t s = (int64_t)set_of(r, i) * (stride + 1);
    *h = convolve(d->lambda + (int64_t)i * stride, e->rates + s, k + 1, 0, k)
         + convolve(e->lambda + (int64_t)i * stride, d->rates + s, k + 1, 0, k + 1);
  }
}

/* Coefficients of a column to an order, from the first of states and of h. */
static void tangent_series(Run *r, const Expansion *e, Expansion *d, const double *dp, int order) {
  int slides = e->l.slides, leaving = 0, stride = r->stride;
  EACH_SET(r, f) {
    if (e->l.letter[f] != LEAVING) continue;
    double *change = d->rates + (int64_t)f * (stride + 1);
    leaving = 1;
    change[0] = 0;
    for (int i = f; i < f + size_of(r, f); i++)
      change[0] += e->lambda[(int64_t)i * stride] * d->series[(int64_t)i * stride];
  }
  if (r->s->sets) memset(d->lambda, 0, sizeof(double) * r->m * stride);
  for (int k = 0; k <= order; k++) {
    tangent_rules(r, d, k, dp, 0);
    EACH_SET(r, f)
      if (e->l.letter[f] == LEFT_BEHIND) turn_direction(r, e, d, f, k);
    if (r->s->sets) tangent_rules(r, d, k, dp, 1);
    if (leaving) turn_leaving(r, e, d, k);
    else if (slides) follow_layer(r, e, &r->s->tangent, d->series, k, r->sparse);
    if (leaving || slides) tangent_rules(r, d, k, dp, 1);
    if (k < r->order) next_terms(r, e, d, k);
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
static void land(Run *r, const Leg *l, const Columns *c) {
  const Expansion *e = &r->e;
  int n = r->n, slides = e->l.slides, stride = r->stride;
  for (int k = 0; k < l->columns && r->s->sets; k++) {
    double *y = l->y + k * n, *h = c->h + k * r->m;
    const double *dp = l->dp + k * r->s->parameters;
    memset(h, 0, sizeof(double) * r->m);
    Expansion d = column_of(r, c, k, y);
    memset(d.lambda, 0, sizeof(double) * r->m * stride);
    tangent_rules(r, &d, 0, dp, 0);
    for (int i = 0; i < r->m; i++)
      if (set_of(r, i) >= 0) h[i] = tangent_row(r, n + r->width + i)[0];
    d = column_of(r, c, k, 0);
    for (int i = 0; i < r->m; i++) d.series[(int64_t)i * stride] = 0;
    for (int i = 0; i < slides; i++)
      for (int j = 0; j < slides; j++) {
        int own = e->l.sliding[j];
        if (set_of(r, own) >= 0) d.series[(int64_t)e->l.sliding[i] * stride] -= e->inverse[i * slides + j] * h[own];
      }
    for (int i = 0; i < r->m; i++) if (e->l.letter[i] == 0) h[i] = 0;
    tangent_rules(r, &d, 0, r->zeros, 0);
    for (int i = 0; i < n; i++) y[i] += tangent_row(r, i)[0];
  }
}

/* The longest step for which the last two terms of some rows of columns stay below the tolerance. */
static double column_step(const Run *r, const double *series, int64_t rows, double tol, double whole) {
  int order = r->order;
  double size = 0, rate = 0, before = 0, last = 0, h = INFINITY;
  for (int64_t i = 0; i < rows; i++) {
    const double *own = series + i * r->stride;
    size = larger(fabs(own[0]), size);
    rate = larger(fabs(own[1]), rate);
    before = larger(fabs(own[order - 1]), before);
    last = larger(fabs(own[order]), last);
  }
  double allowed = tol * larger(size, rate * whole);
  if (last > 0) h = pow(allowed / last, 1.0 / order);
  if (before > 0) h = smaller(pow(allowed / before, 1.0 / (order - 1)), h);
  return h;
}

/* How the time of the event depends on states and parameters, row after row: - dg/g' of its function g. */
static void time_of_event(Run *r, const Leg *l, const Columns *c) {
  const Expansion *e = &r->e;
  int n = r->n, w = r->width, q = r->s->parameters, stride = r->stride, f = l->hit;
  int row = 0, own = l->index;
  while (row < e->l.rows && !(e->l.kind[row] == l->kind && e->l.index[row] == own && e->l.side[row] == l->side)) row++;
  for (int k = 0; k < n + q; k++) {
    double value = 0, rate = 0;
    for (int i = 0; i < q; i++) r->zeros[i] = i == k - n;
    memset(c->h, 0, sizeof(double) * r->m);
    Expansion d = column_of(r, c, 0, 0);
    if (k < n) d.states[(int64_t)k * stride] = 1;
    tangent_rules(r, &d, 0, r->zeros, 0);
    for (int i = 0; i < r->m; i++)
      if (e->l.letter[i] == LEFT_BEHIND) d.series[(int64_t)i * stride] = tangent_row(r, n + w + i)[0];
    tangent_series(r, e, &d, r->zeros, 0);
    const double *factor = tangent_row(r, n + 2 * w + own);
    if (f >= 0) {
      for (int i = f; i < f + size_of(r, f); i++) {
        value += e->lambda[(int64_t)i * stride] * tangent_row(r, n + w + i)[0];
        rate += e->lambda[(int64_t)i * stride] * e->series[(int64_t)i * stride + 1];
      }
    } else if (row < e->l.rows) {
      rate = e->guards[(int64_t)row * stride + 1];
      if (l->kind == SLIP_GUARD) {
        value = 2 * factor[0] * row_of(r, n + 2 * w + own)[0];
        for (int i = own; i < own + size_of(r, own); i++)
          value -= 2 * e->series[(int64_t)i * stride] * d.series[(int64_t)i * stride];
      } else if (l->kind == RELEASE_GUARD) value = d.series[(int64_t)own * stride];
      else if (is_idle(r, e->l.letter, own)) value = -l->side * tangent_row(r, n + own)[0];
      else
        value = turn_of(r, own, row_of(r, n + 2 * w + own), r->order + 1)
                * (factor[0] - l->side * d.series[(int64_t)own * stride]);
    }
    l->time_row[k] = -value / rate;
  }
  memset(r->zeros, 0, sizeof(double) * q);
}

/* The mode of a leg at its start: sets off which it is carry h. 0 where its unknowns are not unique. */
static int begin_leg(Run *r, const Leg *l) {
  Solutions all = {0};
  memcpy(r->x, l->x, sizeof(double) * r->n);
  tell_time(r);
  memcpy(r->letter, l->letter, r->width);
  find_idle(r);
  const double *h = surface_values(r, r->x);
  for (int i = 0; i < r->m; i++) {
    if (set_of(r, i) < 0 || r->letter[i] == 0) continue;
    r->letter[i] = r->idle[set_of(r, i)] ? IDLE : r->letter[i] == OFF ? LEFT_BEHIND : LEAVING;
    r->unknowns[i] = h[i];
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

static int carry(Run *r, Leg *l, const Columns *c) {
  double most = 0, size = 0;
  Expansion *e = &r->e;
  l->left = l->duration;
  if (!begin_leg(r, l)) return LEG_NOT_UNIQUE;
  for (int64_t step = 0; step < l->most_steps; step++) {
    for (int i = 0; i < r->s->dimension; i++) size = larger(fabs(r->x[i]), size);
    r->o.atol = l->tol * (size > 0 ? size : 1);
    r->size = size;
    expand(r, r->letter, r->x, r->unknowns, e);
    for (int i = 0; i < r->s->dimension; i++)
      size = larger(fabs(e->states[(int64_t)i * r->stride + 1]) * l->duration, size);
    for (int i = 0; i < r->n; i++) l->end_rate[i] = e->states[(int64_t)i * r->stride + 1];
    if (!finite_all(l->end_rate, r->n)) return LEG_STUCK;
    if (step == 0) {
      memcpy(l->start_rate, l->end_rate, sizeof(double) * r->n);
      land(r, l, c);
    }
    if (l->hit < 0 ? l->left <= 0 : has_arrived(r, l->hit, &most)) {
      memcpy(l->x, r->x, sizeof(double) * r->n);
      if (r->s->timed) l->x[r->n - 1] += r->t;
      if (l->time_row) time_of_event(r, l, c);
      return LEG_DONE;
    }
    if (!e->finite) return LEG_STUCK;
    for (int k = 0; k < l->columns; k++) {
      Expansion d = column_of(r, c, k, l->y + k * r->n);
      tangent_series(r, e, &d, l->dp + k * r->s->parameters, r->order);
    }
    double h = step_size(r, e);
    for (int k = 0; k < l->columns; k += r->n) { /* those by the start, then those by parameters */
      int64_t own = k ? l->columns - k : r->n;
      h = smaller(h, column_step(r, c->states + (int64_t)k * r->n * r->stride, own * r->n, l->tol, l->duration));
      if (k) break;
    }
    if (!(h > (l->hit < 0 ? FIXED_SHORTEST * l->duration : 0))) return LEG_STUCK;
    if (l->hit >= 0) h = near_step(r, l->hit, smaller(h, l->duration));
    else h = h >= l->left ? l->left : l->left < 1.5 * h ? smaller(h, 0.5 * l->left) : h;
    move_columns(r, l, c, h);
    l->left -= h;
  }
  return LEG_STUCK;
}

int64_t leg_size(void) { return sizeof(Leg); }

/* Carry state and columns of a leg to its end: LEG_DONE, or why not. */
int32_t carry_columns(Run *r, Leg *l) {
  int64_t count = l->columns > 0 ? l->columns : 1, own = r->m + (r->n + r->width) * r->stride;
  Options o = {.rtol = l->tol, .atol = l->tol};
  Columns c = {calloc(count * own, sizeof(double)), 0, 0};
  if (!c.h) return LEG_STUCK;
  c.states = c.h + count * r->m;
  c.series = c.states + count * r->n * r->stride;
  clear(r, &o, (Pair){r->s->timed ? l->x[r->n - 1] : 0, 0});
  set_parameters(r, l->p);
  int status = carry(r, l, &c);
  free(c.h);
  return status;
}
