/* Banded systems of linear equations, real and complex (as real and imaginary parts side by side). */

/* Factors of a - J in place, rows changed for the largest pivots; entries are no further than ``band`` from the
 * diagonal. 0 where there is no inverse. */
static int factor_real(double *f, int n, int band, int32_t *pivot) {
  for (int k = 0; k < n; k++) {
    int best = k, low = k + band < n ? k + band : n - 1, right = k + 2 * band < n ? k + 2 * band : n - 1;
    for (int i = k + 1; i <= low; i++) if (fabs(f[(int64_t)i * n + k]) > fabs(f[(int64_t)best * n + k])) best = i;
    double *one = f + (int64_t)k * n, *other = f + (int64_t)best * n;
    pivot[k] = best;
    if (!(fabs(other[k]) > 0 && fabs(other[k]) < INFINITY)) return 0;
    for (int j = k; j <= right && best != k; j++) { double t = one[j]; one[j] = other[j]; other[j] = t; }
    for (int i = k + 1; i <= low; i++) {
      double *row = f + (int64_t)i * n, part = row[k] /= one[k];
      if (part != 0) for (int j = k + 1; j <= right; j++) row[j] -= part * one[j];
    }
  }
  return 1;
}

static void solve_real(const double *f, int n, int band, const int32_t *pivot, double *b) {
  for (int k = 0; k < n; k++) {
    int low = k + band < n ? k + band : n - 1;
    double t = b[k]; b[k] = b[pivot[k]]; b[pivot[k]] = t;
    for (int i = k + 1; i <= low; i++) b[i] -= f[(int64_t)i * n + k] * b[k];
  }
  for (int k = n - 1; k >= 0; k--) {
    int right = k + 2 * band < n ? k + 2 * band : n - 1;
    for (int j = k + 1; j <= right; j++) b[k] -= f[(int64_t)k * n + j] * b[j];
    b[k] /= f[(int64_t)k * n + k];
  }
}

/* The same of complex numbers, as real and imaginary parts side by side. */
static int factor_complex(double *f, int n, int band, int32_t *pivot) {
  for (int k = 0; k < n; k++) {
    int best = k, low = k + band < n ? k + band : n - 1, right = k + 2 * band < n ? k + 2 * band : n - 1;
    double most = -1;
    for (int i = k; i <= low; i++) {
      const double *c = f + 2 * ((int64_t)i * n + k);
      double size = fabs(c[0]) + fabs(c[1]);
      if (size > most) { most = size; best = i; }
    }
    if (!(most > 0 && most < INFINITY)) return 0;
    double *one = f + 2 * (int64_t)k * n, *other = f + 2 * (int64_t)best * n;
    pivot[k] = best;
    for (int j = 2 * k; j <= 2 * right + 1 && best != k; j++) { double t = one[j]; one[j] = other[j]; other[j] = t; }
    double a = one[2 * k], b = one[2 * k + 1], d = 1 / (a * a + b * b);
    for (int i = k + 1; i <= low; i++) {
      double *row = f + 2 * (int64_t)i * n, u = row[2 * k], v = row[2 * k + 1];
      if (u == 0 && v == 0) continue;
      double p = (u * a + v * b) * d, q = (v * a - u * b) * d;
      row[2 * k] = p;
      row[2 * k + 1] = q;
      for (int j = k + 1; j <= right; j++) {
        row[2 * j] -= p * one[2 * j] - q * one[2 * j + 1];
        row[2 * j + 1] -= p * one[2 * j + 1] + q * one[2 * j];
      }
    }
  }
  return 1;
}

static void solve_complex(const double *f, int n, int band, const int32_t *pivot, double *b) {
  for (int k = 0; k < n; k++) {
    int low = k + band < n ? k + band : n - 1, best = pivot[k];
    for (int part = 0; part < 2; part++) {
      double t = b[2 * k + part]; b[2 * k + part] = b[2 * best + part]; b[2 * best + part] = t;
    }
    for (int i = k + 1; i <= low; i++) {
      const double *c = f + 2 * ((int64_t)i * n + k);
      b[2 * i] -= c[0] * b[2 * k] - c[1] * b[2 * k + 1];
      b[2 * i + 1] -= c[0] * b[2 * k + 1] + c[1] * b[2 * k];
    }
  }
  for (int k = n - 1; k >= 0; k--) {
    int right = k + 2 * band < n ? k + 2 * band : n - 1;
    const double *row = f + 2 * (int64_t)k * n;
    double u = b[2 * k], v = b[2 * k + 1];
    for (int j = k + 1; j <= right; j++) {
      u -= row[2 * j] * b[2 * j] - row[2 * j + 1] * b[2 * j + 1];
      v -= row[2 * j] * b[2 * j + 1] + row[2 * j + 1] * b[2 * j];
    }
    double a = row[2 * k], c = row[2 * k + 1], d = 1 / (a * a + c * c);
    b[2 * k] = (u * a + v * c) * d;
    b[2 * k + 1] = (v * a - u * c) * d;
  }
}
