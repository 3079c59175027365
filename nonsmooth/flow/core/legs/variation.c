/* Columns of derivatives along legs of known duration: nonsmooth/flow/variation.py.
 *
 * A leg has one mode, in which nothing is decided (legs.c). Columns are derivatives of the states by the start and by
 * parameters. The program of a step also gives series of its outputs' derivatives, once for all columns; sliding
 * multipliers follow by the inverse of the step. h of sets that the mode is off is integrated, so that its direction is
 * accurate near them. Neighbours of a state on a set reach the set at once: B M^-1 h is added to their columns.
 */

/* A leg of a duration of either sign. Each column has n derivatives of the state and a direction of parameters: none (-1),
 * one of them, or ``dp`` (ALONG_DP); the first ``starts`` share an error scale. At ``samples`` times since its start columns
 * are read (n for each, time after time), or rows are added (adjoint.c). Recorded steps: length, time since the start,
 * stages, state, unknowns; of each implicit stage again the last two. */
typedef struct {
  int32_t columns, starts, hit, kind, index, side, status, pad; /* hit: the first function of the set that is reached at its end, or -1; then the guard that ends it */
  double duration, tol, left; /* left: of the duration, where integration failed */
  int64_t most_steps, samples, step_count, step_room;
  const double *p, *dp;
  const int32_t *direction;
  const int8_t *letter;
  const double *x;
  double *end, *y;
  double *start_rate, *end_rate, *gradient; /* gradient: of the event's function by states, then by parameters */
  const double *sample_t;
  double *at_samples, *steps;
  double *row, *by_parameters; /* a row at the end, then at the start; its derivatives by parameters */
  double ratio, *parts; /* rows: a time since the start, and columns whose condition is beyond the ratio: others begin there */
  int64_t part_room, part_count;
} Leg;

/* One term of the recursion: coefficient k of ``to`` gets a factor times the sum of products of coefficients of ``by``,
 * ``first`` to ``terms`` - 1, with those of ``from`` up to k + ahead. */
typedef struct { double *to, *from; const double *by; double value; int32_t first, terms, ahead, factor, known; } Link; /* value: of ``by``, if it has one term; known: coefficients of ``from`` up to the last that is not zero */
enum { PLUS, MINUS, TIMES_ORDER, OVER_ORDER }; /* the last two: k + 1 and its inverse */

/* Groups of links in their order of use: distances of sets at the start; at each order directions of sets, sums, unknowns or
 * right sides of leaving directions, their terms in the sums, coefficients k + 1. */
enum { AT_START, DIRECTIONS, SUMS, UNKNOWNS, LATE, NEXT, GROUPS };

/* Derivatives in the recursion, of a column or, backward, of a row by all of these: series of states, of unknowns (with the
 * integrated h), sums of all orders (n + 3 width rows); of sets directions, h in units of |h|, its root, distances, right
 * sides of equations. Of all columns: series of states and unknowns, h of sets (m each) at the start. Derivatives of a row
 * by parameters. */
typedef struct {
  double *states, *series, *sum, *lambda, *apart, *root, *rates, *right;
  size_t room;
  double *of_states, *of_series, *h, *p;
} Variation;

/* Entries of the program's derivatives: offsets by input, terms of their series, their maxima in any mode and without
 * sliding; those by moving inputs that are nonzero in a mode. The recursion that they define. */
typedef struct {
  int32_t *first, *terms, *most, *active, count, leaving, begin[GROUPS + 1];
  Link *link;
  Variation *v;
} Slopes;

/* Length of a leg, and the direction of time along it. */
static double length_of_leg(const Leg *l) { return fabs(l->duration); }
static double way_of_leg(const Leg *l) { return l->duration < 0 ? -1 : 1; }

enum { ALONG_DP = -2 };
enum { LEG_DONE, LEG_STUCK, LEG_NOT_UNIQUE };

static const double *derivative_row(const Run *r, int q) {
  return row_of(r, r->n + 3 * r->width + r->s->rules.atoms + r->s->slope_outputs + q);
}

/* Whether an output's derivative is needed: by the series, and at a point also surfaces, gaps and factors. */
static int is_needed(const Run *r, const Expansion *e, int row, int at_point) {
  if (row < r->n || row >= r->n + r->width) return row < r->n || at_point;
  int letter = e->l.letter[row - r->n];
  return letter == 0 || letter == LEAVING || letter == LEFT_BEHIND;
}

static size_t place_variation(const Run *r, size_t columns, Slopes *g, Variation *v, char *base) {
  size_t entries = r->s->derivatives.count, n = r->n, w = r->width, stride = r->stride, sets = r->s->sets ? r->m : 0, used = 0;
  g->v = v;
  g->first = INTEGERS(moving_size(r) + r->s->parameters + 1);
  g->terms = INTEGERS(entries);
  g->most = INTEGERS(2 * entries);
  g->active = INTEGERS(entries);
  g->link = place(base, &used, sizeof(Link), 2 * entries + w * w + n + 16 * w);
  v->h = DOUBLES((columns + 1) * r->m);
  v->of_states = DOUBLES(columns * n * stride);
  v->of_series = DOUBLES(columns * w * stride);
  v->room = (2 * n + 4 * w + 3 * sets) * stride + sets * (stride + 1) + 2 * sets * stride;
  v->states = DOUBLES(v->room);
  v->series = v->states + n * stride;
  v->sum = v->series + w * stride;
  v->lambda = v->sum + (n + 3 * w) * stride;
  v->apart = v->lambda + sets * stride;
  v->root = v->apart + sets * stride;
  v->rates = v->root + sets * stride;
  v->right = v->rates + sets * (stride + 1);
  v->p = DOUBLES(r->s->parameters);
  return used;
}

static void clear_variation(const Variation *v) { memset(v->states, 0, sizeof(double) * v->room); }

/* Terms that entries have at most by the lists of a program. */
static void most_terms(const Run *r, const Series *t, int32_t *most) {
  const Entries *e = &r->s->derivatives;
  int8_t *moves = calloc(t->size, 1);
  for (int l = 0; moves && l < t->later.count; l++) {
    const Rule *q = t->rule + t->later.rule[l];
    int is_pair = q->later == RULE_pair || q->later == RULE_turns; /* which write row b too */
    moves[q->w / r->stride] = 1;
    if (is_pair) moves[q->b / r->stride] = 1;
  }
  for (int l = 0; moves && l < t->inputs; l++) moves[t->input[l] / r->stride] = 1;
  for (int q = 0; q < e->count; q++)
    most[q] = moves && !moves[(derivative_row(r, q) - r->series) / r->stride] ? 1 : r->stride;
  free(moves);
}

static void begin_slopes(const Run *r, Slopes *g) {
  const Entries *e = &r->s->derivatives;
  int inputs = moving_size(r) + r->s->parameters;
  for (int j = 0, q = 0; j <= inputs; j++) {
    while (q < e->count && e->column[q] < j) q++;
    g->first[j] = q;
  }
  most_terms(r, &r->s->series, g->most);
  most_terms(r, &r->s->free, g->most + e->count);
}

static void add_link(Slopes *g, double *to, double *from, const double *by, int first, int terms, int ahead, int factor) {
  g->link[g->begin[GROUPS]++] = (Link){to, from, by, *by, first, terms, ahead, factor, 0};
}

/* A link of coefficients of one order. */
static void add_single(Slopes *g, double *to, double *from, const double *by, int factor) {
  static const double one = 1;
  add_link(g, to, from, by ? by : &one, 0, 1, 0, factor);
}

/* Links of sums by the nonzero derivatives: by states, directions of sets and sliding unknowns. Those by the latter and by
 * leaving directions, ``late``, follow from the other sums of their order. */
static void link_sums(const Run *r, const Expansion *e, Slopes *g, int late) {
  const Variation *v = g->v;
  int input = -1, letter = 1;
  double *from = 0;
  for (int a = 0; a < g->count; a++) {
    int q = g->active[a], row = r->s->derivatives.row[q];
    if (r->s->derivatives.column[q] != input) {
      input = r->s->derivatives.column[q];
      int i = input < r->n ? -1 : unknown_at(r, input);
      letter = i < 0 ? 1 : e->l.letter[i];
      from = (i < 0 ? v->states + (int64_t)input * r->stride : (is_moving(r, i) ? v->lambda : v->series) + (int64_t)i * r->stride);
    }
    int is_late = letter == 0 || letter == LEAVING;
    if (late && !is_late) continue;
    add_link(g, v->sum + (int64_t)row * r->stride, from, derivative_row(r, q), is_late && !late, late ? 1 : g->terms[q], 0, PLUS);
  }
}

/* Links of the direction h/|h| from the integrated h. */
static void link_direction(const Run *r, const Expansion *e, Slopes *g, int f) {
  const Variation *v = g->v;
  int64_t stride = r->stride, size = size_of(r, f);
  const double *length = e->root + f * stride;
  double *root = v->root + f * stride;
  for (int64_t i = f; i < f + size; i++) add_single(g, v->apart + i * stride, v->series + i * stride, e->per_radius + f, PLUS);
  for (int64_t i = f; i < f + size; i++) add_link(g, root, v->apart + i * stride, e->apart + i * stride, 0, r->stride, 0, PLUS);
  add_link(g, root, root, length, 1, r->stride, 0, MINUS);
  for (int64_t i = f * stride; i < (f + size) * stride; i += stride) {
    add_single(g, v->lambda + i, v->apart + i, 0, PLUS);
    add_link(g, v->lambda + i, root, e->lambda + i, 0, r->stride, 0, MINUS);
    add_link(g, v->lambda + i, v->lambda + i, length, 1, r->stride, 0, MINUS);
  }
}

/* Links of right sides of the equations of leaving directions and sliding multipliers (leaving_matrix). */
static void link_right_sides(Run *r, const Expansion *e, Slopes *g) {
  const Variation *v = g->v;
  int64_t stride = r->stride;
  int n, all = leaving_matrix(r, e, 1, &n), at = e->l.slides, column = n;
  (void)all;
  for (int i = 0; i < n; i++) add_single(g, v->right + i * stride, v->sum + (r->n + r->pending[i]) * stride, 0, MINUS);
  EACH_LEAVING(r, e, f) {
    double *change = v->rates + f * (stride + 1);
    for (int64_t i = f * stride; i < (f + size_of(r, f)) * stride; i += stride, at++) {
      add_link(g, v->right + at * stride, v->lambda + i, e->rates + f * (stride + 1), 2, r->stride + 1, 1, TIMES_ORDER);
      add_link(g, v->right + at * stride, change, e->lambda + i, 1, r->stride, 1, TIMES_ORDER);
      add_link(g, v->right + column * stride, v->lambda + i, e->lambda + i, 1, r->stride, 0, MINUS);
    }
    column++;
  }
}

/* Links of coefficients k + 1 of the states and of h. */
static void link_next(const Run *r, const Expansion *e, Slopes *g) {
  const Variation *v = g->v;
  int64_t stride = r->stride;
  for (int64_t i = 0; i < r->n * stride; i += stride) add_single(g, v->states + i + 1, v->sum + i, 0, OVER_ORDER);
  for (int64_t i = 0; i < r->m; i++) {
    double *h = v->series + i * stride + 1;
    if (e->l.letter[i] == LEFT_BEHIND) add_single(g, h, v->sum + (r->n + i) * stride, 0, OVER_ORDER);
    if (e->l.letter[i] != LEAVING) continue;
    int64_t f = set_of(r, i) * (stride + 1);
    add_link(g, h, v->lambda + i * stride, e->rates + f, 1, r->stride + 1, 1, PLUS);
    add_link(g, h, v->rates + f, e->lambda + i * stride, 0, r->stride, 1, PLUS);
  }
}

/* Build the recursion of an expansion and its nonzero slopes. */
static void link_up(Run *r, const Expansion *e, Slopes *g) {
  const Variation *v = g->v;
  int slides = e->l.slides;
  int64_t stride = r->stride;
  g->leaving = g->begin[GROUPS] = 0;
  for (int group = 0; group < GROUPS; group++) {
    g->begin[group] = g->begin[GROUPS];
    if (group == SUMS || (group == LATE && (slides || g->leaving))) link_sums(r, e, g, group == LATE);
    EACH_SET(r, f) {
      g->leaving |= e->l.letter[f] == LEAVING;
      if (group == DIRECTIONS && e->l.letter[f] == LEFT_BEHIND) link_direction(r, e, g, f);
      for (int64_t i = f; group == AT_START && e->l.letter[f] == LEAVING && i < f + size_of(r, f); i++)
        add_single(g, v->rates + f * (stride + 1), v->series + i * stride, e->lambda + i * stride, PLUS);
    }
    for (int i = 0; i < slides && group == UNKNOWNS && !g->leaving; i++)
      for (int q = e->from[i]; q < e->to[i]; q++) {
        const double *sum = v->sum + (r->n + e->l.sliding[e->column[q]]) * stride;
        add_single(g, v->series + e->l.sliding[i] * stride, sum, e->inverse + q, MINUS);
      }
    if (group == UNKNOWNS && g->leaving) link_right_sides(r, e, g);
    if (group == NEXT) link_next(r, e, g);
  }
}

/* Find nonzero entries of an expansion, and build their recursion. */
static void measure_slopes(Run *r, const Expansion *e, Slopes *g, int at_point) {
  int size = moving_size(r);
  const int32_t *most = g->most + (e->l.is_free ? r->s->derivatives.count : 0);
  const double *row = 0;
  int room = 0, known = 0;
  g->count = 0;
  for (int j = 0; j < size + r->s->parameters; j++) {
    int i = j < r->n || j >= size ? -1 : unknown_at(r, j), counts = j < r->n || j >= size;
    counts |= i >= 0 && (is_moving(r, i) || e->l.letter[i] == 0);
    if (!counts) memset(g->terms + g->first[j], 0, sizeof(int32_t) * (g->first[j + 1] - g->first[j]));
    for (int q = g->first[j]; counts && q < g->first[j + 1]; q++) {
      const double *own = derivative_row(r, q);
      if (own != row || most[q] != room) known = terms_of(row = own, room = most[q]);
      g->terms[q] = is_needed(r, e, r->s->derivatives.row[q], at_point) ? known : 0;
      if (g->terms[q] && j < size) g->active[g->count++] = q;
    }
  }
  link_up(r, e, g);
}

/* Add the links of a range of groups at an order. */
static void follow_links(const Slopes *g, int first_group, int last_group, int k) {
  for (Link *l = g->link + g->begin[first_group], *end = g->link + g->begin[last_group + 1]; l < end; l++) {
    double sum;
    if (l->terms == 1) sum = l->from[k] * l->value;
    else {
      int at = k + l->ahead, newest = at - l->first, first = at < l->terms ? 0 : at + 1 - l->terms;
      if (k == 0) l->known = terms_of(l->from, newest + 1);
      else if (l->from[newest] != 0) l->known = newest + 1;
      if (first >= l->known) continue;
      sum = first + 1 < l->known ? convolve(l->from, l->by, at, first, l->known - 1) : l->from[first] * l->by[at - first];
    }
    switch (l->factor) {
      case PLUS: l->to[k] += sum; break;
      case MINUS: l->to[k] -= sum; break;
      case TIMES_ORDER: l->to[k] += (k + 1) * sum; break;
      default: l->to[k] = sum * PART[k + 1];
    }
  }
}

/* Solve for the unknowns in a mode in which sets are left, or apply the transpose to their right sides. */
static void solve_leaving(Run *r, const Expansion *e, const Variation *v, int k, int is_back) {
  int64_t stride = r->stride;
  int slides = e->l.slides, n, all = leaving_matrix(r, e, k, &n), row = n;
  double *a = r->work, *b = a + (int64_t)all * all, *unknown[all];
  for (int i = 0; i < n; i++) unknown[i] = (i < slides ? v->series : v->lambda) + r->pending[i] * stride + k;
  EACH_LEAVING(r, e, f) unknown[row++] = v->rates + f * (stride + 1) + k + 1;
  for (int i = 0; i < all; i++) b[i] = is_back ? *unknown[i] : v->right[i * stride + k];
  for (int i = 0; i < all && is_back; i++)
    for (int j = 0; j < i; j++) swap(a + i * all + j, a + j * all + i, 1);
  if (!solve(a, b, all)) for (int i = 0; i < all; i++) b[i] = NAN;
  for (int i = 0; i < all; i++) *(is_back ? v->right + i * stride + k : unknown[i]) = b[i];
}

/* Coefficients of a column to an order, from the first ones of states and of h. */
static void column_series(Run *r, const Expansion *e, const Slopes *g, int order) {
  follow_links(g, AT_START, AT_START, 0);
  for (int k = 0; k <= order; k++) {
    int last = k < r->order ? NEXT : LATE;
    follow_links(g, DIRECTIONS, g->leaving ? UNKNOWNS : last, k);
    if (!g->leaving) continue;
    solve_leaving(r, e, g->v, k, 0);
    follow_links(g, LATE, last, k);
  }
}

/* Begin the series of a column, with the terms of parameters in the sums of all orders. */
static void begin_column(Run *r, const Leg *l, const Slopes *g, int column) {
  const Variation *v = g->v;
  int size = moving_size(r), own = l->direction[column], stride = r->stride;
  int first = own < 0 ? 0 : own, last = own == ALONG_DP ? r->s->parameters : own + 1;
  clear_variation(v);
  for (int i = 0; i < r->n; i++) v->states[(int64_t)i * stride] = l->y[column * r->n + i];
  for (int i = 0; i < r->m; i++) v->series[(int64_t)i * stride] = v->h[column * r->m + i];
  for (int j = first; j < last; j++)
    for (int q = g->first[size + j]; q < g->first[size + j + 1]; q++) {
      double *to = v->sum + (int64_t)r->s->derivatives.row[q] * stride;
      const double *slope = derivative_row(r, q);
      for (int k = 0; k < g->terms[q]; k++) to[k] += slope[k] * (own < 0 ? l->dp[j] : 1);
    }
}

/* Move a state or a column from values h of sets onto them, along the instantaneous action of their multipliers. */
static void move_onto(const Run *r, const Slopes *g, const double *h, double *y) {
  const Expansion *e = &r->e;
  const Variation *v = g->v;
  int64_t n = r->n, slides = e->l.slides, stride = r->stride;
  for (int i = 0; i < slides; i++)
    for (int q = e->from[i]; q < e->to[i]; q++) {
      int j = e->l.sliding[e->column[q]];
      if (set_of(r, j) >= 0) v->series[e->l.sliding[i] * stride] -= e->inverse[q] * h[j];
    }
  memset(v->sum, 0, sizeof(double) * n * stride);
  follow_links(g, LATE, LATE, 0);
  for (int i = 0; i < n; i++) y[i] += v->sum[i * stride];
}

/* Derivatives of h of the sets at the start, and projection of the columns onto the sets. */
static void land(Run *r, const Leg *l, Slopes *g) {
  const Expansion *e = &r->e;
  const Variation *v = g->v;
  int64_t n = r->n, stride = r->stride;
  if (!r->s->sets) return;
  measure_slopes(r, e, g, 1);
  for (int k = 0; k < l->columns; k++) {
    double *h = v->h + k * r->m;
    memset(h, 0, sizeof(double) * r->m);
    begin_column(r, l, g, k);
    follow_links(g, SUMS, SUMS, 0);
    for (int i = 0; i < r->m; i++) if (set_of(r, i) >= 0) h[i] = v->sum[(n + r->width + i) * stride];
    move_onto(r, g, h, l->y + k * n);
    for (int i = 0; i < r->m; i++) if (e->l.letter[i] == 0) h[i] = 0;
  }
}

/* Project a state onto the sets of its mode; whether it was off them. */
static int land_state(Run *r, Slopes *g) {
  const Expansion *e = &r->e;
  int is_off = 0;
  if (!r->s->sets) return 0;
  const double *h = surface_values(r, r->x);
  for (int i = 0; i < e->l.slides; i++) is_off |= set_of(r, e->l.sliding[i]) >= 0 && h[e->l.sliding[i]] != 0;
  if (!is_off) return 0;
  measure_slopes(r, e, g, 1);
  clear_variation(g->v);
  move_onto(r, g, h, r->x);
  return 1;
}

/* The longest step for which the last two terms of columns stay below the tolerance, relative to the columns or their
 * changes. Terms that sliding multipliers cancel count too, as their rounding remains. */
static double column_step(const Run *r, const Leg *l, const Variation *v, int first, int count) {
  const Entries *g = &r->s->derivatives;
  int n = r->n, w = r->width, size = moving_size(r), order = r->order, stride = r->stride;
  double most = 0, rate = 0, second = 0, before = 0, last = 0, h = INFINITY;
  for (int64_t i = (int64_t)first * n; i < (int64_t)(first + count) * n; i++) {
    const double *own = v->of_states + i * stride;
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
    for (int64_t k = first; k < first + count; k++) rate = larger(push * fabs(v->of_series[(k * w + i) * stride]), rate);
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
