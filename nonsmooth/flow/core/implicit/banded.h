/* Banded systems of linear equations, real (w = 1) or complex (w = 2, interleaved). */

/* x -= y z and x /= y. */
static inline void less_product(double *x, const double *y, const double *z, const int w) {
  if (w == 1) { x[0] -= y[0] * z[0]; return; }
  x[0] -= y[0] * z[0] - y[1] * z[1];
  x[1] -= y[0] * z[1] + y[1] * z[0];
}
static inline void divide_by(double *x, const double *y, const int w) {
  if (w == 1) { x[0] /= y[0]; return; }
  double u = x[0], v = x[1], d = 1 / (y[0] * y[0] + y[1] * y[1]);
  x[0] = (u * y[0] + v * y[1]) * d;
  x[1] = (v * y[0] - u * y[1]) * d;
}
static inline double size_of_number(const double *x, const int w) { return w == 1 ? fabs(x[0]) : fabs(x[0]) + fabs(x[1]); }

/* Factorise in place with partial pivoting; ``band`` is the half bandwidth. 0 where the matrix is singular. */
static inline __attribute__((always_inline)) int factor_parts(double *f, int n, int band, int32_t *pivot, const int w) {
  for (int k = 0; k < n; k++) {
    int best = k, low = k + band < n ? k + band : n - 1, right = k + 2 * band < n ? k + 2 * band : n - 1;
    double most = -1;
    for (int i = k; i <= low; i++) {
      double size = size_of_number(f + w * ((int64_t)i * n + k), w);
      if (size > most) { most = size; best = i; }
    }
    if (!(most > 0 && most < INFINITY)) return 0;
    double *one = f + w * (int64_t)k * n, *other = f + w * (int64_t)best * n;
    pivot[k] = best;
    if (best != k) swap(one + w * k, other + w * k, w * (right + 1 - k));
    for (int i = k + 1; i <= low; i++) {
      double *row = f + w * (int64_t)i * n, part[2];
      if (size_of_number(row + w * k, w) == 0) continue;
      divide_by(row + w * k, one + w * k, w);
      memcpy(part, row + w * k, sizeof(double) * w);
      for (int j = k + 1; j <= right; j++) less_product(row + w * j, part, one + w * j, w);
    }
  }
  return 1;
}

static inline __attribute__((always_inline)) void solve_parts(const double *f, int n, int band, const int32_t *pivot, double *b, const int w) {
  for (int k = 0; k < n; k++) {
    int low = k + band < n ? k + band : n - 1;
    swap(b + w * k, b + w * pivot[k], w);
    for (int i = k + 1; i <= low; i++) less_product(b + w * i, f + w * ((int64_t)i * n + k), b + w * k, w);
  }
  for (int k = n - 1; k >= 0; k--) {
    const double *row = f + w * (int64_t)k * n;
    int right = k + 2 * band < n ? k + 2 * band : n - 1;
    for (int j = k + 1; j <= right; j++) less_product(b + w * k, row + w * j, b + w * j, w);
    divide_by(b + w * k, row + w * k, w);
  }
}

static int factor_real(double *f, int n, int band, int32_t *pivot) { return factor_parts(f, n, band, pivot, 1); }
static int factor_complex(double *f, int n, int band, int32_t *pivot) { return factor_parts(f, n, band, pivot, 2); }
static void solve_real(const double *f, int n, int band, const int32_t *pivot, double *b) { solve_parts(f, n, band, pivot, b, 1); }
static void solve_complex(const double *f, int n, int band, const int32_t *pivot, double *b) { solve_parts(f, n, band, pivot, b, 2); }
