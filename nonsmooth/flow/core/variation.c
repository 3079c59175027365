/* Columns of derivatives along legs of known duration: nonsmooth/flow/variation.py.
 *
 * A leg is one mode, in which nothing is decided (legs.c). Columns are derivatives of the states by the start and by
 * parameters. The program of a step gives series of its outputs' derivatives too, once for all columns; multipliers
 * of sliding follow by the inverse that the step has. Sets off which the mode is carry h along, so that close to them
 * its direction has all its digits. Neighbours of a state on a set reach the set at once: B M^-1 h is added to their
 * columns.
 */

/* A leg, of a duration of either sign: columns, each a row of n derivatives of the state and a direction of parameters: none (-1), one of them, or the
 * one ``dp`` (ALONG_DP). The first ``starts`` columns have one error scale. At ``samples`` times since its start columns are read (n for each, time after time), or rows are
 * added (adjoint.c). Its steps are recorded: length, time since the start, stages, state, unknowns; of each stage of an
 * implicit one once more the last two. */
typedef struct {
  int32_t columns, starts, hit, kind, index, side, status, pad; /* hit: the first function of the set that is reached at its end, or -1; then the guard that ends it */
  double duration, tol, left; /* left: of the duration, where it is stuck */
  int64_t most_steps, samples, step_count, step_room;
  const double *p, *dp;
  const int32_t *direction;
  const int8_t *letter;
  const double *x;
  double *end, *y;
  double *start_rate, *end_rate, *gradient; /* gradient: of the event's function by states, then by parameters */
  const double *sample_t;
  double *at_samples, *steps;
  double *row, *by_parameters; /* a row at the end, then at the start; what it gives by parameters */
} Leg;

/* Columns on their way: h of sets (m each), series of states and of unknowns (h is carried there). Of the column that
 * is derived: series by what the program is derived by, with as many terms as are not zero; sums of an order. */
typedef struct {
  double *h, *states, *series, *sum, *push; /* push: what parameters add to the sums of all orders */
  const double **of;
  int32_t *terms;
  int8_t *late; /* whether that is an unknown of sliding, or the direction in which a set is left */
} Columns;

/* Entries of the program's derivatives: where those by each of its inputs begin, terms of their series, at most so many;
 * the ones by what moves that count in a mode. */
typedef struct { int32_t *first, *terms, *most, *active, count; } Slopes;

/* Length of a leg, and the direction of time along it. */
static double length_of_leg(const Leg *l) { return fabs(l->duration); }
static double way_of_leg(const Leg *l) { return l->duration < 0 ? -1 : 1; }

enum { ALONG_DP = -2 };
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

static size_t place_slopes(const Run *r, Slopes *g, char *base, size_t used) {
  size_t entries = r->s->derivatives.count;
  g->first = INTEGERS(moving_size(r) + r->s->parameters + 1);
  g->terms = INTEGERS(entries);
  g->most = INTEGERS(entries);
  g->active = INTEGERS(entries);
  return used;
}

static void begin_slopes(const Run *r, Slopes *g) {
  const Entries *e = &r->s->derivatives;
  const Series *t = &r->s->series;
  int inputs = moving_size(r) + r->s->parameters;
  for (int j = 0, q = 0; j <= inputs; j++) {
    while (q < e->count && e->column[q] < j) q++;
    g->first[j] = q;
  }
  int8_t *moves = calloc(t->size, 1);
  for (int l = 0; moves && l < t->later.count; l++) {
    const Rule *q = t->rule + t->later.rule[l];
    int is_pair = q->later == RULE_pair || q->later == RULE_turns; /* which write row b too */
    moves[q->w / r->stride] = 1;
    if (is_pair) moves[q->b / r->stride] = 1;
  }
  for (int l = 0; moves && l < t->inputs; l++) moves[t->input[l] / r->stride] = 1;
  for (int q = 0; q < e->count; q++)
    g->most[q] = moves && !moves[(derivative_row(r, q) - r->series) / r->stride] ? 1 : r->stride;
  free(moves);
}

/* Those of an expansion. */
static void measure_slopes(const Run *r, const Expansion *e, Slopes *g, int at_point) {
  int size = moving_size(r);
  g->count = 0;
  for (int j = 0; j < size + r->s->parameters; j++) {
    int i = j < r->n || j >= size ? -1 : unknown_at(r, j), counts = j < r->n || j >= size;
    counts |= i >= 0 && (is_moving(r, i) || e->l.letter[i] == 0);
    for (int q = g->first[j]; q < g->first[j + 1]; q++) {
      g->terms[q] = 0;
      if (!counts || !is_wanted(r, e, r->s->derivatives.row[q], at_point)) continue;
      g->terms[q] = terms_of(derivative_row(r, q), g->most[q]);
      if (g->terms[q] && j < size) g->active[g->count++] = q;
    }
  }
}

/* What the program's derivatives are multiplied with, of a column. */
static void aim_column(const Run *r, const Expansion *e, const Expansion *d, const Leg *l, int column, const Slopes *g, const Columns *c) {
  int size = moving_size(r), stride = r->stride;
  memset(c->push, 0, sizeof(double) * (r->n + 3 * r->width) * stride);
  int own = l->direction[column], first = own < 0 ? 0 : own, last = own == ALONG_DP ? r->s->parameters : own + 1;
  for (int j = first; j < last; j++)
    for (int q = g->first[size + j]; q < g->first[size + j + 1]; q++) {
      double *to = c->push + (int64_t)r->s->derivatives.row[q] * stride;
      const double *slope = derivative_row(r, q);
      for (int k = 0; k < g->terms[q]; k++) to[k] += slope[k] * (own < 0 ? l->dp[j] : 1);
    }
  for (int j = 0; j < size; j++) {
    int i = j < r->n ? -1 : unknown_at(r, j), letter = i < 0 ? 1 : e->l.letter[i];
    c->of[j] = 0;
    c->late[j] = letter == 0 || letter == LEAVING;
    c->terms[j] = 0;
    if (j < r->n) c->of[j] = d->states + (int64_t)j * stride;
    else if (i >= 0 && is_moving(r, i)) c->of[j] = d->lambda + (int64_t)i * stride;
    else if (letter == 0) c->of[j] = d->series + (int64_t)i * stride;
  }
}

/* Sums of order k: derivatives of field, layer, surfaces and gaps, factors along the column. */
static void derive(const Run *r, const Slopes *g, const Columns *c, int k) {
  const Entries *at = &r->s->derivatives;
  int size = moving_size(r);
  for (int i = 0; i < r->n + 3 * r->width; i++) c->sum[i] = c->push[(int64_t)i * r->stride + k];
  for (int j = 0; j < size; j++) if (c->of[j] && c->of[j][k] != 0) c->terms[j] = k + 1;
  for (int a = 0; a < g->count; a++) {
    int q = g->active[a], j = at->column[q];
    c->sum[at->row[q]] += product_of(c->of[j], c->terms[j], derivative_row(r, q), g->terms[q], k);
  }
}

/* Add what coefficients k of unknowns do that were zero. */
static void derive_late(const Run *r, const Slopes *g, const Columns *c, int k) {
  const Entries *at = &r->s->derivatives;
  for (int a = 0; a < g->count; a++) {
    int q = g->active[a], j = at->column[q];
    if (!c->late[j] || c->of[j][k] == 0) continue;
    c->sum[at->row[q]] += derivative_row(r, q)[0] * c->of[j][k];
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
static void column_series(Run *r, const Expansion *e, Expansion *d, const Leg *l, int column, const Slopes *g, Columns *c, int order) {
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
  aim_column(r, e, d, l, column, g, c);
  for (int k = 0; k <= order; k++) {
    EACH_SET(r, f)
      if (e->l.letter[f] == LEFT_BEHIND) turn_direction(r, e, d, f, k);
    derive(r, g, c, k);
    if (leaving) turn_leaving(r, e, d, c, k); else turn_sliding(r, e, d, c, k);
    if (leaving || e->l.slides) derive_late(r, g, c, k);
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
static void land(Run *r, const Leg *l, Slopes *g, Columns *c) {
  const Expansion *e = &r->e;
  const Entries *at = &r->s->derivatives;
  int n = r->n, slides = e->l.slides;
  if (!r->s->sets) return;
  measure_slopes(r, e, g, 1);
  for (int k = 0; k < l->columns; k++) {
    double *y = l->y + k * n, *h = c->h + k * r->m;
    memset(h, 0, sizeof(double) * r->m);
    Expansion d = column_of(r, c, k, y);
    memset(d.lambda, 0, sizeof(double) * r->m * r->stride);
    aim_column(r, e, &d, l, k, g, c);
    derive(r, g, c, 0);
    for (int i = 0; i < r->m; i++) if (set_of(r, i) >= 0) h[i] = c->sum[n + r->width + i];
    for (int i = 0; i < slides; i++)
      for (int j = 0; j < slides; j++)
        if (set_of(r, e->l.sliding[j]) >= 0)
          d.series[(int64_t)e->l.sliding[i] * r->stride] -= e->inverse[i * slides + j] * h[e->l.sliding[j]];
    for (int a = 0; a < g->count; a++) {
      int q = g->active[a], j = at->column[q];
      if (c->late[j] && at->row[q] < n) y[at->row[q]] += derivative_row(r, q)[0] * c->of[j][0];
    }
    for (int i = 0; i < r->m; i++) if (e->l.letter[i] == 0) h[i] = 0;
  }
}

/* Move a state off the sets on which it is held onto them, as ``land`` does with columns; whether it was off. */
static int land_state(Run *r, Slopes *g) {
  const Expansion *e = &r->e;
  const Entries *at = &r->s->derivatives;
  int slides = e->l.slides, is_off = 0;
  if (!r->s->sets) return 0;
  measure_slopes(r, e, g, 1);
  const double *h = surface_values(r, r->x);
  double *push = r->work;
  memset(push, 0, sizeof(double) * r->width);
  for (int i = 0; i < slides; i++)
    for (int j = 0; j < slides; j++) {
      double own = set_of(r, e->l.sliding[j]) >= 0 ? h[e->l.sliding[j]] : 0;
      is_off |= own != 0;
      push[e->l.sliding[i]] -= e->inverse[i * slides + j] * own;
    }
  for (int a = 0; a < g->count && is_off; a++) {
    int q = g->active[a], i = at->column[q] < r->n ? -1 : unknown_at(r, at->column[q]);
    if (i >= 0 && e->l.letter[i] == 0 && at->row[q] < r->n) r->x[at->row[q]] += derivative_row(r, q)[0] * push[i];
  }
  return is_off;
}

/* The longest step for which the last two terms of columns stay below the tolerance: a part of them, or of what they
 * change by; what multipliers of sliding cancel counts, as its rounding stays. */
static double column_step(const Run *r, const Leg *l, const Columns *c, int first, int count) {
  const Entries *g = &r->s->derivatives;
  int n = r->n, w = r->width, size = moving_size(r), order = r->order, stride = r->stride;
  double most = 0, rate = 0, second = 0, before = 0, last = 0, h = INFINITY;
  for (int64_t i = (int64_t)first * n; i < (int64_t)(first + count) * n; i++) {
    const double *own = c->states + i * stride;
    most = larger(fabs(own[0]), most);
    rate = larger(fabs(own[1]), rate);
    second = larger(fabs(own[2]), second);
    before = larger(fabs(own[order - 1]), before);
    last = larger(fabs(own[order]), last);
  }
  for (int q = 0; q < g->count && r->e.l.slides; q++) {
    int i = g->row[q] < n && g->column[q] >= n && g->column[q] < size ? unknown_at(r, g->column[q]) : -1;
    double push = i >= 0 && r->letter[i] == 0 ? fabs(derivative_row(r, q)[0]) : 0;
    if (!(push > 0 && push < INFINITY)) continue;
    for (int64_t k = first; k < first + count; k++) rate = larger(push * fabs(c->series[(k * w + i) * stride]), rate);
  }
  double allowed = l->tol * larger(most, rate * length_of_leg(l));
  if (allowed == 0) { /* nothing but higher terms */
    order -= 2;
    allowed = l->tol * second;
  }
  if (allowed == 0) return h;
  if (last > 0) h = pow(allowed / last, 1.0 / order);
  if (before > 0) h = smaller(pow(allowed / before, 1.0 / (order - 1)), h);
  return h;
}
