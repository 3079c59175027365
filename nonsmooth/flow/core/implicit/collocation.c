/* Implicit steps of a smooth field: collocation at Radau points.
 *
 * Stages z_i = x(c_i h) - x(0) solve A z / h = F(x(0) + z) by simplified Newton's method in the eigenvectors of A
 * (Hairer & Wanner 1996, section IV.8). The polynomial through the stages is the motion within the step.
 */

/* A field of n states, of which the first ``moving`` have errors; its values and derivatives at the stages of a step
 * (stage 0 is the start), which return 0 where undefined. Length and polynomial (in the normalised time) of the last step,
 * and the point in it where this one begins. */
typedef struct Collocation Collocation;
struct Collocation {
  const Radau *method;
  int32_t n, moving, is_fresh, rejected, band, *pivot;
  const int32_t *ordering; /* states in an order that reduces the bandwidth, or none */
  void *of;
  int (*rate_at)(void *of, int stage, const double *x, double *rate);
  int (*jacobian_at)(void *of, int stage, const double *x, double *jacobian);
  double rtol, h, length, from, error, rate, rho;
  double *x, *weight, *z, *rates, *residual, *change, *powers, *start_rate, *end, *end_rate, *estimate;
  double *jacobian, *end_jacobian, *factors, *pairs, *fast, *work;
};

static size_t place_collocation(Collocation *m, char *base, size_t used) {
  size_t n = m->n, s = m->method->s, square = n * n, pairs = (s - 1) / 2;
  m->pivot = INTEGERS(n * (pairs + 2));
  double **rows[] = {&m->x, &m->weight, &m->start_rate, &m->end, &m->end_rate, &m->estimate, &m->fast};
  double **stages[] = {&m->z, &m->rates, &m->residual, &m->change, &m->powers};
  for (int i = 0; i < 7; i++) *rows[i] = DOUBLES(n);
  for (int i = 0; i < 5; i++) *stages[i] = DOUBLES(s * n);
  m->jacobian = DOUBLES(square);
  m->end_jacobian = DOUBLES(square);
  m->factors = DOUBLES(2 * square);
  m->pairs = DOUBLES(2 * pairs * square);
  m->work = DOUBLES(4 * n);
  return used;
}

/* The state of row k of the matrices. */
static int state_at(const Collocation *m, int k) { return m->ordering ? m->ordering[k] : k; }

/* Half bandwidth. */
static int band_of(const Collocation *m, const double *jacobian) {
  int n = m->n, band = 0;
  for (int i = 0; i < n; i++) {
    const double *row = jacobian + (int64_t)state_at(m, i) * n;
    for (int j = 0; j < n; j++) {
      int far = i > j ? i - j : j - i;
      if (far > band && row[state_at(m, j)] != 0) band = far;
    }
  }
  return band;
}

/* Factors of g/h - J for the real eigenvalue g, after ``factors`` if at the end of the step. */
static int factor_filter(Collocation *m, const double *jacobian, double h, double *factors, int32_t *pivot) {
  int n = m->n, band = band_of(m, jacobian);
  double shift = m->method->eigenvalues[0] / h;
  if (band > m->band) m->band = band;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      factors[(int64_t)i * n + j] = (i == j ? shift : 0) - jacobian[(int64_t)state_at(m, i) * n + state_at(m, j)];
  return factor_real(factors, n, m->band, pivot);
}

static int factor_pairs(Collocation *m, double h) {
  int n = m->n;
  for (int q = 1; q < (m->method->s + 1) / 2; q++) {
    double *f = m->pairs + 2 * (int64_t)(q - 1) * n * n;
    const double *eigenvalue = m->method->eigenvalues + 2 * q;
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) {
        double *c = f + 2 * ((int64_t)i * n + j);
        c[0] = (i == j ? eigenvalue[0] / h : 0) - m->jacobian[(int64_t)state_at(m, i) * n + state_at(m, j)];
        c[1] = i == j ? eigenvalue[1] / h : 0;
      }
    if (!factor_complex(f, n, m->band, m->pivot + (q + 1) * n)) return 0;
  }
  return 1;
}

/* (g/h - J)^-1 times a rate, in place. */
static void filter(const Collocation *m, const double *factors, const int32_t *pivot, double *rate) {
  double *b = m->work;
  for (int i = 0; i < m->n; i++) b[i] = rate[state_at(m, i)];
  solve_real(factors, m->n, m->band, pivot, b);
  for (int i = 0; i < m->n; i++) rate[state_at(m, i)] = b[i];
}

/* Weighted norm. */
static double weighed(const Collocation *m, const double *v) {
  double most = 0;
  for (int i = 0; i < m->moving; i++) {
    double size = fabs(v[i]) / m->weight[i];
    if (!(size <= most)) most = size;
  }
  return most;
}

/* Residuals of the stages at the present z; 0 where the field has no value. */
static int residuals(Collocation *m, double h) {
  int n = m->n, s = m->method->s;
  double *x = m->work;
  for (int i = 0; i < s; i++) {
    for (int k = 0; k < n; k++) x[k] = m->x[k] + m->z[i * n + k];
    if (!m->rate_at(m->of, i + 1, x, m->rates + i * n)) return 0;
    for (int k = 0; k < n; k++) {
      double sum = 0;
      for (int j = 0; j < s; j++) sum += m->method->slopes[i * s + j] * m->z[j * n + k];
      m->residual[i * n + k] = m->rates[i * n + k] - sum / h;
    }
  }
  return 1;
}

/* One step of Newton's method; its weighted norm. */
static double correct(Collocation *m) {
  const Radau *t = m->method;
  int n = m->n, s = t->s;
  double *own = m->work, *change = m->change, most = 0;
  memset(change, 0, sizeof(double) * s * n);
  for (int q = 0; q < (s + 1) / 2; q++) {
    const double *left = t->left + 2 * q * s, *right = t->right + 2 * q * s;
    memset(own, 0, sizeof(double) * 2 * n);
    for (int i = 0; i < s; i++)
      for (int k = 0; k < n; k++) {
        double value = m->residual[i * n + state_at(m, k)];
        if (q) { own[2 * k] += left[2 * i] * value; own[2 * k + 1] += left[2 * i + 1] * value; }
        else own[k] += left[2 * i] * value;
      }
    if (q) solve_complex(m->pairs + 2 * (int64_t)(q - 1) * n * n, n, m->band, m->pivot + (q + 1) * n, own);
    else solve_real(m->factors, n, m->band, m->pivot, own);
    for (int i = 0; i < s; i++)
      for (int k = 0; k < n; k++)
        change[i * n + state_at(m, k)] +=
            q ? 2 * (right[2 * i] * own[2 * k] - right[2 * i + 1] * own[2 * k + 1]) : right[2 * i] * own[k];
  }
  for (int i = 0; i < s; i++) {
    double size = weighed(m, change + i * n);
    if (!(size <= most)) most = size;
  }
  for (int i = 0; i < s * n; i++) m->z[i] += change[i];
  return most;
}

/* Solve a step of length h from the guess in z; 0 where Newton's method fails. */
static int solve_stages(Collocation *m, double h) {
  double before = 0, least = smaller(MOST_CHANGE, larger(LEAST_CHANGE, SOLVED / m->rtol));
  int most = 10 + m->method->s / 2;
  m->rate = 0;
  for (int iteration = 0; iteration < most; iteration++) {
    if (!residuals(m, h)) return 0;
    double size = correct(m), rate = iteration ? size / before : 0.5;
    if (!(size < INFINITY)) return 0;
    if (iteration > 1) m->rate = larger(rate, m->rate);
    if (size < least || (iteration && rate < 1 && size * rate < NEWTON * (1 - rate))) return 1;
    if (iteration && rate >= 1 && size < 30 * least) return 1;
    if (iteration > 1 && (rate >= 1 || (rate > 0.5 && size * pow(rate, most - 1 - iteration) > 1))) return 0;
    before = size;
  }
  return 0;
}

/* Coefficients of the polynomial through zero and s rows of values: row i has power i + 1 of the normalised time. */
static void powers_of(const Radau *t, const double *values, int n, double *to) {
  for (int k = 0; k < t->s; k++)
    for (int i = 0; i < n; i++) {
      double sum = 0;
      for (int j = 0; j < t->s; j++) sum += t->powers[k * t->s + j] * values[j * n + i];
      to[k * n + i] = sum;
    }
}

/* Initial guess: the last polynomial extrapolated, or constant states. */
static void guess_stages(Collocation *m, double h) {
  int n = m->n, s = m->method->s;
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

/* Weighted error of the polynomial: its filtered defect at the start. */
static double error_of(Collocation *m, double h, int again) {
  int n = m->n, s = m->method->s;
  double *est = m->estimate, *x = m->work + n;
  for (int pass = 0; pass < 1 + again; pass++) {
    if (pass) {
      for (int k = 0; k < n; k++) x[k] = m->x[k] + est[k];
      if (!m->rate_at(m->of, 0, x, est)) return INFINITY;
    } else memcpy(est, m->start_rate, sizeof(double) * n);
    for (int k = 0; k < n; k++) {
      double slope = 0;
      for (int j = 0; j < s; j++) slope += m->method->powers[j] * m->z[j * n + k];
      est[k] -= slope / h;
    }
    filter(m, m->factors, m->pivot, est);
    double error = m->method->weight * weighed(m, est);
    if (error <= 1 || pass == again) return error;
  }
  return INFINITY;
}

/* Whether the derivative at the end confirms the step: that of the start does not show that a step left a thin layer. */
static int end_agrees(Collocation *m, double h) {
  int n = m->n, s = m->method->s;
  double *rest = m->estimate, *factors = m->factors + (int64_t)n * n;
  for (int k = 0; k < n; k++) m->end[k] = m->x[k] + m->z[(s - 1) * n + k];
  if (!m->rate_at(m->of, s, m->end, m->end_rate)) return 0;
  if (!m->jacobian_at(m->of, s, m->end, m->end_jacobian)) return 0;
  for (int k = 0; k < n; k++) {
    double slope = 0;
    for (int j = 0; j < s; j++) slope += m->method->slopes[(s - 1) * s + j] * m->z[j * n + k];
    rest[k] = m->end_rate[k] - slope / h;
  }
  if (!factor_filter(m, m->end_jacobian, h, factors, m->pivot + n)) return 0;
  filter(m, factors, m->pivot + n, rest);
  return weighed(m, rest) <= NEWTON;
}

/* Step length for an error, from the last ones. */
static double next_length(const Collocation *m, double h, double error) {
  double order = m->method->s + 1, size = larger(error, TIED);
  double longest = m->rejected ? 1 : 5, factor = smaller(longest, 0.9 * pow(size, -1 / order));
  factor = smaller(factor, 0.99 * pow(size, -1 / order) * pow(larger(m->error, 0.01) / size, 0.3 / order));
  if (m->rate > 0.2) factor = smaller(factor, larger(0.5, sqrt(0.2 / m->rate)));
  return h * factor;
}

/* Solve with a length and the known derivative; 0 if Newton's method fails. */
static int try_length(Collocation *m, double h) {
  m->band = 0;
  if (!factor_filter(m, m->jacobian, h, m->factors, m->pivot) || !factor_pairs(m, h)) return 0;
  guess_stages(m, h);
  return solve_stages(m, h);
}

/* Solve a step from x with an allowed error; its length from ``least`` to ``most``, or 0. */
static double collocate(Collocation *m, double most, double least) {
  if (!m->is_fresh && !m->jacobian_at(m->of, 0, m->x, m->jacobian)) return 0;
  m->is_fresh = 1;
  m->rejected |= m->length == 0;
  for (int again = 0; again < SHORTENED; again++) {
    double h = m->h >= most ? most : 2 * m->h > most ? 0.5 * most : m->h, error;
    if (!(h > least)) return 0;
    if (!try_length(m, h)) {
      m->h = (m->length > 0 ? 0.5 : 0.3) * h;
      m->length = 0;
      continue;
    }
    error = error_of(m, h, m->rejected);
    if (error <= 1 && end_agrees(m, h)) {
      double next = next_length(m, h, error);
      m->h = h < m->h ? larger(m->h, next) : next;
      m->error = error;
      powers_of(m->method, m->z, m->n, m->powers);
      m->length = h;
      m->from = 0;
      m->rejected = 0;
      return h;
    }
    m->h = h * (error <= 1 ? 0.3 : larger(0.1, smaller(0.8, 0.9 * pow(error, -1.0 / (m->method->s + 1)))));
    m->rejected = 1;
  }
  return 0;
}

/* Begin the next step at the end of this one, with the derivative there if it is known. */
static void go_on_from(Collocation *m, int is_known) {
  double *kept = m->jacobian;
  m->from = 1;
  m->is_fresh = is_known;
  m->jacobian = m->end_jacobian;
  m->end_jacobian = kept;
}

/* Add a stage to the equations of all stages, (A/h - J) dz = b, or to their transpose; 0 where they have no value. */
static int add_stage(Collocation *m, int stage, const double *x, double h, int transposed, double *matrix) {
  const Radau *t = m->method;
  int n = m->n, size = t->s * n;
  if (!m->jacobian_at(m->of, stage + 1, x, m->jacobian)) return 0;
  for (int k = 0; k < n; k++) {
    int64_t own = stage * n + k, row = transposed ? 1 : size, column = transposed ? size : 1;
    for (int j = 0; j < t->s; j++) matrix[own * row + (j * n + k) * column] += t->slopes[stage * t->s + j] / h;
    for (int l = 0; l < n; l++) matrix[own * row + (stage * n + l) * column] -= m->jacobian[k * n + l];
  }
  return 1;
}

/* Advance columns by the exact derivatives of the discrete step, each stage with its own J. ``push`` gives the rates of all
 * columns at a stage, with the stride ``apart``. 0 where that is not possible. */
static int move_through_stages(Collocation *m, double h, int64_t columns, double *y, void *with,
                               void (*push)(void *with, int stage, const double *x, double *rates, int64_t apart)) {
  int n = m->n, s = m->method->s, size = s * n, is_solved = 1;
  double *matrix = calloc((int64_t)size * size + columns * size + n + size, sizeof(double));
  if (!matrix) return 0;
  double *change = matrix + (int64_t)size * size, *x = change + columns * size;
  int32_t *pivot = (int32_t *)(x + n);
  for (int i = 0; i < s && is_solved; i++) {
    for (int k = 0; k < n; k++) x[k] = m->x[k] + m->z[i * n + k];
    is_solved = add_stage(m, i, x, h, 0, matrix);
    push(with, i, x, change + i * n, size);
  }
  is_solved = is_solved && factor_real(matrix, size, size - 1, pivot);
  for (int64_t k = 0; k < columns && is_solved; k++) {
    double *own = change + k * size;
    solve_real(matrix, size, size - 1, pivot, own);
    for (int i = 0; i < n; i++) y[k * n + i] += own[(s - 1) * n + i];
  }
  free(matrix);
  return is_solved;
}

/* Update the fastest rate by power iteration with the field's derivative. */
static double fastest(Collocation *m, const double *jacobian, int pairs) {
  int n = m->n;
  double *v = m->fast, *next = m->work, rho = 0;
  for (int pass = 0; pass < pairs; pass++) {
    double size = largest_of(v, n);
    if (!(size > 0 && size < INFINITY)) for (int i = 0; i < n; i++) v[i] = 1 + 0.1 * i / n;
    else for (int i = 0; i < n; i++) v[i] /= size;
    for (int product = 0; product < 2; product++) {
      apply(jacobian, v, n, next);
      memcpy(v, next, sizeof(double) * n);
    }
    rho = sqrt(largest_of(v, n));
  }
  return rho;
}

/* The longest Taylor step at a decay rate, in units of its inverse. */
static double longest_decay(double tol) { return 3 - 0.5 * log10(tol); }

/* Restart with about eight times the length of a Taylor step; whether a decay rate limits Taylor steps. */
static int begin_lengths(Collocation *m, double h, double tol) {
  m->h = EIGHTFOLD * h;
  m->length = 0;
  m->is_fresh = 0;
  m->error = 1;
  return tol > 0 && h * fastest(m, m->jacobian, 8) > HELD_PART * longest_decay(tol);
}

/* Write coefficients 1 to s of series, for powers of the time. */
static void write_powers(const Radau *t, const double *powers, int n, double h, int stride, double *series) {
  double part = 1;
  for (int k = 0; k < t->s; k++) {
    part /= h;
    for (int i = 0; i < n; i++) series[(int64_t)i * stride + k + 1] = powers[k * n + i] * part;
  }
  for (int i = 0; i < n; i++)
    memset(series + (int64_t)i * stride + t->s + 1, 0, sizeof(double) * (stride - t->s - 1));
}

/* Coefficients 1 to s of series of n functions from their differences at the stages, which have as much room after them. */
static void interpolate(const Radau *t, double *values, int n, double h, int stride, double *series) {
  double *powers = values + (int64_t)t->s * n;
  powers_of(t, values, n, powers);
  write_powers(t, powers, n, h, stride, series);
}
