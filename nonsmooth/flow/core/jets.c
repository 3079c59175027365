/* Series of a mode: nonsmooth/model/laws/coupled.py ---------------------------------------------------------- */

static const double *row_of(const Run *r, int output) {
  return r->series + r->s->series.output[output];
}

static const double *slope_row(const Run *r, int i, int j) {
  static const double zero[P + 1];
  int output = r->s->slope_output[i * r->width + j];
  return output < 0 ? zero : row_of(r, r->n + 3 * r->width + r->s->rules.atoms + output);
}

/* Guards from the series (or, with count 1, values) of their functions. */
static void guard_rows(Run *r, const Layout *l, const double *series, int count, double *guards) {
  for (int row = 0; row < l->rows; row++) {
    double *g = guards + (int64_t)row * r->stride;
    if (row < l->atoms) law_of(r, l->index[row])->guard(r, l, row, series, count, g);
    else if (l->kind[row] == BRANCH_GUARD) branch_row(r, l, row, count, g);
    else memcpy(g, row_of(r, r->n + 3 * r->width + row - l->atoms), sizeof(double) * count);
  }
}

/* Coefficients k of sliding multipliers, which keep those of the layer's rates at zero. */
static void follow_layer(Run *r, Expansion *e, int k) {
  int slides = e->l.slides;
  for (int i = 0; i < slides; i++) {
    double sum = 0;
    for (int q = e->from[i]; q < e->to[i]; q++)
      sum += e->inverse[q] * row_of(r, r->n + e->l.sliding[e->column[q]])[k];
    e->series[(int64_t)e->l.sliding[i] * r->stride + k] = -sum;
  }
}

/* Coefficient k of states and multipliers as the inputs of the series; multipliers of sets move. */
static void inputs_of(Run *r, const Expansion *e, int k) {
  double *x = r->vector, *lam = x + r->n;
  const double *held = k ? r->none : r->held;
  for (int i = 0; i < r->n; i++) x[i] = e->states[(int64_t)i * r->stride + k];
  for (int i = 0; i < r->width; i++) lam[i] = e->series[(int64_t)i * r->stride + k];
  if (k && r->s->sets) {
    for (int i = 0; i < r->width; i++) r->later[i] = r->moving[i] ? e->lambda[(int64_t)i * r->stride + k] : 0;
    held = r->later;
  }
  set_inputs(r, x, held, lam);
}

/* The only state on which a surface depends, or -1. */
static int only_state(const Run *r, int surface) {
  const Entries *g = &r->s->surface_gradient;
  int found = -1;
  for (int q = 0; q < g->count; q++) {
    if (g->row[q] != surface) continue;
    if (found >= 0 || g->column[q] >= r->s->dimension) return -1;
    found = g->column[q];
  }
  return found;
}

/* States under a root do not move where the root is zero. */
static void next_states(Run *r, Expansion *e, int k) {
  for (int i = 0; i < r->n; i++) e->states[(int64_t)i * r->stride + k + 1] = row_of(r, i)[k] * PART[k + 1];
  for (int j = 0; r->has_roots && j < e->l.slides; j++) {
    int i = e->l.sliding[j], state = i < r->m && element(r, i)->power > 0 && degree_of(r, i) == 1 ? only_state(r, i) : -1;
    if (state >= 0) e->states[(int64_t)state * r->stride + k + 1] = 0;
  }
}

/* Coefficients k of all rules that do not depend on unknowns of order k, and of directions of sets. */
static void open_order(Run *r, Expansion *e, int k) {
  const Series *t = r->s->sets && e->l.is_free ? &r->s->free : &r->s->series;
  inputs_of(r, e, k);
  series_at(t, !k ? &t->moving : r->s->sets ? &t->early : &t->later, k, r->stride, r->input, r->series);
  if (!r->s->sets) return;
  follow_sets(r, e, k);
  if (k == 0) return;
  inputs_of(r, e, k);
  series_at(t, &t->late, k, r->stride, r->input, r->series);
}

/* Coefficients k of the rules that depend on unknowns of order k. */
static void close_order(Run *r, Expansion *e, int k) {
  const Series *t = r->s->sets && e->l.is_free ? &r->s->free : &r->s->series;
  inputs_of(r, e, k);
  series_at(t, k ? &t->late : &t->moving, k, r->stride, r->input, r->series);
}

/* Remove the field's component along the gradients of functions that are kept at zero: rounding in the multipliers leaves
 * it, and a state at rest would drift. */
static void keep_rates(Run *r, Expansion *e) {
  const Entries *g = &r->s->height_gradient;
  int first = 2 * r->width + r->s->slope.count + r->s->layer_gradient.count, stride = r->stride;
  weigh_again(r, e);
  for (int k = 0, from = 0, to = 0; k < 2 * e->l.slides; k++) {
    int i = e->l.sliding[k % e->l.slides];
    double rate = 0, size = 0;
    if (k == e->l.slides) to = 0;
    while (to < g->count && g->row[to] < i) to++;
    for (from = to; to < g->count && g->row[to] == i; to++) {
      double slope = out_of(&r->s->point, r->point, first + to);
      rate += slope * e->states[(int64_t)g->column[to] * stride + 1];
      if (g->column[to] < r->s->dimension) size += slope * slope;
    }
    if (i >= r->m || degree_of(r, i) != 1 || rate == 0 || !isfinite(rate / size)) continue;
    for (int q = from; q < to; q++)
      if (g->column[q] < r->s->dimension)
        e->states[(int64_t)g->column[q] * stride + 1] -= rate / size * out_of(&r->s->point, r->point, first + q);
  }
}

/* All coefficients of a mode with sets. */
static void set_series(Run *r, Expansion *e) {
  int leaving = 0;
  EACH_LEAVING(r, e, f) leaving = 1;
  for (int k = 0; k <= r->order; k++) {
    open_order(r, e, k);
    if (leaving) {
      if (leave_sets(r, e, k, 1)) {
        close_order(r, e, k - 1);
        close_sets(r, e, k - 1);
        open_order(r, e, k);
        leave_sets(r, e, k, 0);
      }
    } else if (k && e->l.slides) follow_layer(r, e, k);
    if (k && (leaving || e->l.slides)) close_order(r, e, k);
    close_sets(r, e, k);
    if (k < r->order) next_states(r, e, k);
    if (k == 0 && e->l.slides) keep_rates(r, e);
  }
}

/* All coefficients of a mode without sets: those of the field give the next ones of the states. */
static void mode_series(Run *r, Expansion *e) {
  const Series *t = e->l.is_free ? &r->s->free : &r->s->series;
  int order = r->order, stride = r->stride, slides = e->l.slides;
  double *s = r->series;
  inputs_of(r, e, 0);
  series_at(t, &t->moving, 0, stride, r->input, s);
  next_states(r, e, 0);
  if (slides) keep_rates(r, e);
  for (int32_t l = 0; l < t->inputs; l++) {
    int i = t->index[l];
    s[t->input[l] + 1] = i < r->n ? e->states[(int64_t)i * stride + 1] : 0;
    for (int k = 2; i >= r->s->dimension && k <= order; k++) s[t->input[l] + k] = 0;
  }
  if (r->s->timed) series_rules(t, &t->before, 1, order, stride, s);
  for (int k = 1; k <= order; k++) {
    series_rules(t, &t->loop, k, k, stride, s);
    if (slides) {
      follow_layer(r, e, k);
      inputs_of(r, e, k);
      for (int32_t l = t->states; l < t->inputs; l++) s[t->input[l] + k] = r->input[t->index[l]];
      series_rules(t, &t->loop_late, k, k, stride, s);
    }
    if (k == order) break;
    if (r->has_roots) next_states(r, e, k);
    for (int32_t l = 0; l < t->states; l++) {
      int i = t->index[l];
      s[t->input[l] + k + 1] = r->has_roots ? e->states[(int64_t)i * stride + k + 1] : row_of(r, i)[k] * PART[k + 1];
    }
  }
  for (int i = 0; i < r->n && !r->has_roots; i++) {
    const double *field = row_of(r, i);
    double *x = e->states + (int64_t)i * stride;
    for (int k = 1; k < order; k++) x[k + 1] = field[k] * PART[k + 1];
  }
  series_rules(t, &t->after, 1, order, stride, s);
}

/* Values of the outputs at r->input. */
static void first_values(Run *r, int is_free) {
  const Series *t = is_free ? &r->s->free : &r->s->series;
  series_at(t, &t->values, 0, r->stride, r->input, r->series);
}

/* The field at a state with given multipliers and unknowns. */
static void field_of(Run *r, const double *x, const double *held, const double *unknowns, double *field) {
  set_inputs(r, x, held, unknowns);
  first_values(r, 0);
  for (int i = 0; i < r->n; i++) field[i] = row_of(r, i)[0];
}

/* Rounding of the values at r->input, in units of EPSILON. */
static void weigh_rounding(Run *r, int is_free, double size) {
  const Series *t = is_free ? &r->s->free : &r->s->series;
  series_at(t, &t->moving, 0, r->stride, r->input, r->series);
  series_rounding(t, size, r->s->timed ? r->n - 1 : -1, r->time_size, r->begun.high, r->series, r->rounding);
}

static void jets(Run *r, Expansion *e) {
  r->expansion = e;
  if (r->s->sets) {
    set_series(r, e);
    measure_limits(r, e);
  } else mode_series(r, e);
  guard_rows(r, &e->l, e->series, r->order + 1, e->guards);
}

/* Whether all coefficients are finite: one that is not makes all later ones so, except in the field itself, which is not
 * used again where a logarithm's argument is negative. */
static int is_finite(const Run *r, const Expansion *e) {
  int order = r->order, stride = r->stride;
  double one = 0, two = 0, three = 0;
  for (int i = 0; i < r->s->dimension; i++) {
    const double *c = e->states + (int64_t)i * stride;
    one += 0 * c[order]; two += 0 * c[order - 1]; three += 0 * c[1];
  }
  for (int j = 0; j < e->l.rows; j++) {
    const double *g = e->guards + (int64_t)j * stride;
    one += 0 * g[order]; two += 0 * g[order - 1]; three += 0 * g[0];
  }
  return one + two + three == 0;
}

/* Whether a mode's layer slope may be singular. */
static int may_be_singular(const Run *r, const Layout *l) {
  return l->slides > 1 || (l->slides && is_half_line(r, l->sliding[0]));
}

/* Set entries of the inverse of m to zero that only rounding made nonzero, by the sparsity of m. */
static void clean_inverse(const double *m, int n, double *inverse) {
  for (int i = 0; i < n; i++) {
    double most = 0;
    for (int pass = 0; pass < 2; pass++)
      for (int j = 0; j < n; j++) {
        double row = 0;
        for (int k = 0; k < n; k++) row = larger(fabs(m[j * n + k]), row);
        if (pass == 0) most = larger(fabs(inverse[i * n + j]) * row, most);
        else if (!(fabs(inverse[i * n + j]) * row > VANISHES * most)) inverse[i * n + j] = 0;
      }
  }
}

/* Inverse of the layer's slope in a mode. If it is singular, as for two contacts with the same slip, the generalised inverse
 * of least change of the unknowns in units of their bounds; the motion does not depend on the choice. */
static int invert_layer(Run *r, const Layout *l, const double *unknowns, double *inverse) {
  int n = l->slides, w = r->width, is_regular = 1;
  double *a = r->work, *m = a + n * n, *size = m + n * n, most = 0;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) a[i * n + j] = m[i * n + j] = r->slope[l->sliding[i] * w + l->sliding[j]];
  is_regular = invert(a, n, inverse);
  for (int i = 0; n > 1 && i < n; i++) /* the same in all units of rows and columns */
    for (int j = 0; j < n; j++) is_regular &= fabs(m[i * n + j] * inverse[j * n + i]) < 1 / SINGULAR;
  if (is_regular && r->s->combined) clean_inverse(m, n, inverse);
  if (is_regular || !may_be_singular(r, l)) return 1;
  for (int i = 0; i < n; i++) {
    int own = l->sliding[i];
    size[i] = is_bounded(r, own) ? fabs(factor_of(r, own)) : fabs(unknowns[own]);
    most = larger(size[i], most);
  }
  most = most > 0 ? most : 1;
  for (int i = 0; i < n; i++) size[i] = has_law(r, l->sliding[i], JOINT_LAW) ? most / MERGED : larger(size[i], MERGED * most);
  for (int i = 0; r->s->sets && i < n; i++) size[i] = sqrt(size[i]); /* shares in proportion to the bounds */
  return invert_any(m, n, size, inverse, size + n, r->pending) && 0;
}

static int root_of_group(int32_t *root, int i) {
  while (root[i] != i) i = root[i] = root[root[i]];
  return i;
}

/* Groups of those that slide which the layer's slope couples: positions ``member``, of each group from ``first`` on, in order.
 * Returns their number. */
static int groups_of_layer(const Run *r, const Layout *l, const int32_t **member, const int32_t **first) {
  int n = l->slides, w = r->width, groups = 0;
  const Entries *slope = &r->s->slope;
  int32_t *own = r->groups, *from = own + n, *at = from + n + 1, *root = at + w, *number = root + n;
  for (int i = 0; i < w; i++) at[i] = -1;
  for (int i = 0; i < n; i++) { at[l->sliding[i]] = root[i] = i; from[i + 1] = 0; }
  for (int e = 0; e < slope->count; e++) {
    int i = at[slope->row[e]], j = at[slope->column[e]];
    if (i < 0 || j < 0 || i == j || r->slope[slope->row[e] * w + slope->column[e]] == 0) continue;
    i = root_of_group(root, i);
    j = root_of_group(root, j);
    root[i < j ? j : i] = i < j ? i : j;
  }
  for (int i = 0; i < n; i++) {
    int head = root_of_group(root, i);
    number[i] = head == i ? groups++ : number[head];
    from[number[i] + 1]++;
  }
  from[0] = 0;
  for (int g = 0; g < groups; g++) from[g + 1] += from[g];
  for (int i = 0; i < n; i++) at[i] = 0;
  for (int i = 0; i < n; i++) own[from[number[i]] + at[number[i]]++] = i;
  *member = own;
  *first = from;
  return groups;
}

/* The layer's slope among some of those that slide. */
static void slope_among(const Run *r, const Layout *l, const int32_t *member, int n, double *a) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) a[i * n + j] = r->slope[l->sliding[member[i]] * r->width + l->sliding[member[j]]];
}

/* Add nonzero entries of rows of the inverse. */
static void add_inverse(Expansion *e, const int32_t *member, int n, const double *inverse) {
  for (int i = 0; i < n; i++) {
    int own = member ? member[i] : i;
    e->from[own] = e->entries;
    for (int j = 0; j < n; j++) {
      if (inverse[i * n + j] == 0) continue;
      e->column[e->entries] = member ? member[j] : j;
      e->inverse[e->entries++] = inverse[i * n + j];
    }
    e->to[own] = e->entries;
  }
}

/* Inverse of the layer's slope of an expansion, group by group where all of them have one. */
static int invert_groups(Run *r, Expansion *e, const double *unknowns) {
  const Layout *l = &e->l;
  const int32_t *member, *first;
  int is_regular = !r->s->combined, groups = is_regular ? groups_of_layer(r, l, &member, &first) : 0;
  e->entries = 0;
  for (int g = 0; g < groups && is_regular; g++) {
    const int32_t *own = member + first[g];
    int n = first[g + 1] - first[g];
    double *a = r->work, *inverse = a + (int64_t)n * n;
    slope_among(r, l, own, n, a);
    is_regular = invert(a, n, inverse);
    slope_among(r, l, own, n, a);
    for (int i = 0; l->slides > 1 && i < n; i++)
      for (int j = 0; j < n; j++) is_regular &= fabs(a[i * n + j] * inverse[j * n + i]) < 1 / SINGULAR;
    add_inverse(e, own, n, inverse);
  }
  if (is_regular || (!r->s->combined && !may_be_singular(r, l))) return 1;
  is_regular = invert_layer(r, l, unknowns, r->matrix);
  e->entries = 0;
  add_inverse(e, 0, l->slides, r->matrix);
  return is_regular;
}

/* Near a surface with a root h has a relative tolerance: the root magnifies errors of h. */
static void allow_for_roots(Run *r, Expansion *e) {
  const Entries *g = &r->s->surface_gradient;
  double *state = r->vector;
  for (int k = 0; k < r->n; k++) state[k] = e->states[(int64_t)k * r->stride];
  const double *h = surface_values(r, state);
  for (int q = 0; q < g->count; q++) {
    int i = g->row[q], k = g->column[q];
    if (i >= r->m || element(r, i)->power == 0 || e->l.letter[i] == 0 || k >= r->s->dimension) continue;
    double slope = fabs(out_of(&r->s->surfaces, r->heights, r->kept_rows + q));
    double allowed = slope > 0 ? larger(SAFETY * r->o.rtol * fabs(h[i]) / slope, EPSILON * EPSILON) : INFINITY;
    e->allowed[k] = smaller(e->allowed[k], larger(allowed, EPSILON * fabs(state[k])));
  }
}

/* Jets of a mode at x, with sliding multipliers; inverses of the layer's slope. */
static void expand(Run *r, const int8_t *letter, const double *x, const double *unknowns, Expansion *e) {
  int w = r->width, stride = r->stride;
  e->end = 0;
  lay_out(r, letter, &e->l);
  aim(r, letter, x, unknowns);
  weigh_point(r, e, x, unknowns);
  int slides = e->l.slides;
  if (slides && !invert_groups(r, e, unknowns)) r->dependent = e->l.mode;
  if (!e->l.is_free || r->s->sets) memset(e->series, 0, sizeof(double) * w * stride);
  else for (int i = 0; i < w; i++) e->series[(int64_t)i * stride] = 0;
  for (int i = 0; i < r->n; i++) e->states[(int64_t)i * stride] = x[i];
  for (int i = 0; i < slides; i++) e->series[(int64_t)e->l.sliding[i] * stride] = unknowns[e->l.sliding[i]];
  for (int i = 0; i < r->n; i++)
    e->allowed[i] = i < r->s->dimension ? SAFETY * (r->o.atol + r->o.rtol * fabs(x[i])) : 0;
  if (r->has_roots) allow_for_roots(r, e);
  if (r->s->sets) begin_sets(r, e, unknowns);
  else guard_sums(r, e, e->allowed, 0, e->of_guards);
  e->scaled = e->steepened = 0;
  jets(r, e);
  if (r->s->sets) { /* |h| is known now */
    weigh_again(r, e);
    guard_sums(r, e, e->allowed, 0, e->of_guards);
  }
  e->finite = is_finite(r, e);
}

/* The step of Newton's method with a singular layer slope; 0 where the equations are inconsistent. */
static int step_dependent(Run *r, const Layout *l, const double *unknowns, double *b) {
  int n = l->slides, w = r->width;
  double *rates = r->small + w;
  if (!may_be_singular(r, l)) return 0;
  invert_layer(r, l, unknowns, r->matrix);
  memset(b, 0, sizeof(double) * n);
  for (int pass = 0; pass < 3; pass++) { /* joints make the inverse inexact */
    int fits = 1;
    for (int i = 0; i < n; i++) {
      double terms = fabs(rates[i] = layer_of(r, l->sliding[i]));
      for (int j = 0; j < n; j++) {
        double slope = r->slope[l->sliding[i] * w + l->sliding[j]];
        rates[i] -= slope * b[j];
        terms += fabs(slope * b[j]) + VANISHES / MERGED * fabs(slope * unknowns[l->sliding[j]]);
      }
      fits &= fabs(rates[i]) <= MERGED * terms;
    }
    if (pass && fits) return 1;
    for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) b[i] += r->matrix[i * n + j] * rates[j];
  }
  return 0;
}

/* Changes of those that slide by Newton's method, group by group; 0 where a group is singular. */
static int solve_groups(Run *r, const Layout *l, double *b) {
  const int32_t *member, *first;
  int groups = groups_of_layer(r, l, &member, &first);
  for (int g = 0; g < groups; g++) {
    const int32_t *own = member + first[g];
    int n = first[g + 1] - first[g];
    double *right = b + l->slides;
    slope_among(r, l, own, n, r->work);
    for (int i = 0; i < n; i++) right[i] = layer_of(r, l->sliding[own[i]]);
    if (!solve(r->work, right, n)) return 0;
    for (int i = 0; i < n; i++) b[own[i]] = right[i];
  }
  return 1;
}

/* Multipliers that keep the state on the sliding surfaces: one Newton step, as they enter linearly, and one against
 * rounding. 0 where there are none. */
static int improve(Run *r, const Layout *l, const double *x, double *unknowns, int steps) {
  int w = r->width, slides = l->slides;
  for (int iteration = 0; slides && iteration < steps; iteration++) {
    double largest = 0, most = 0;
    aim(r, l->letter, x, unknowns);
    error_scales(r, x, held_of(r, l->letter), unknowns);
    double *b = r->work + (int64_t)slides * slides;
    int is_known = r->dependent != l->mode && !r->s->combined && solve_groups(r, l, b);
    if (!is_known && !step_dependent(r, l, unknowns, b)) return 0;
    for (int i = 0; i < slides; i++) {
      unknowns[l->sliding[i]] -= b[i];
      largest = larger(fabs(b[i]), largest);
    }
    for (int i = 0; i < w; i++) most = larger(fabs(unknowns[i]), most);
    if (largest <= IMPROVED * (1 + most)) break;
  }
  return 1;
}
