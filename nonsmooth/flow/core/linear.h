/* Small dense systems of linear equations, and complementarity.
 *
 * Matrices are stored by rows. Zeros are skipped, so that the cost of separate blocks adds up.
 */

static inline double dot(const double *a, const double *b, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}
static inline double largest_of(const double *a, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = larger(fabs(a[i]), most);
  return most;
}
static inline void swap(double *a, double *b, int n) {
  for (int i = 0; i < n; i++) { double t = a[i]; a[i] = b[i]; b[i] = t; }
}

/* Products of square matrices, and of one with a vector. */
static void multiply(const double *a, const double *b, int n, double *product) {
  memset(product, 0, sizeof(double) * n * n);
  for (int i = 0; i < n; i++)
    for (int l = 0; l < n; l++)
      for (int j = 0; j < n; j++) product[i * n + j] += a[i * n + l] * b[l * n + j];
}
static inline void apply(const double *a, const double *x, int n, double *product) {
  for (int i = 0; i < n; i++) product[i] = dot(a + (int64_t)i * n, x, n);
}

/* Inverse by Gauss-Jordan elimination with partial pivoting; 0 and NaN where a is singular. ``a`` is overwritten. */
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
    if (best != k) {
      swap(a + k * n, a + best * n, n);
      swap(inverse + k * n, inverse + best * n, n);
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

/* Gaussian elimination with partial pivoting, in place, with one right side or none: the sign of the row permutation, 0
 * where a is singular. */
static inline int triangle(double *a, double *b, int n) {
  int sign = 1;
  for (int k = 0; k < n; k++) {
    int best = k;
    for (int i = k + 1; i < n; i++) if (fabs(a[i * n + k]) > fabs(a[best * n + k])) best = i;
    if (!(fabs(a[best * n + k]) > 0)) return 0;
    if (best != k) {
      swap(a + k * n + k, a + best * n + k, n - k);
      if (b) swap(b + k, b + best, 1);
      sign = -sign;
    }
    for (int i = k + 1; i < n; i++) {
      if (a[i * n + k] == 0) continue;
      double f = a[i * n + k] / a[k * n + k];
      for (int j = k + 1; j < n; j++) a[i * n + j] -= f * a[k * n + j];
      if (b) b[i] -= f * b[k];
    }
  }
  return sign;
}

/* Solve a x = b in place of b; 0 where a is singular. ``a`` is overwritten. */
static int solve(double *a, double *b, int n) {
  if (!triangle(a, b, n)) return 0;
  for (int k = n - 1; k >= 0; k--) {
    for (int j = k + 1; j < n; j++) if (a[k * n + j] != 0) b[k] -= a[k * n + j] * b[j];
    b[k] /= a[k * n + k];
  }
  return finite_all(b, n);
}

/* Linear equations that may be singular ------------------------------------------------------------ */

/* Divide rows, with the ``right`` side, by their largest elements, then columns by theirs, ``unit``. */
static void equilibrate(double *a, int rows, int columns, int width, double *right, double *unit) {
  for (int i = 0; i < rows; i++) {
    double *row = a + (int64_t)i * width, most = largest_of(row, columns);
    if (!(most > 0)) continue;
    for (int j = 0; j < width; j++) row[j] /= most;
    if (right) right[i] /= most;
  }
  for (int j = 0; j < columns; j++) {
    unit[j] = 0;
    for (int i = 0; i < rows; i++) unit[j] = larger(fabs(a[(int64_t)i * width + j]), unit[j]);
    if (unit[j] > 0) for (int i = 0; i < rows; i++) a[(int64_t)i * width + j] /= unit[j];
    else unit[j] = 1;
  }
}

/* Gauss-Jordan elimination with full pivoting on (rows, columns) and ``more`` right sides, after scaling. Returns the rank;
 * ``pivot`` has the column of each pivot's row, ``unit`` the columns' scales. */
static int eliminate(double *a, int rows, int columns, int more, int32_t *pivot, double *unit) {
  int width = columns + more, rank = 0;
  equilibrate(a, rows, columns, width, 0, unit);
  while (rank < rows && rank < columns) {
    int row = rank, column = -1;
    double best = SINGULAR;
    for (int i = rank; i < rows; i++)
      for (int j = 0; j < columns; j++) {
        double size = fabs(a[(int64_t)i * width + j]);
        if (size > best) { best = size; row = i; column = j; }
      }
    if (column < 0) break;
    double *one = a + (int64_t)rank * width, *other = a + (int64_t)row * width;
    if (row != rank) swap(one, other, width);
    double head = one[column];
    for (int j = 0; j < width; j++) one[j] /= head;
    for (int i = 0; i < rows; i++) {
      double *to = a + (int64_t)i * width, f = to[column];
      if (i == rank || f == 0) continue;
      for (int j = 0; j < width; j++) if (one[j] != 0) to[j] -= f * one[j];
      to[column] = 0;
    }
    pivot[rank++] = column;
  }
  return rank;
}

/* Solve a x = b in place of b, with undetermined unknowns zero; 0 where dependent rows are inconsistent by more than the
 * relative tolerance ``tie``. */
static int solve_any(double *a, double *b, int n, double tie, double *work, int32_t *pivot) {
  double *unit = work, *all = work + n, most = 0, rest = 0;
  if (n == 1) {
    int fits = a[0] != 0 || b[0] == 0 || tie == INFINITY;
    b[0] = a[0] != 0 ? b[0] / a[0] : 0;
    return fits && isfinite(b[0]);
  }
  for (int i = 0; i < n; i++) {
    double *row = all + (int64_t)i * (n + 1);
    memcpy(row, a + (int64_t)i * n, sizeof(double) * n);
    row[n] = b[i];
  }
  int rank = eliminate(all, n, n, 1, pivot, unit);
  for (int i = 0; i < n; i++) {
    double value = fabs(all[(int64_t)i * (n + 1) + n]);
    if (i < rank) most = larger(value, most); else rest = larger(value, rest);
  }
  for (int i = 0; i < n; i++) b[i] = 0;
  for (int i = 0; i < rank; i++) b[pivot[i]] = all[(int64_t)i * (n + 1) + n] / unit[pivot[i]];
  return !(rest > tie * most) && finite_all(b, n);
}

/* The null vector of a free column after elimination, in units of the unknowns' sizes or of 1; 0 where there is none. */
static int free_vector(const double *a, int width, int columns, int rank, const int32_t *pivot, const double *unit,
                       const double *size, int column, double *own) {
  for (int i = 0; i < rank; i++) if (pivot[i] == column) return 0;
  memset(own, 0, sizeof(double) * columns);
  own[column] = 1 / (unit[column] * (size ? size[column] : 1));
  for (int i = 0; i < rank; i++)
    own[pivot[i]] = -a[(int64_t)i * width + column] / (unit[pivot[i]] * (size ? size[pivot[i]] : 1));
  return 1;
}

/* Basis z of the null space of E (rows, columns); its dimension. */
static int null_space(const double *e, int rows, int columns, double *z, double *work, int32_t *pivot) {
  double *unit = work, *a = work + columns;
  memcpy(a, e, sizeof(double) * rows * columns);
  int rank = eliminate(a, rows, columns, 0, pivot, unit), count = 0;
  for (int j = 0; j < columns; j++)
    count += free_vector(a, columns, columns, rank, pivot, unit, 0, j, z + (int64_t)count * columns);
  return count;
}

/* Make a vector orthogonal to ``count`` unit vectors of ``z``, and of length 1; the length before that, 0 where it is
 * dependent on them. */
static double orthonormal(double *own, const double *z, int count, int n, int passes) {
  for (int pass = 0; pass < passes; pass++)
    for (int l = 0; l < count; l++) {
      double part = dot(own, z + (int64_t)l * n, n);
      for (int i = 0; i < n; i++) own[i] -= part * z[(int64_t)l * n + i];
    }
  double length = sqrt(dot(own, own, n));
  if (!(length > 0)) return 0;
  for (int i = 0; i < n; i++) own[i] /= length;
  return length;
}

/* A generalised inverse G, M G M = M: x = G b solves M x = b where possible, with the least sum of squares of x over
 * ``size``. ``work`` has room for 3 n^2 + n. */
static int invert_any(const double *m, int n, const double *size, double *inverse, double *work, int32_t *pivot) {
  double *unit = work, *a = unit + n, *z = a + 2 * (int64_t)n * n;
  for (int i = 0; i < n; i++) {
    double *row = a + 2 * (int64_t)i * n;
    memcpy(row, m + (int64_t)i * n, sizeof(double) * n);
    for (int j = 0; j < n; j++) row[n + j] = i == j;
  }
  int rank = eliminate(a, n, n, n, pivot, unit), count = 0;
  memset(inverse, 0, sizeof(double) * n * n);
  for (int i = 0; i < rank; i++)
    for (int j = 0; j < n; j++) inverse[pivot[i] * n + j] = a[2 * (int64_t)i * n + n + j] / unit[pivot[i]];
  for (int j = 0; j < n; j++) { /* orthonormal null vectors */
    double *own = z + (int64_t)count * n;
    if (free_vector(a, 2 * n, n, rank, pivot, unit, size, j, own)) count += orthonormal(own, z, count, n, 2) > 0;
  }
  for (int l = 0; l < count; l++) {
    const double *own = z + (int64_t)l * n;
    for (int j = 0; j < n; j++) {
      double part = 0;
      for (int i = 0; i < n; i++) part += own[i] * inverse[i * n + j] / size[i];
      if (part != 0) for (int i = 0; i < n; i++) inverse[i * n + j] -= part * own[i] * size[i];
    }
  }
  return finite_all(inverse, n * n);
}

/* Whether a symmetric matrix is positive definite by a margin, or nearly semidefinite (negative margin): Cholesky. ``a`` is
 * overwritten. */
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

/* The first of the rows of a vector, where ``span`` has their number there and -1 at the others. */
static int first_row(const int8_t *span, int i) {
  while (span[i] < 0) i--;
  return i;
}

/* A matrix of unit diagonal as D^-1 A D, symmetric, if a positive diagonal D, one number for each vector, makes it so. */
static int symmetrised(const double *a, int n, const int8_t *span, double *d, double *result, int *pending) {
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
        int is_one = span && first_row(span, i) == first_row(span, j);
        if (d[j] || !(is_one || a[i * n + j] * a[j * n + i] > 0)) continue;
        d[j] = d[i] * (is_one ? 1 : sqrt(a[j * n + i] / a[i * n + j]));
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
      if (fabs(one - other) > SYMMETRIC * largest) return 0;
      result[i * n + j] = result[j * n + i] = (one + other) / 2;
    }
  return 1;
}

/* Certificates of a matrix: none; w of a linear complementarity problem is unique; its solution is unique; also stable
 * after multiplication of rows by any positive numbers. */
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
    double b[MOST_MINORS * MOST_MINORS];
    for (int i = 0; i < n; i++) if (set >> i & 1) rows[k++] = i;
    for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) b[i * k + j] = a[rows[i] * n + rows[j]];
    double product = triangle(b, 0, k);
    for (int i = 0; i < k; i++) product *= b[i * (k + 1)];
    if (k > 1 && !(product > SINGULAR)) return 0;
  }
  return 1;
}

/* Certificate of a matrix, with vectors if there is a ``span``. ``work`` has room for 3 n^2 + 3 n, ``pending`` for n. */
static int certificate(const double *m, int n, const int8_t *span, double *work, int32_t *pending) {
  double *a = work, *b = work + n * n, *d = b + n * n, *scale = d + n, *rest = scale + n;
  int is_positive = 1, is_symmetric;
  if (!finite_all(m, n * n)) return NOTHING;
  for (int i = 0; i < n; i++) {
    double own = m[i * n + i];
    for (int j = 0; span && j < n; j++) if (first_row(span, i) == first_row(span, j)) own = larger(m[j * n + j], own);
    is_positive &= m[i * n + i] > 0;
    if (m[i * n + i] < (span ? -SINGULAR * own : 0)) return NOTHING;
    scale[i] = own > 0 ? sqrt(own) : 1;
  }
  for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) a[i * n + j] = m[i * n + j] / (scale[i] * scale[j]);
  if (!span && is_positive && is_dominant(a, n, rest)) return UNIQUE_AND_STABLE;
  is_symmetric = symmetrised(a, n, span, d, b, pending);
  if (is_symmetric && is_definite(b, n, VANISHES * n)) return UNIQUE_AND_STABLE;
  if (span && !is_symmetric) return NOTHING;
  for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) b[i * n + j] = (a[i * n + j] + a[j * n + i]) / 2;
  if (!span && is_definite(b, n, VANISHES * n)) return UNIQUE_AND_STABLE;
  if (!span && is_positive && n <= MOST_MINORS && has_positive_minors(a, n)) return UNIQUE;
  if (is_symmetric) symmetrised(a, n, span, d, b, pending);
  else for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) b[i * n + j] = (a[i * n + j] + a[j * n + i]) / 2;
  return is_definite(b, n, -SINGULAR * n) ? SEMIDEFINITE : NOTHING;
}
