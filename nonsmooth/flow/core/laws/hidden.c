/* Equations of the states alone from closed complementarity conditions of degree zero, as of capacitors that diodes join.
 *
 * Closed conditions have y = C x + D nu = 0. Each vector v with v D = 0 on them gives v C x = 0, which the multipliers keep
 * through its rate: one of its rows of the layer is replaced by v y', from which v D removes the rates of the multipliers.
 * Rows of the layer are sums of all y and of all y' with weights among the parameters of the programs.
 *
 * Source: Hairer & Wanner 1996, Solving Ordinary Differential Equations II, chapter VII (index reduction).
 */

/* The rows at present: unknown, as given, their rates, those of a mode. */
enum { UNKNOWN_ROWS, GIVEN_ROWS, RATE_ROWS, MODE_ROWS };

static void forget_rows(Run *r) {
  r->equations.kind = UNKNOWN_ROWS;
  r->equations.is_known = r->equations.is_raw = r->equations.count = 0;
  r->equations.off = 0;
}

/* Weights of the rows: those of y, then those of y'. */
static double *weights_of(const Run *r) { return r->p + r->s->parameters; }

static void weights_changed(Run *r) {
  series_prepare(&r->s->series, r->p, r->series);
  values_prepare(&r->s->point, r->p, r->point);
  values_prepare(&r->s->columns, r->p, r->columns);
  prepare_implicit(r);
}

/* Rows as they are given, or their rates. */
static void plain_rows(Run *r, int kind) {
  int q = r->s->combined;
  double *to = weights_of(r) + (kind == RATE_ROWS ? q * q : 0);
  r->equations.count = 0;
  if (!q || r->equations.kind == kind) return;
  memset(weights_of(r), 0, sizeof(double) * 2 * q * q);
  for (int i = 0; i < q; i++) to[i * (q + 1)] = 1;
  r->equations.kind = kind;
  weights_changed(r);
}

/* Drop slopes that act only below rounding, as of very small resistances. */
static void drop_small_slopes(Run *r, const double *x) {
  Equations *h = &r->equations;
  int q = r->s->combined, w = r->width;
  double *of_y = r->small, *of_rates = of_y + w;
  layer_rounding(r, x, of_y);
  plain_rows(r, RATE_ROWS);
  error_scales(r, x, r->none, r->none);
  layer_rounding(r, x, of_rates);
  for (int i = 0; i < q; i++)
    for (int j = 0; j < w; j++) {
      int row = h->own[i];
      double *own = h->slope + i * w + j, time = of_y[row] / (of_rates[row] + fabs(layer_of(r, row)));
      if (*own == 0 || !(fabs(*own) <= UNDELAYED * smaller(time, r->o.t_end - r->t) * fabs(r->slope[row * w + j]))) continue;
      *own = 0;
      h->off = TENFOLD * UNDELAYED;
    }
}

/* Slopes and gradients of the conditions, which depend on parameters only. */
static void read_conditions(Run *r, const double *x) {
  Equations *h = &r->equations;
  const Entries *g = &r->s->layer_gradient;
  int count = 0, w = r->width, first = 2 * w + r->s->slope.count;
  if (h->is_known) return;
  plain_rows(r, GIVEN_ROWS);
  for (int i = 0; i < r->m; i++) if (has_law(r, i, COMPLEMENTARITY_LAW) && degree_of(r, i) == 0) h->own[count++] = i;
  error_scales(r, x, r->none, r->none);
  for (int i = 0; i < count; i++) memcpy(h->slope + i * w, r->slope + h->own[i] * w, sizeof(double) * w);
  memset(h->gradient, 0, sizeof(double) * count * r->n);
  for (int k = 0; k < g->count; k++)
    for (int i = 0; i < count; i++)
      if (h->own[i] == g->row[k]) h->gradient[i * r->n + g->column[k]] = out_of(&r->s->point, r->point, first + k);
  drop_small_slopes(r, x);
  h->is_known = 1;
}

/* Whether a sum of conditions is a function of the states, and not zero everywhere. */
static int is_of_states(const Run *r, const double *v, const int32_t *closed, int count) {
  const Equations *h = &r->equations;
  for (int k = 0; k < r->n; k++) {
    double sum = 0, terms = 0;
    for (int i = 0; i < count; i++) {
      double term = v[i] * h->gradient[closed[i] * r->n + k];
      sum += term;
      terms += fabs(term);
    }
    if (fabs(sum) > TIED * terms) return 1;
  }
  return 0;
}

/* Combine the rows of the closed conditions of a mode. */
static void combine_rows(Run *r, const int8_t *letter, const double *x) {
  Equations *h = &r->equations;
  int q = r->s->combined, w = r->width, closed = 0, columns = 0, free = 0;
  int32_t *which = h->mark, *pivot = which + q;
  if (!q) return;
  if (h->is_raw) { plain_rows(r, GIVEN_ROWS); return; }
  if (h->kind == MODE_ROWS && !memcmp(h->letter, letter, w)) return;
  read_conditions(r, x);
  double *e = h->work, *z = e + q * w, *rest = z + q * q, *of_y = weights_of(r), *of_rates = of_y + q * q;
  for (int i = 0; i < q; i++) if (letter[h->own[i]] == 0) which[closed++] = i;
  for (int j = 0; j < w; j++) {
    if (!is_half_line(r, j) || letter[j] != 0) continue;
    for (int i = 0; i < closed; i++) e[columns * closed + i] = h->slope[which[i] * w + j];
    columns++;
  }
  memset(of_y, 0, sizeof(double) * 2 * q * q);
  for (int i = 0; i < q; i++) of_y[i * (q + 1)] = 1;
  h->count = 0;
  int found = h->dependent = closed ? null_space(e, columns, closed, z, rest, pivot) : 0;
  for (int i = 0; i < closed && found; i++) {
    int is_free = 1;
    for (int k = 0; k < closed - found; k++) is_free &= pivot[k] != i;
    if (!is_free) continue;
    const double *v = z + free++ * closed;
    if (!is_of_states(r, v, which, closed)) continue;
    int row = which[i];
    of_y[row * (q + 1)] = 0;
    for (int k = 0; k < closed; k++) of_rates[row * q + which[k]] = v[k] / v[i];
    h->row[h->count++] = row;
  }
  memcpy(h->letter, letter, w);
  h->kind = MODE_ROWS;
  weights_changed(r);
}

/* Whether the present mode keeps y = 0 of a condition of degree zero through its rate. */
static int is_held_alone(Run *r, int own) {
  int q = r->s->combined, found = 0;
  combine_rows(r, r->letter, r->x);
  for (int k = 0; k < r->equations.count; k++) {
    int row = r->equations.row[k], others = 0;
    for (int i = 0; i < q; i++) others += i != row && weights_of(r)[(q + row) * q + i] != 0;
    found |= r->equations.own[row] == own && !others;
  }
  return found;
}

/* The equation in a row of a mode, from the functions y with multipliers zero; its rounding from theirs. */
static double hidden_sum(const Run *r, int row, const double *of, int is_rounding) {
  int q = r->s->combined;
  const double *weight = weights_of(r) + (q + row) * q;
  double sum = 0;
  for (int i = 0; i < q; i++) sum += (is_rounding ? fabs(weight[i]) : weight[i]) * of[r->equations.own[i]];
  return sum;
}
static double hidden_value(const Run *r, int row, const double *h) { return hidden_sum(r, row, h, 0); }
static double hidden_scale(const Run *r, int row, const double *scale) { return hidden_sum(r, row, scale, 1); }
