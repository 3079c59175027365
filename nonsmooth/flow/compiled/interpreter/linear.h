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

/* Whether a symmetric matrix is positive definite by a margin: Cholesky. ``a`` is lost. */
static int is_definite(double *a, int n) {
  for (int k = 0; k < n; k++) a[k * n + k] -= VANISHES * n;
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
  double b[64], sign = 1, product = 1; /* k is 8 at most */
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

/* What is shown of -m: 2 definite after scaling or diagonally dominant (stable and a P-matrix), 1 a
 * P-matrix by its minors, 0 nothing. ``work`` has room for 2 n^2 + n, ``pending`` for n. */
static int shown(const double *m, int n, double *work, int *pending) {
  double *a = work, *b = work + n * n, *d = b + n * n;
  int dominant = 1;
  for (int i = 0; i < n; i++) if (!(m[i * n + i] < 0)) return 0;
  if (!finite_all(m, n * n)) return 0;
  for (int i = 0; i < n; i++) {
    double off = 0;
    for (int j = 0; j < n; j++) {
      a[i * n + j] = -m[i * n + j] / (sqrt(-m[i * n + i]) * sqrt(-m[j * n + j]));
      if (i != j) off += fabs(a[i * n + j]);
    }
    dominant &= off < 1 - VANISHES;
  }
  if (dominant) return 2;
  if (symmetrised(a, n, d, b, pending) && is_definite(b, n)) return 2;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) b[i * n + j] = (a[i * n + j] + a[j * n + i]) / 2;
  if (is_definite(b, n)) return 2;
  if (n > 8) return 0;
  for (unsigned set = 1; set < 1u << n; set++) {
    int rows[8], k = 0;
    for (int i = 0; i < n; i++) if (set >> i & 1) rows[k++] = i;
    if (k > 1 && !(determinant(a, n, rows, k) > VANISHES)) return 0;
  }
  return 1;
}

/* Lambda of letters that are held: those that slide keep their rates at zero. */
static int held_lambda(const double *a, const double *m, int n, const int8_t *letter, const double *low, double *lam,
                       double *work, int *slides) {
  int k = 0;
  for (int i = 0; i < n; i++) {
    if (letter[i] == 0) slides[k++] = i;
    lam[i] = letter[i] > 0 ? 1 : letter[i] < 0 ? low[i] : 0;
  }
  double *b = work + k * k;
  for (int i = 0; i < k; i++) {
    b[i] = -a[slides[i]];
    for (int j = 0; j < n; j++) if (lam[j] != 0) b[i] -= m[slides[i] * n + j] * lam[j];
    for (int j = 0; j < k; j++) work[i * k + j] = m[slides[i] * n + slides[j]];
  }
  if (!solve(work, b, k)) return 0;
  for (int i = 0; i < k; i++) lam[slides[i]] = b[i];
  return 1;
}

/* Find lambda, with ``letter`` to begin with and changed; 0 where it is not found. */
static int complementarity(const double *a, const double *m, int n, const int8_t *contact, int8_t *letter,
                           double *lam, double *work, int *slides) {
  double *low = work + n * n + n;
  int best = n + 1, patience = 10;
  for (int i = 0; i < n; i++) low[i] = contact[i] ? 0 : -1;
  for (int iteration = 0; iteration < 10000; iteration++) {
    if (!held_lambda(a, m, n, letter, low, lam, work, slides)) return 0;
    int wrong = 0, first = -1;
    int8_t *wanted = (int8_t *)(low + n);
    for (int i = 0; i < n; i++) {
      double high = contact[i] ? INFINITY : 1, rate = a[i];
      wanted[i] = letter[i];
      if (letter[i] == 0) {
        if (lam[i] > high) wanted[i] = 1; else if (lam[i] < low[i]) wanted[i] = -1;
      } else {
        for (int j = 0; j < n; j++) if (m[i * n + j] != 0) rate += m[i * n + j] * lam[j];
        if (rate * letter[i] < 0) wanted[i] = 0;
      }
      if (wanted[i] != letter[i] && wrong++ == 0) first = i;
    }
    if (!wrong) {
      for (int i = 0; i < n; i++)
        lam[i] = larger(low[i], contact[i] ? lam[i] : smaller(lam[i], 1));
      return 1;
    }
    if (wrong < best) { best = wrong; patience = 10; }
    if (--patience > 0) memcpy(letter, wanted, n);
    else letter[first] = wanted[first];
  }
  return 0;
}
