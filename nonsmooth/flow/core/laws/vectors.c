/* Vectors of multipliers at a point: |nu| <= b, and w = a - M nu is zero inside and along nu at the bound.
 *
 * On the bound nu = b u and w = s u with |u| = 1 and s >= 0, so that (b M + s) u = a. Independent of the run; two or three
 * rows.
 */

static int is_vector_symmetric(const double *m, int k, double part) {
  double most = largest_of(m, k * k);
  for (int i = 0; i < k; i++) for (int j = 0; j < i; j++) if (fabs(m[i * k + j] - m[j * k + i]) > part * most) return 0;
  return 1;
}

/* Whether the symmetric part, scaled to a largest element 1, is positive definite by a margin. */
static int is_vector_definite(const double *m, int k, double margin) {
  double a[9], most = largest_of(m, k * k);
  for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) a[i * k + j] = 0.5 * (m[i * k + j] + m[j * k + i]) / most;
  return most > 0 && is_definite(a, k, margin);
}

/* y of (M + shift) y = b. */
static int solve_vector(const double *m, int k, double shift, const double *b, double *y) {
  double a[9];
  for (int i = 0; i < k * k; i++) a[i] = m[i] + (i % (k + 1) ? 0 : shift);
  memcpy(y, b, sizeof(double) * k);
  return solve(a, y, k);
}

/* The direction u with (M + s) u = a, |u| = 1 and the largest s >= 0: Newton's method from the left, where it is monotone
 * (1/|(M + s)^-1 a| is concave). M is symmetric, and positive definite but for directions in which a is zero. */
static int leaving_direction(const double *a, const double *m, int k, double *u) {
  double d[3], w[3], s, along = 0, square = dot(a, a, k);
  for (int i = 0; i < k; i++) along += a[i] * dot(m + i * k, a, k);
  s = larger(sqrt(square) - along / square, 0); /* |(M + s)^-1 a| is at least |a|^3 / (a (M + s) a) */
  if (s == 0 && !solve_vector(m, k, s, a, d)) s = SINGULAR * sqrt(dot(m, m, k * k));
  for (int again = 0; again < 100; again++) {
    if (!solve_vector(m, k, s, a, d) || !solve_vector(m, k, s, d, w)) return 0;
    double n = length_of(d, k);
    s += (n - 1) * n * n / dot(d, w, k);
    if (!(fabs(n - 1) > SOLVED)) break;
  }
  if (!solve_vector(m, k, s, a, d)) return 0;
  unit_of(d, k, u);
  return finite_all(u, k);
}

/* Coefficients of det(M + s)^2 - |adj(M + s) a|^2 in s (Faddeev and LeVerrier); its degree is 2 k. */
static void secular(const double *a, const double *m, int k, double *polynomial) {
  double adjugate[9] = {0}, determinant[4] = {1}, numerator[3][3], next[9];
  for (int i = 0; i <= 2 * k; i++) polynomial[i] = 0;
  for (int i = 0; i < k; i++) adjugate[i * (k + 1)] = 1;
  for (int j = 1; j <= k; j++) { /* of highest powers first */
    double trace = 0;
    for (int i = 0; i < k; i++) {
      numerator[j - 1][i] = dot(adjugate + i * k, a, k);
      for (int l = 0; l < k; l++) {
        next[i * k + l] = 0;
        for (int q = 0; q < k; q++) next[i * k + l] -= m[i * k + q] * adjugate[q * k + l];
      }
      trace += next[i * k + i];
    }
    determinant[j] = -trace / j;
    for (int i = 0; i < k; i++) next[i * (k + 1)] += determinant[j];
    memcpy(adjugate, next, sizeof next);
  }
  for (int i = 0; i <= k; i++) for (int j = 0; j <= k; j++) polynomial[2 * k - i - j] += determinant[i] * determinant[j];
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++)
      for (int l = 0; l < k; l++) polynomial[2 * k - 2 - i - j] -= numerator[i][l] * numerator[j][l];
}

/* Direction u = (M + s)^-1 a of length 1 for an s near the given one; 0 where Newton's method diverges. */
static int direction_at(const double *a, const double *m, int k, double s, double *u) {
  double d[3], w[3], start = s, n = 0;
  for (int again = 0; again < LAYER_NEWTON; again++) {
    if (!solve_vector(m, k, s, a, d) || !solve_vector(m, k, s, d, w)) return 0;
    n = length_of(d, k);
    double step = (n * n - 1) / (-2 * dot(d, w, k));
    if (!(fabs(step) < INFINITY)) return 0;
    s -= step;
    if (fabs(step) <= EPSILON * fabs(s)) break;
  }
  if (!(fabs(n - 1) <= LAYER_APART && fabs(s - start) <= LEFT * (1 + fabs(start)))) return 0;
  unit_of(d, k, u);
  return 1;
}

/* All directions with (M + s) u = a and s >= 0; their number. */
static int limit_directions(const double *given, const double *matrix, int k, double (*u)[3]) {
  double a[3], m[9], p[P + 1], size = largest_of(given, k) + largest_of(matrix, k * k), at = -LAYER_RESIDUAL;
  int degree = 2 * k, count = 0, zeros = 0;
  if (!(size > 0)) return 0;
  if (is_vector_symmetric(matrix, k, VANISHES) && is_vector_definite(matrix, k, VANISHES * k))
    return leaving_direction(given, matrix, k, u[0]);
  for (int i = 0; i < k; i++) a[i] = given[i] / size;
  for (int i = 0; i < k * k; i++) m[i] = matrix[i] / size;
  secular(a, m, k, p);
  move_origin(p, degree, at, degree);
  while (count < 2 * k && zeros < degree) {
    double sign = ns_sign(p[zeros]), c[P + 1], left = 2 * k - at, root;
    if (sign == 0) { zeros++; continue; }
    for (int i = 0; i <= degree; i++) c[i] = sign * p[i];
    root = first_root(c + zeros, degree - zeros, left);
    if (root < 0) break;
    at += root;
    move_origin(p, degree, root, degree);
    p[0] = 0;
    zeros = 1;
    count += direction_at(a, m, k, at, u[count]);
  }
  return count;
}

/* Orthonormal axes in the columns of Q (k, k), the first along u: Householder's reflection. */
static void axes_of(const double *u, int k, double *q) {
  double v[3], square = 0, turn = u[0] > 0 ? -1 : 1;
  for (int i = 0; i < k; i++) { v[i] = turn * u[i] - (i == 0); square += v[i] * v[i]; }
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++) q[i * k + j] = ((i == j) - 2 * v[i] * v[j] / square) * (j ? 1 : turn);
}

/* x to Q x, or back. */
static void turn_vector(const double *q, int k, int back, double *x, int apart) {
  double y[3] = {0};
  for (int i = 0; i < k; i++) for (int j = 0; j < k; j++) y[i] += (back ? q[j * k + i] : q[i * k + j]) * x[j * apart];
  for (int i = 0; i < k; i++) x[i * apart] = y[i];
}
