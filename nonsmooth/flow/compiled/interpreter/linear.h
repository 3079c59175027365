/* Small dense systems of linear equations, and complementarity: nonsmooth/flow/reference/complementarity.py.
 *
 * Matrices are row by row. What is zero is skipped, so that separate blocks cost what they cost alone.
 */

/* Inverse by Gauss and Jordan with the largest pivots; 0 and NaN where there is none. ``a`` is lost. */
static int invert(double *a, int n, double *inverse) {
  memset(inverse, 0, sizeof(double) * n * n);
  for (int i = 0; i < n; i++) inverse[i * n + i] = 1;
  for (int k = 0; k < n; k++) {
    int best = k;
    for (int i = k + 1; i < n; i++) if (fabs(a[i * n + k]) > fabs(a[best * n + k])) best = i;
    double pivot = a[best * n + k];
    if (!(fabs(pivot) > 0) || !(fabs(pivot) < INFINITY)) {
      for (int i = 0; i < n * n; i++) inverse[i] = NAN;
      return 0;
    }
    for (int j = 0; j < n && best != k; j++) {
      double t = a[k * n + j]; a[k * n + j] = a[best * n + j]; a[best * n + j] = t;
      t = inverse[k * n + j]; inverse[k * n + j] = inverse[best * n + j]; inverse[best * n + j] = t;
    }
    for (int j = 0; j < n; j++) {
      if (a[k * n + j] != 0) a[k * n + j] /= pivot;
      if (inverse[k * n + j] != 0) inverse[k * n + j] /= pivot;
    }
    for (int i = 0; i < n; i++) {
      double f = a[i * n + k];
      if (i == k || f == 0) continue;
      for (int j = k; j < n; j++) a[i * n + j] -= f * a[k * n + j];
      for (int j = 0; j < n; j++) inverse[i * n + j] -= f * inverse[k * n + j];
    }
  }
  return 1;
}

/* Solve a x = b in place of b; 0 where a is singular. ``a`` is lost. */
static int solve(double *a, double *b, int n) {
  for (int k = 0; k < n; k++) {
    int best = k;
    for (int i = k + 1; i < n; i++) if (fabs(a[i * n + k]) > fabs(a[best * n + k])) best = i;
    if (!(fabs(a[best * n + k]) > 0)) return 0;
    for (int j = k; j < n && best != k; j++) {
      double t = a[k * n + j]; a[k * n + j] = a[best * n + j]; a[best * n + j] = t;
    }
    double t = b[k]; b[k] = b[best]; b[best] = t;
    for (int i = k + 1; i < n; i++) {
      if (a[i * n + k] == 0) continue;
      double f = a[i * n + k] / a[k * n + k];
      for (int j = k + 1; j < n; j++) a[i * n + j] -= f * a[k * n + j];
      b[i] -= f * b[k];
    }
  }
  for (int k = n - 1; k >= 0; k--) {
    for (int j = k + 1; j < n; j++) if (a[k * n + j] != 0) b[k] -= a[k * n + j] * b[j];
    b[k] /= a[k * n + k];
  }
  return finite_all(b, n);
}

/* Whether a symmetric matrix is positive definite by a margin, or nearly semidefinite (a negative one): Cholesky.
 * ``a`` is lost. */
static int is_definite(double *a, int n, double margin) {
  for (int k = 0; k < n; k++) a[k * n + k] -= margin;
  for (int k = 0; k < n; k++) {
    if (!(a[k * n + k] > 0)) return 0;
    for (int i = k + 1; i < n; i++) {
      if (a[i * n + k] == 0) continue;
      double f = a[i * n + k] / a[k * n + k];
      for (int j = k + 1; j <= i; j++) a[i * n + j] -= f * a[j * n + k];
    }
  }
  return 1;
}

static double determinant(const double *a, int n, const int *rows, int k) {
  double b[MOST_MINORS * MOST_MINORS], sign = 1, product = 1;
  for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) b[i * k + j] = a[rows[i] * n + rows[j]];
  for (int c = 0; c < k; c++) {
    int best = c;
    for (int i = c + 1; i < k; i++) if (fabs(b[i * k + c]) > fabs(b[best * k + c])) best = i;
    if (b[best * k + c] == 0) return 0;
    if (best != c) sign = -sign;
    for (int j = 0; j < k && best != c; j++) {
      double t = b[c * k + j]; b[c * k + j] = b[best * k + j]; b[best * k + j] = t;
    }
    product *= b[c * k + c];
    for (int i = c + 1; i < k; i++) {
      double f = b[i * k + c] / b[c * k + c];
      for (int j = c; j < k; j++) b[i * k + j] -= f * b[c * k + j];
    }
  }
  return sign * product;
}

/* A matrix of unit diagonal as D^-1 A D, symmetric, if a positive diagonal D makes it so. */
static int symmetrised(const double *a, int n, double *d, double *result, int *pending) {
  double largest = 0;
  for (int i = 0; i < n; i++) d[i] = 0;
  for (int root = 0; root < n; root++) {
    int count = 0;
    if (d[root]) continue;
    d[root] = 1;
    pending[count++] = root;
    while (count) {
      int i = pending[--count];
      for (int j = 0; j < n; j++) {
        if (d[j] || !(a[i * n + j] * a[j * n + i] > 0)) continue;
        d[j] = d[i] * sqrt(a[j * n + i] / a[i * n + j]);
        pending[count++] = j;
      }
    }
  }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      result[i * n + j] = a[i * n + j] * d[j] / d[i];
      largest = larger(fabs(result[i * n + j]), largest);
    }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) {
      double one = result[i * n + j], other = result[j * n + i];
      if (fabs(one - other) > 1e-12 * largest) return 0;
      result[i * n + j] = result[j * n + i] = (one + other) / 2;
    }
  return 1;
}

/* What is proved of a matrix: nothing, that w of a linear complementarity problem is unique, that its solution is,
 * and that it is stable after multiplication of its rows by any positive numbers. */
enum { NOTHING, SEMIDEFINITE, UNIQUE, UNIQUE_AND_STABLE };

/* Whether the comparison matrix, of unit diagonal, is an M-matrix. ``work`` has room for n^2 + n. */
static int is_dominant(const double *a, int n, double *work) {
  double *b = work + n * n;
  for (int i = 0; i < n * n; i++) work[i] = -fabs(a[i]);
  for (int i = 0; i < n; i++) { work[i * n + i] = 1; b[i] = 1; }
  if (!solve(work, b, n)) return 0;
  for (int i = 0; i < n; i++) if (!(b[i] > 0 && b[i] < 1 / TIED)) return 0;
  return 1;
}

static int has_positive_minors(const double *a, int n) {
  for (unsigned set = 1; set < 1u << n; set++) {
    int rows[MOST_MINORS], k = 0;
    for (int i = 0; i < n; i++) if (set >> i & 1) rows[k++] = i;
    if (k > 1 && !(determinant(a, n, rows, k) > SINGULAR)) return 0;
  }
  return 1;
}

/* ``work`` has room for 3 n^2 + 3 n, ``pending`` for n. */
static int certificate(const double *m, int n, double *work, int32_t *pending) {
  double *a = work, *b = work + n * n, *d = b + n * n, *scale = d + n, *rest = scale + n;
  int is_positive = 1, is_symmetric;
  if (!finite_all(m, n * n)) return NOTHING;
  for (int i = 0; i < n; i++) {
    is_positive &= m[i * n + i] > 0;
    if (m[i * n + i] < 0) return NOTHING;
  }
  for (int i = 0; i < n; i++) scale[i] = m[i * n + i] > 0 ? sqrt(m[i * n + i]) : 1;
  for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) a[i * n + j] = m[i * n + j] / (scale[i] * scale[j]);
  if (is_positive && is_dominant(a, n, rest)) return UNIQUE_AND_STABLE;
  is_symmetric = symmetrised(a, n, d, b, pending);
  if (is_symmetric && is_definite(b, n, VANISHES * n)) return UNIQUE_AND_STABLE;
  for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) b[i * n + j] = (a[i * n + j] + a[j * n + i]) / 2;
  if (is_definite(b, n, VANISHES * n)) return UNIQUE_AND_STABLE;
  if (is_positive && n <= MOST_MINORS && has_positive_minors(a, n)) return UNIQUE;
  if (is_symmetric) symmetrised(a, n, d, b, pending);
  else for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) b[i * n + j] = (a[i * n + j] + a[j * n + i]) / 2;
  return is_definite(b, n, -SINGULAR * n) ? SEMIDEFINITE : NOTHING;
}
