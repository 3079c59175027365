/* Implicit steps: collocation at Radau points, where a motion decays faster than it changes.
 *
 * Stages z_i = x(c_i h) - x(0) solve A z / h = F(x(0) + z) by simplified Newton's method in the eigenvectors of A
 * (Hairer & Wanner 1996, section IV.8). Multipliers of what slides follow from the layer in every stage. The
 * polynomial through the stages has the place of a Taylor polynomial; guards are interpolated at the same nodes. An
 * event ends a step that is made anew with its length, so that it is a stage.
 */

/* What implicit steps need: whether they are on; steps in a row that were held by a decay rate, how many are waited
 * for; lengths and errors of the last step; a vector that is turned to the fastest rate. */
struct Collocation {
  const Radau *method;
  int32_t wait, idle, steps, is_fresh, is_end_known, rejected, modes, band, *pivot;
  int64_t leg; /* events before the leg that goes on */
  int8_t *known; /* modes in which implicit steps are on */
  double h, length, from, error, rho, rate; /* length, from: of the polynomial in ``powers``, and where this step begins in it */
  double *weight, *z, *rates, *unknowns, *residual, *change, *powers, *start_rate, *end, *end_rate, *estimate, *guards;
  double *jacobian, *end_jacobian, *factors, *pairs, *fast, *work, *program, *layer, *by_unknown, *slope, *inverse;
  void *arena;
};

static size_t place_collocation(Collocation *m, const Run *r, char *base) {
  size_t used = 0, n = r->n, w = r->width, s = m->method->s, square = n * n, pairs = (s - 1) / 2;
  m->pivot = INTEGERS(n * (pairs + 2));
  m->weight = DOUBLES(n);
  m->z = DOUBLES(s * n);
  m->rates = DOUBLES(s * n);
  m->unknowns = DOUBLES((s + 1) * w);
  m->residual = DOUBLES(s * n);
  m->change = DOUBLES(s * n);
  m->powers = DOUBLES(s * n);
  m->guards = DOUBLES(2 * s * (w > (size_t)r->guards ? w : (size_t)r->guards));
  m->start_rate = DOUBLES(n);
  m->end = DOUBLES(n);
  m->end_rate = DOUBLES(n);
  m->estimate = DOUBLES(n);
  m->jacobian = DOUBLES(square);
  m->end_jacobian = DOUBLES(square);
  m->factors = DOUBLES(2 * square);
  m->pairs = DOUBLES(2 * pairs * square);
  m->fast = DOUBLES(n);
  m->work = DOUBLES(4 * n + w);
  m->program = DOUBLES(r->s->implicit ? series_room(r->s->implicit, 1) : 0);
  m->layer = DOUBLES(w * n);
  m->by_unknown = DOUBLES(w * n);
  m->slope = DOUBLES(w * w);
  m->inverse = DOUBLES(w * w);
  return used;
}

/* Memory for implicit steps; 0 where there is none. */
static int begin_collocation(Run *r) {
  Collocation *m = r->collocation;
  if (m) return 1;
  m = calloc(1, sizeof(Collocation));
  if (!m) return 0;
  m->method = RADAU + (r->o.rtol < SEVEN_STAGES && r->order >= 7);
  m->arena = calloc(1, place_collocation(m, r, 0));
  if (!m->arena) { free(m); return 0; }
  place_collocation(m, r, m->arena);
  if (r->s->implicit) {
    series_prepare(r->s->implicit, r->p, m->program);
    pairs_begin(r->s->implicit->size, 1, r->begun, m->program);
  }
  for (int i = 0; i < r->n; i++) m->fast[i] = 1 + 0.1 * i / r->n;
  m->wait = HELD_STEPS;
  m->leg = -1;
  r->collocation = m;
  return 1;
}

static void end_collocation(Run *r) {
  if (!r->collocation) return;
  free(r->collocation->known);
  free(r->collocation->arena);
  free(r->collocation);
  r->collocation = 0;
}

/* Matrices -------------------------------------------------------------------------------------------------- */

/* The state in the place k of the matrices, in which what belongs together is close. */
static int placed(const Run *r, int k) { return r->s->places ? r->s->places[k] : k; }

/* Largest distance from the diagonal. */
static int band_of(const Run *r, const double *jacobian) {
  int n = r->n, band = 0;
  for (int i = 0; i < n; i++) {
    const double *row = jacobian + (int64_t)placed(r, i) * n;
    for (int j = 0; j < n; j++) {
      int far = i > j ? i - j : j - i;
      if (far > band && row[placed(r, j)] != 0) band = far;
    }
  }
  return band;
}

/* Factors of g/h - J for the real eigenvalue, behind ``factors`` if at the end. */
static int factor_filter(Run *r, const double *jacobian, double h, double *factors, int32_t *pivot) {
  Collocation *m = r->collocation;
  int n = r->n, band = band_of(r, jacobian);
  double shift = m->method->eigenvalues[0] / h;
  if (band > m->band) m->band = band;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      factors[(int64_t)i * n + j] = (i == j ? shift : 0) - jacobian[(int64_t)placed(r, i) * n + placed(r, j)];
  return factor_real(factors, n, m->band, pivot);
}

static int factor_pairs(Run *r, double h) {
  Collocation *m = r->collocation;
  int n = r->n;
  for (int q = 1; q < (m->method->s + 1) / 2; q++) {
    double *f = m->pairs + 2 * (int64_t)(q - 1) * n * n;
    const double *eigenvalue = m->method->eigenvalues + 2 * q;
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) {
        double *c = f + 2 * ((int64_t)i * n + j);
        c[0] = (i == j ? eigenvalue[0] / h : 0) - m->jacobian[(int64_t)placed(r, i) * n + placed(r, j)];
        c[1] = i == j ? eigenvalue[1] / h : 0;
      }
    if (!factor_complex(f, n, m->band, m->pivot + (q + 1) * n)) return 0;
  }
  return 1;
}

/* (g/h - J)^-1 times a rate, in place. */
static void filter(const Run *r, const double *factors, const int32_t *pivot, double *rate) {
  Collocation *m = r->collocation;
  double *b = m->work;
  for (int i = 0; i < r->n; i++) b[i] = rate[placed(r, i)];
  solve_real(factors, r->n, m->band, pivot, b);
  for (int i = 0; i < r->n; i++) rate[placed(r, i)] = b[i];
}

/* In the weights; the time has none. */
static double weighed(const Run *r, const double *v) {
  double most = 0;
  for (int i = 0; i < r->s->dimension; i++) {
    double size = fabs(v[i]) / r->collocation->weight[i];
    if (!(size <= most)) most = size;
  }
  return most;
}

/* Field and its derivatives ---------------------------------------------------------------------------------- */

static int rate_at(Run *r, const Expansion *e, const double *x, double *unknowns, double *rate) {
  if (!improve(r, &e->l, x, unknowns, 2)) return 0;
  evaluate(r, e, x, unknowns);
  for (int i = 0; i < r->n; i++) rate[i] = row_of(r, i)[0];
  return finite_all(rate, r->n);
}

/* The field's derivative by the states, multipliers of what slides following them. */
static int jacobian_at(Run *r, const Layout *l, const double *x, const double *unknowns, double *jacobian) {
  Collocation *m = r->collocation;
  const Series *t = r->s->implicit;
  const Entries *g = &r->s->derivatives;
  int n = r->n, w = r->width, slides = l->slides, size = moving_size(r), *where = r->pending;
  int first = n + 3 * w + r->s->rules.atoms + r->s->slope_outputs;
  for (int i = 0; i < w; i++) where[i] = -1;
  for (int i = 0; i < slides; i++) where[l->sliding[i]] = i;
  aim(r, l->letter, x, unknowns);
  set_inputs(r, x, held_of(r, l->letter), unknowns);
  series_at(t, &t->values, 0, 1, r->input, m->program);
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

/* The stages ------------------------------------------------------------------------------------------------- */

/* Residuals of the stages at the present z; 0 where the field has no value. */
static int residuals(Run *r, const Expansion *e, double h) {
  Collocation *m = r->collocation;
  int n = r->n, s = m->method->s;
  double *x = m->work;
  for (int i = 0; i < s; i++) {
    for (int k = 0; k < n; k++) x[k] = e->states[(int64_t)k * r->stride] + m->z[i * n + k];
    if (!rate_at(r, e, x, m->unknowns + (i + 1) * r->width, m->rates + i * n)) return 0;
    for (int k = 0; k < n; k++) {
      double sum = 0;
      for (int j = 0; j < s; j++) sum += m->method->slopes[i * s + j] * m->z[j * n + k];
      m->residual[i * n + k] = m->rates[i * n + k] - sum / h;
    }
  }
  return 1;
}

/* One step of Newton's method; its size in the weights. */
static double correct(Run *r) {
  Collocation *m = r->collocation;
  const Radau *t = m->method;
  int n = r->n, s = t->s;
  double *own = m->work, *change = m->change, most = 0;
  memset(change, 0, sizeof(double) * s * n);
  for (int q = 0; q < (s + 1) / 2; q++) {
    const double *left = t->left + 2 * q * s, *right = t->right + 2 * q * s;
    memset(own, 0, sizeof(double) * 2 * n);
    for (int i = 0; i < s; i++)
      for (int k = 0; k < n; k++) {
        double value = m->residual[i * n + placed(r, k)];
        if (q) { own[2 * k] += left[2 * i] * value; own[2 * k + 1] += left[2 * i + 1] * value; }
        else own[k] += left[2 * i] * value;
      }
    if (q) solve_complex(m->pairs + 2 * (int64_t)(q - 1) * n * n, n, m->band, m->pivot + (q + 1) * n, own);
    else solve_real(m->factors, n, m->band, m->pivot, own);
    for (int i = 0; i < s; i++)
      for (int k = 0; k < n; k++)
        change[i * n + placed(r, k)] +=
            q ? 2 * (right[2 * i] * own[2 * k] - right[2 * i + 1] * own[2 * k + 1]) : right[2 * i] * own[k];
  }
  for (int i = 0; i < s; i++) {
    double size = weighed(r, change + i * n);
    if (!(size <= most)) most = size;
  }
  for (int i = 0; i < s * n; i++) m->z[i] += change[i];
  return most;
}

/* Solve a step of length h from the guess in z; 0 where Newton's method fails. */
static int solve_stages(Run *r, const Expansion *e, double h) {
  Collocation *m = r->collocation;
  double before = 0, least = smaller(MOST_CHANGE, larger(LEAST_CHANGE, SOLVED / r->o.rtol));
  int most = 10 + m->method->s / 2;
  for (int k = 0; k <= m->method->s; k++) memcpy(m->unknowns + k * r->width, r->unknowns, sizeof(double) * r->width);
  m->rate = 0;
  for (int iteration = 0; iteration < most; iteration++) {
    if (!residuals(r, e, h)) return 0;
    double size = correct(r), rate = iteration ? size / before : 0.5;
    if (!(size < INFINITY)) return 0;
    if (iteration > 1) m->rate = larger(rate, m->rate);
    if (size < least || (iteration && rate < 1 && size * rate < NEWTON * (1 - rate))) return 1;
    if (iteration && rate >= 1 && size < 30 * least) return 1;
    if (iteration > 1 && (rate >= 1 || (rate > 0.5 && size * pow(rate, most - 1 - iteration) > 1))) return 0;
    before = size;
  }
  return 0;
}

/* Coefficients of the polynomial through s rows of values that begins at zero: row i has power i + 1 of the part of
 * the step. */
static void powers_of(const Radau *t, const double *values, int n, double *to) {
  for (int k = 0; k < t->s; k++)
    for (int i = 0; i < n; i++) {
      double sum = 0;
      for (int j = 0; j < t->s; j++) sum += t->powers[k * t->s + j] * values[j * n + i];
      to[k * n + i] = sum;
    }
}

/* A guess: the last polynomial goes on, or nothing moves but the time. */
static void guess_stages(Run *r, double h) {
  Collocation *m = r->collocation;
  int n = r->n, s = m->method->s;
  double part = m->length > 0 ? h / m->length : INFINITY;
  for (int k = 0; k < n; k++) {
    double begun = 0;
    for (int j = s - 1; j >= 0; j--) begun = (begun + m->powers[j * n + k]) * m->from;
    for (int i = 0; i < s; i++) {
      double at = m->from + part * m->method->nodes[i], sum = 0;
      for (int j = s - 1; j >= 0; j--) sum = (sum + m->powers[j * n + k]) * at;
      m->z[i * n + k] = part <= 2 ? sum - begun : 0;
    }
  }
}

/* The error of the polynomial, in the weights: its defect at the start, without what decays. */
static double error_of(Run *r, const Expansion *e, double h, int again) {
  Collocation *m = r->collocation;
  int n = r->n, s = m->method->s;
  double *est = m->estimate, *x = m->work + n, *unknowns = m->unknowns;
  for (int pass = 0; pass < 1 + again; pass++) {
    if (pass) {
      for (int k = 0; k < n; k++) x[k] = e->states[(int64_t)k * r->stride] + est[k];
      memcpy(unknowns, r->unknowns, sizeof(double) * r->width);
      if (!rate_at(r, e, x, unknowns, est)) return INFINITY;
    } else memcpy(est, m->start_rate, sizeof(double) * n);
    for (int k = 0; k < n; k++) {
      double slope = 0;
      for (int j = 0; j < s; j++) slope += m->method->powers[j] * m->z[j * n + k];
      est[k] -= slope / h;
    }
    filter(r, m->factors, m->pivot, est);
    double error = m->method->weight * weighed(r, est);
    if (error <= 1 || pass == again) return error;
  }
  return INFINITY;
}

/* Whether the derivative at the end agrees: with that of the start Newton's method is blind where a step has left a
 * thin layer. */
static int end_agrees(Run *r, const Expansion *e, double h) {
  Collocation *m = r->collocation;
  int n = r->n, s = m->method->s;
  double *unknowns = m->unknowns + s * r->width, *rest = m->estimate, *factors = m->factors + (int64_t)n * n;
  for (int k = 0; k < n; k++) m->end[k] = e->states[(int64_t)k * r->stride] + m->z[(s - 1) * n + k];
  if (!rate_at(r, e, m->end, unknowns, m->end_rate)) return 0;
  if (!jacobian_at(r, &e->l, m->end, unknowns, m->end_jacobian)) return 0;
  for (int k = 0; k < n; k++) {
    double slope = 0;
    for (int j = 0; j < s; j++) slope += m->method->slopes[(s - 1) * s + j] * m->z[j * n + k];
    rest[k] = m->end_rate[k] - slope / h;
  }
  if (!factor_filter(r, m->end_jacobian, h, factors, m->pivot + n)) return 0;
  filter(r, factors, m->pivot + n, rest);
  return weighed(r, rest) <= NEWTON;
}

/* Polynomials ------------------------------------------------------------------------------------------------ */

/* Write s coefficients after the first of series, for powers of the time. */
static void write_powers(const Radau *t, const double *powers, int n, double h, int stride, double *series) {
  double part = 1;
  for (int k = 0; k < t->s; k++) {
    part /= h;
    for (int i = 0; i < n; i++) series[(int64_t)i * stride + k + 1] = powers[k * n + i] * part;
  }
  for (int i = 0; i < n; i++)
    memset(series + (int64_t)i * stride + t->s + 1, 0, sizeof(double) * (stride - t->s - 1));
}

/* The guards' series, through their values at the stages. */
static void interpolate_guards(Run *r, Expansion *e, double h) {
  Collocation *m = r->collocation;
  const Radau *t = m->method;
  int n = r->n, s = t->s, w = r->width, rows = e->l.rows;
  double *values = m->guards, *powers = values + (int64_t)s * rows, *x = m->work;
  for (int i = 0; i < s; i++) {
    double *unknowns = m->unknowns + (i + 1) * w;
    for (int k = 0; k < n; k++) x[k] = e->states[(int64_t)k * r->stride] + m->z[i * n + k];
    evaluate(r, e, x, unknowns);
    const double *g = guards_at(r, e, unknowns);
    for (int row = 0; row < rows; row++)
      values[i * rows + row] = g[(int64_t)row * r->stride] - e->guards[(int64_t)row * r->stride];
  }
  powers_of(t, values, rows, powers);
  write_powers(t, powers, rows, h, r->stride, e->guards);
}

/* Series of states, of unknowns and of guards. */
static void write_step(Run *r, Expansion *e, double h) {
  Collocation *m = r->collocation;
  const Radau *t = m->method;
  int n = r->n, s = t->s, w = r->width;
  double *values = m->guards, *powers = values + (int64_t)s * w;
  powers_of(t, m->z, n, m->powers);
  write_powers(t, m->powers, n, h, r->stride, e->states);
  for (int i = 0; i < w; i++) e->series[(int64_t)i * r->stride] = r->unknowns[i];
  for (int i = 0; i < s; i++)
    for (int k = 0; k < w; k++) values[i * w + k] = m->unknowns[(i + 1) * w + k] - r->unknowns[k];
  powers_of(t, values, w, powers);
  write_powers(t, powers, w, h, r->stride, e->series);
  interpolate_guards(r, e, h);
  m->length = h;
  m->from = 0;
  e->end = m->end;
}

/* Whether guards that may vanish are those of the polynomials, between the stages. */
static int guards_agree(Run *r, Expansion *e, double h) {
  Collocation *m = r->collocation;
  const Radau *t = m->method;
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

/* Step length for an error, from the last ones. */
static double next_length(const Collocation *m, double h, double error) {
  double order = m->method->s + 1, size = larger(error, TIED);
  double longest = m->rejected ? 1 : 5, factor = smaller(longest, 0.9 * pow(size, -1 / order));
  factor = smaller(factor, 0.99 * pow(size, -1 / order) * pow(larger(m->error, 0.01) / size, 0.3 / order));
  if (m->rate > 0.2) factor = smaller(factor, larger(0.5, sqrt(0.2 / m->rate)));
  return h * factor;
}

/* What a step begins with: first coefficients of guards, what is allowed, the field. */
static int begin_step(Run *r, Expansion *e) {
  Collocation *m = r->collocation;
  int order = r->order;
  r->order = 1;
  expand(r, r->letter, r->x, r->unknowns, e);
  r->order = order;
  if (!e->finite) return 0;
  for (int i = 0; i < r->n; i++) m->start_rate[i] = e->states[(int64_t)i * r->stride + 1];
  for (int i = 0; i < r->s->dimension; i++) m->weight[i] = r->o.atol + r->o.rtol * fabs(r->x[i]);
  return 1;
}

/* Solve with a length, from the derivative that is known; 0 if Newton's method fails. */
static int try_length(Run *r, Expansion *e, double h) {
  Collocation *m = r->collocation;
  m->band = 0;
  if (!factor_filter(r, m->jacobian, h, m->factors, m->pivot) || !factor_pairs(r, h)) return 0;
  guess_stages(r, h);
  return solve_stages(r, e, h);
}

/* A step of an allowed error from the present state; its length, or 0 where there is none. */
static double collocate(Run *r, Expansion *e, double most) {
  Collocation *m = r->collocation;
  if (!begin_step(r, e)) return 0;
  if (!m->is_fresh && !jacobian_at(r, &e->l, r->x, r->unknowns, m->jacobian)) return 0;
  m->is_fresh = m->is_end_known = 0;
  m->rejected = m->length == 0;
  for (int again = 0; again < SHORTENED; again++) {
    double h = m->h >= most ? most : 2 * m->h > most ? 0.5 * most : m->h, error;
    if (!(h > SHORTEST * time_scale(r))) return 0;
    if (!try_length(r, e, h)) {
      m->h = (m->length > 0 ? 0.5 : 0.3) * h;
      m->length = 0;
      continue;
    }
    error = error_of(r, e, h, m->rejected);
    if (error <= 1 && end_agrees(r, e, h)) {
      double next = next_length(m, h, error);
      write_step(r, e, h);
      if (!guards_agree(r, e, h)) { m->h = 0.5 * h; continue; }
      m->h = h < m->h ? larger(m->h, next) : next;
      m->error = error;
      m->is_end_known = 1;
      return h;
    }
    m->h = h * (error <= 1 ? 0.3 : larger(0.1, smaller(0.8, 0.9 * pow(error, -1.0 / (m->method->s + 1)))));
    m->rejected = 1;
  }
  return 0;
}

/* Make the step anew with the length at which a guard is zero, or with a given one where there is none. */
static int end_at(Run *r, Expansion *e, int row, double *dt) {
  Collocation *m = r->collocation;
  int n = r->n, s = m->method->s, w = r->width, is_exact = row < 0 || (is_atom(e->l.kind[row]) && clock_of(r, row - e->l.atoms) >= 0);
  double time = *dt, slope = 0, before = 0, at = 0;
  if (!is_exact) horner(e->guards + (int64_t)row * r->stride, r->order, time, &slope);
  for (int again = 0; again < POLISHED + 3; again++) {
    if (!try_length(r, e, time)) return 0;
    for (int k = 0; k < n; k++) m->end[k] = e->states[(int64_t)k * r->stride] + m->z[(s - 1) * n + k];
    if (is_exact || slope == 0) break;
    evaluate(r, e, m->end, m->unknowns + s * w);
    double value = guards_at(r, e, m->unknowns + s * w)[(int64_t)row * r->stride];
    if (again && value != before) slope = (value - before) / (time - at);
    double change = value / slope;
    before = value;
    at = time;
    if (!(fabs(change) < 0.5 * time) || fabs(change) <= SOLVED * (time_scale(r) + time)) break;
    time -= change;
  }
  write_step(r, e, time);
  m->is_end_known = 0;
  *dt = time;
  return 1;
}
