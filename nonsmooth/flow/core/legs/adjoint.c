/* Rows of derivatives, pulled back through the recursion of columns (variation.c): its transpose.
 *
 * A row has the derivatives of something by all coefficients that the recursion gives. Each coefficient, from the last
 * order to the first, passes its own on to those that it is made of; what reaches the first coefficients is the row
 * before the step. All parameters come along, and the cost is that of one column.
 */

/* Derivatives by h of sets, by series of states, of unknowns, of directions of sets and what these are made of, and by
 * the sums of all orders (n + 3 width rows); by parameters. Where those by what the program is derived by are. */
typedef struct {
  double *h, *states, *series, *lambda, *apart, *root, *rates, *sum, *p;
  double **to;
  size_t room;
  int8_t *late;
} Rows;

static void aim_rows(const Run *r, const Expansion *e, Rows *c) {
  int size = moving_size(r), stride = r->stride;
  for (int j = 0; j < size; j++) {
    int i = j < r->n ? -1 : unknown_at(r, j), letter = i < 0 ? 1 : e->l.letter[i];
    c->late[j] = letter == 0 || letter == LEAVING;
    c->to[j] = 0;
    if (j < r->n) c->to[j] = c->states + (int64_t)j * stride;
    else if (i >= 0 && is_moving(r, i)) c->to[j] = c->lambda + (int64_t)i * stride;
    else if (letter == 0) c->to[j] = c->series + (int64_t)i * stride;
  }
}

/* From the sums of order k to coefficients up to that order. */
static void pull_sums(const Run *r, const Slopes *g, const Rows *c, int k) {
  const Entries *at = &r->s->derivatives;
  for (int a = 0; a < g->count; a++) {
    int q = g->active[a], j = at->column[q], terms = g->terms[q], last = c->late[j] ? k - 1 : k;
    double own = c->sum[(int64_t)at->row[q] * r->stride + k], *to = c->to[j];
    const double *slope = derivative_row(r, q);
    for (int i = k < terms ? 0 : k + 1 - terms; own != 0 && i <= last; i++) to[i] += slope[k - i] * own;
  }
}

static void pull_late(const Run *r, const Slopes *g, const Rows *c, int k) {
  const Entries *at = &r->s->derivatives;
  for (int a = 0; a < g->count; a++) {
    int q = g->active[a], j = at->column[q];
    if (c->late[j]) c->to[j][k] += derivative_row(r, q)[0] * c->sum[(int64_t)at->row[q] * r->stride + k];
  }
}

/* What sums up to an order give by parameters. */
static void pull_parameters(const Run *r, const Slopes *g, const Rows *c, int order) {
  int size = moving_size(r);
  for (int j = 0; j < r->s->parameters; j++)
    for (int q = g->first[size + j]; q < g->first[size + j + 1]; q++) {
      int row = r->s->derivatives.row[q], last = g->terms[q] - 1 < order ? g->terms[q] - 1 : order;
      const double *slope = derivative_row(r, q), *sum = c->sum + (int64_t)row * r->stride;
      for (int k = 0; k <= last; k++) c->p[j] += slope[k] * sum[k];
    }
}

static void pull_next_terms(const Run *r, const Expansion *e, const Rows *c, int k) {
  int stride = r->stride;
  double part = 1.0 / (k + 1);
  for (int i = 0; i < r->n; i++) c->sum[(int64_t)i * stride + k] += c->states[(int64_t)i * stride + k + 1] * part;
  for (int i = 0; i < r->m; i++) {
    int letter = e->l.letter[i];
    double h = c->series[(int64_t)i * stride + k + 1];
    if (letter == LEFT_BEHIND) c->sum[(int64_t)(r->n + i) * stride + k] += h * part;
    if (letter != LEAVING) continue;
    int64_t s = (int64_t)set_of(r, i) * (stride + 1);
    const double *u = e->lambda + (int64_t)i * stride;
    for (int j = 0; j <= k; j++) c->lambda[(int64_t)i * stride + j] += e->rates[s + k + 1 - j] * h;
    for (int j = 0; j <= k + 1; j++) c->rates[s + k + 1 - j] += u[j] * h;
  }
}

static void pull_sliding(const Run *r, const Expansion *e, const Rows *c, int k) {
  int slides = e->l.slides;
  for (int i = 0; i < slides; i++) {
    double own = c->series[(int64_t)e->l.sliding[i] * r->stride + k];
    for (int j = 0; j < slides && own != 0; j++) {
      double a = e->inverse[i * slides + j];
      if (a != 0) c->sum[(int64_t)(r->n + e->l.sliding[j]) * r->stride + k] -= a * own;
    }
  }
}

static void pull_leaving(Run *r, const Expansion *e, const Rows *c, int k) {
  int slides = e->l.slides, stride = r->stride, n, all = leaving_matrix(r, e, k, &n), at = slides, column = n;
  const int32_t *which = r->pending;
  double *a = r->work, *b = a + (int64_t)all * all;
  for (int i = 0; i < n; i++) b[i] = (i < slides ? c->series : c->lambda)[(int64_t)which[i] * stride + k];
  EACH_SET(r, f)
    if (e->l.letter[f] == LEAVING) b[column++] = c->rates[(int64_t)f * (stride + 1) + k + 1];
  for (int i = 0; i < all; i++)
    for (int j = 0; j < i; j++) { double t = a[i * all + j]; a[i * all + j] = a[j * all + i]; a[j * all + i] = t; }
  if (!solve(a, b, all)) for (int i = 0; i < all; i++) b[i] = NAN;
  for (int i = 0; i < n; i++) c->sum[(int64_t)(r->n + which[i]) * stride + k] -= b[i];
  column = n;
  EACH_SET(r, f) {
    int last = k < r->order ? k + 1 : k;
    if (e->l.letter[f] != LEAVING) continue;
    const double *radius = e->rates + (int64_t)f * (stride + 1);
    double *change = c->rates + (int64_t)f * (stride + 1);
    for (int i = f; i < f + size_of(r, f); i++, at++) {
      const double *u = e->lambda + (int64_t)i * stride;
      double *own = c->lambda + (int64_t)i * stride, part = (k + 1) * b[at];
      for (int j = 0; j < k; j++) own[j] += radius[k + 1 - j] * part;
      for (int j = 1; j <= last; j++) change[k + 1 - j] += u[j] * part;
      for (int j = 1; j <= k; j++) own[k - j] -= u[j] * b[column];
    }
    column++;
  }
}

static void pull_direction(const Run *r, const Expansion *e, const Rows *c, int f, int k) {
  int size = size_of(r, f), stride = r->stride;
  const double *length = e->root + (int64_t)f * stride;
  double *root = c->root + (int64_t)f * stride;
  for (int i = f; i < f + size; i++) {
    const double *u = e->lambda + (int64_t)i * stride;
    double *own = c->lambda + (int64_t)i * stride;
    c->apart[(int64_t)i * stride + k] += own[k];
    for (int j = 0; j <= k; j++) root[k - j] -= u[j] * own[k];
    for (int j = 1; j <= k; j++) own[k - j] -= length[j] * own[k];
  }
  for (int j = 1; j <= k; j++) root[k - j] -= length[j] * root[k];
  for (int i = f; i < f + size; i++) {
    double *apart = c->apart + (int64_t)i * stride;
    for (int j = 0; j <= k; j++) apart[k - j] += e->apart[(int64_t)i * stride + j] * root[k];
    c->series[(int64_t)i * stride + k] += apart[k] * e->per_radius[f];
  }
}

/* From coefficients and sums up to an order to the first coefficients of states and of h, and to parameters. */
static void pull_series(Run *r, const Expansion *e, const Slopes *g, Rows *c, int order) {
  int leaving = 0, stride = r->stride;
  EACH_SET(r, f) leaving |= e->l.letter[f] == LEAVING;
  aim_rows(r, e, c);
  for (int k = order; k >= 0; k--) {
    if (k < r->order) pull_next_terms(r, e, c, k);
    if (leaving || e->l.slides) pull_late(r, g, c, k);
    if (leaving) pull_leaving(r, e, c, k); else pull_sliding(r, e, c, k);
    pull_sums(r, g, c, k);
    EACH_SET(r, f)
      if (e->l.letter[f] == LEFT_BEHIND) pull_direction(r, e, c, f, k);
  }
  EACH_SET(r, f)
    for (int i = f; e->l.letter[f] == LEAVING && i < f + size_of(r, f); i++)
      c->series[(int64_t)i * stride] += e->lambda[(int64_t)i * stride] * c->rates[(int64_t)f * (stride + 1)];
  pull_parameters(r, g, c, order);
}

static void clear_rows(const Rows *c) { memset(c->states, 0, sizeof(double) * c->room); }

/* From values of surfaces at a point to states and parameters. */
static void pull_surfaces(const Run *r, const Expansion *e, const Slopes *g, Rows *c, const double *h) {
  memset(c->sum, 0, sizeof(double) * (r->n + 3 * r->width) * r->stride);
  for (int i = 0; i < r->m; i++) c->sum[(int64_t)(r->n + r->width + i) * r->stride] = h[i];
  aim_rows(r, e, c);
  pull_sums(r, g, c, 0);
  pull_parameters(r, g, c, 0);
}

/* The gradient of a leg's event function by states and parameters. */
static void event_gradient(Run *r, const Leg *l, Slopes *g, Rows *c) {
  const Expansion *e = &r->e;
  int n = r->n, w = r->width, stride = r->stride, own = l->index;
  double *unknown = c->series + (int64_t)own * stride, *sum = c->sum, *factor = sum + (int64_t)(n + 2 * w + own) * stride;
  clear_rows(c);
  measure_slopes(r, e, g, 1);
  memset(c->p, 0, sizeof(double) * r->s->parameters);
  if (l->hit >= 0)
    for (int i = l->hit; i < l->hit + size_of(r, l->hit); i++)
      sum[(int64_t)(n + w + i) * stride] = e->lambda[(int64_t)i * stride];
  else if (l->kind == SURFACE_GUARD) sum[(int64_t)(n + w + own) * stride] = 1;
  else if (l->kind == RELEASE_GUARD) *unknown = 1;
  else if (l->kind == EXIT_GUARD && is_idle(r, e->l.letter, own)) sum[(int64_t)(n + own) * stride] = -l->side;
  else if (l->kind == EXIT_GUARD) {
    *factor = turn_of(r, own, row_of(r, n + 2 * w + own), r->order + 1);
    *unknown = -l->side * *factor;
  } else {
    for (int i = 0; i < size_of(r, own); i++)
      unknown[(int64_t)i * stride] = -2 * e->series[(int64_t)(own + i) * stride];
    *factor = 2 * row_of(r, n + 2 * w + own)[0];
  }
  pull_series(r, e, g, c, 0);
  if (r->s->sets) { /* h that is carried */
    for (int i = 0; i < r->m; i++) c->h[i] = e->l.letter[i] == LEFT_BEHIND ? c->series[(int64_t)i * stride] : 0;
    pull_surfaces(r, e, g, c, c->h);
  }
  for (int i = 0; i < n; i++) l->gradient[i] = c->states[(int64_t)i * stride];
  memcpy(l->gradient + n, c->p, sizeof(double) * r->s->parameters);
}

/* From y and h behind the start of a leg to the row before it: what ``land`` does. */
static void pull_land(Run *r, Leg *l, Slopes *g, Rows *c) {
  const Expansion *e = &r->e;
  const Entries *at = &r->s->derivatives;
  int slides = e->l.slides;
  if (!r->s->sets) return;
  clear_rows(c);
  measure_slopes(r, e, g, 1);
  aim_rows(r, e, c);
  for (int a = 0; a < g->count; a++) {
    int q = g->active[a], j = at->column[q];
    if (c->late[j] && at->row[q] < r->n) c->to[j][0] += derivative_row(r, q)[0] * l->row[at->row[q]];
  }
  for (int i = 0; i < r->m; i++) if (set_of(r, i) < 0 || e->l.letter[i] == 0) c->h[i] = 0;
  for (int i = 0; i < slides; i++)
    for (int j = 0; j < slides; j++)
      if (set_of(r, e->l.sliding[j]) >= 0)
        c->h[e->l.sliding[j]] -= e->inverse[i * slides + j] * c->series[(int64_t)e->l.sliding[i] * r->stride];
  clear_rows(c);
  pull_surfaces(r, e, g, c, c->h);
  for (int i = 0; i < r->n; i++) l->row[i] += c->states[(int64_t)i * r->stride];
}

/* Whether a time of a sample is in a step that begins so long after the start of a leg. */
static int is_within(const Leg *l, double begun, double t) {
  return begun <= 0 || way_of_leg(l) * t > begun + 4 * EPSILON * length_of_leg(l);
}

/* From the end of a Taylor step, whose expansion is known, to its start. */
static void pull_step(Run *r, Leg *l, Slopes *g, Rows *c, double dt, double begun, int64_t *sample) {
  int n = r->n, order = r->order, stride = r->stride;
  double power = 1;
  clear_rows(c);
  for (int k = 0; k <= order; k++, power *= dt) {
    for (int i = 0; i < n; i++) c->states[(int64_t)i * stride + k] = power * l->row[i];
    for (int i = 0; i < r->m && r->s->sets; i++)
      if (set_of(r, i) >= 0 && r->letter[i]) c->series[(int64_t)i * stride + k] = power * c->h[i];
  }
  for (; *sample > 0 && is_within(l, begun, l->sample_t[*sample - 1]); --*sample) {
    const double *own = l->at_samples + (*sample - 1) * n;
    power = 1;
    for (int k = 0; k <= order; k++, power *= l->sample_t[*sample - 1] - way_of_leg(l) * begun)
      for (int i = 0; i < n; i++) c->states[(int64_t)i * stride + k] += power * own[i];
  }
  measure_slopes(r, &r->e, g, 0);
  pull_series(r, &r->e, g, c, order - 1);
  for (int i = 0; i < n; i++) l->row[i] = c->states[(int64_t)i * stride];
  for (int i = 0; i < r->m; i++) c->h[i] = c->series[(int64_t)i * stride];
}

static size_t place_rows(const Run *r, Rows *c, char *base, size_t used) {
  size_t n = r->n, w = r->width, stride = r->stride, sets = r->s->sets ? r->m : 0;
  size_t inputs = moving_size(r);
  c->h = DOUBLES(r->m);
  c->room = (2 * n + 4 * w + 3 * sets) * stride + sets * (stride + 1);
  c->p = DOUBLES(r->s->parameters);
  c->states = DOUBLES(c->room);
  c->series = c->states + n * stride;
  c->sum = c->series + w * stride;
  c->lambda = c->sum + (n + 3 * w) * stride;
  c->apart = c->lambda + sets * stride;
  c->root = c->apart + sets * stride;
  c->rates = c->root + sets * stride;
  c->to = place(base, &used, sizeof(double *), inputs);
  c->late = LETTERS(inputs);
  return used;
}

/* Numbers of a row of the record. */
static int64_t row_width(const Run *r) { return 3 + r->n + r->width; }

static void record(const Run *r, Leg *l, double dt, double begun, int stages, const double *x, const double *unknowns) {
  double *row = l->steps + l->step_count++ * row_width(r);
  if (!l->steps || l->step_count > l->step_room) return;
  row[0] = dt; row[1] = begun; row[2] = stages;
  memcpy(row + 3, x, sizeof(double) * r->n);
  memcpy(row + 3 + r->n, unknowns, sizeof(double) * r->width);
}
