/* Stability of sliding across layers: decide.c has the law at a point.
 *
 * In layers of widths e_i, e_i u_i' = a_i - A_ij n_j sat(u_j). With A the matrix of the sliding surfaces of a group,
 * sliding is stable while all eigenvalues of n A / e have positive real parts. From a stable start the first of two
 * functions to vanish is its first loss: det A, and the determinant of the bialternate sum of n A / e with itself,
 * the product of all sums of two eigenvalues.
 *
 * Source: Kuznetsov 2004, Elements of Applied Bifurcation Theory, section 10.2 (the bialternate product).
 */

/* What a guard of stability is: the slope of one unknown, or determinants of a group. */
enum { OF_ONE, OF_GROUP, OF_SUMS };

/* The number of the coupled group of each sliding unknown; the number of groups. */
static int find_groups(const Run *r, Layout *l) {
  const int32_t *output = r->s->slope_output, *own = l->sliding;
  int w = r->width;
  for (int i = 0; i < l->slides; i++) l->group[i] = i;
  for (int i = 0; i < l->slides; i++)
    for (int j = 0; j < i; j++)
      if (output[own[i] * w + own[j]] >= 0 || output[own[j] * w + own[i]] >= 0) join_groups(l->group, l->slides, i, j);
  return l->slides;
}

/* Rows of the guards of stability: of groups whose matrix moves. */
static void add_branches(const Run *r, Layout *l) {
  int w = r->width, groups = r->s->slope_outputs ? find_groups(r, l) : 0;
  int32_t *own = r->pending;
  l->branches = 0;
  for (int g = 0; g < groups; g++) {
    int n = 0, moves = 0, is_plain = 1, is_weighted = 0, is_symmetric = 1;
    for (int i = 0; i < l->slides; i++) if (l->group[i] == g) own[n++] = l->sliding[i];
    for (int i = 0; i < n; i++) {
      is_plain &= element(r, own[i])->law == SURFACE_LAW;
      is_weighted |= is_scaled(r, own[i]) != 0;
      for (int j = 0; j < n; j++) {
        moves |= r->s->slope_moves[own[i] * w + own[j]];
        is_symmetric &= r->s->slope_symmetric[own[i] * w + own[j]];
      }
    }
    if (n > 1 && n <= MOST_ENUMERATED && is_plain) {
      if (!moves && (!is_weighted || is_symmetric)) continue;
      add_row(l, BRANCH_GUARD, own[0], OF_GROUP);
      if (!is_symmetric) add_row(l, BRANCH_GUARD, own[0], OF_SUMS); /* else its eigenvalues are real */
      l->branches += is_symmetric ? 1 : 2;
      continue;
    }
    for (int i = 0; i < n; i++) {
      if (!r->s->slope_moves[own[i] * (w + 1)] || (own[i] < r->m && !is_bounded(r, own[i]))) continue;
      add_row(l, BRANCH_GUARD, own[i], OF_ONE);
      l->branches++;
    }
  }
}

/* c = a / b of series; c may be a. */
static void divide_series(const double *a, const double *b, int count, double *c) {
  for (int k = 0; k < count; k++) c[k] = (a[k] - convolve(c, b, k, 0, k - 1)) / b[0];
}

/* The determinant of a matrix of series, which is overwritten; pivots are the largest values. */
static void determinant_series(double *a, int n, int count, int stride, double *result) {
  double sign = 1;
  double factor[P + 1], product[P + 1];
  for (int k = 0; k < n; k++) {
    int row = k, column = k;
    for (int i = k; i < n; i++)
      for (int j = k; j < n; j++)
        if (fabs(a[(i * n + j) * stride]) > fabs(a[(row * n + column) * stride])) { row = i; column = j; }
    if (row != k) swap(a + k * n * stride, a + row * n * stride, n * stride);
    for (int i = 0; i < n && column != k; i++) swap(a + (i * n + k) * stride, a + (i * n + column) * stride, count);
    if ((row != k) != (column != k)) sign = -sign;
    const double *pivot = a + (k * n + k) * stride;
    for (int i = k + 1; i < n && pivot[0] != 0; i++) {
      divide_series(a + (i * n + k) * stride, pivot, count, factor);
      for (int j = k + 1; j < n; j++)
        for (int q = 0; q < count; q++) a[(i * n + j) * stride + q] -= convolve(factor, a + (k * n + j) * stride, q, 0, q);
    }
  }
  for (int q = 0; q < count; q++) result[q] = q ? 0 : sign;
  for (int k = 0; k < n; k++) {
    for (int q = 0; q < count; q++) product[q] = convolve(result, a + (k * n + k) * stride, q, 0, q);
    memcpy(result, product, sizeof(double) * count);
  }
}

/* Copy A of a group to ``to``, with rows times n / e, or only times the sign of n. */
static void group_matrix(const Run *r, const int32_t *own, int n, int count, int weighted, double *to) {
  int stride = r->stride;
  for (int i = 0; i < n; i++) {
    const double *factor = row_of(r, r->n + 2 * r->width + own[i]);
    double turn = 1;
    for (int q = 0; q < count; q++) if (factor[q] != 0) { turn = ns_sign(factor[q]); break; }
    for (int j = 0; j < n; j++) {
      const double *slope = slope_row(r, own[i], own[j]);
      double *entry = to + (i * n + j) * stride;
      for (int q = 0; q < count; q++)
        entry[q] = weighted ? -convolve(factor, slope, q, 0, q) / element(r, own[i])->width : -turn * slope[q];
    }
  }
}

/* The bialternate sum of A (n, n) with itself, of n (n - 1) / 2 rows: its eigenvalues are sums of two of A's. */
static void sums_matrix(const double *a, int n, int count, int stride, double *to) {
  int size = n * (n - 1) / 2, row = 0;
  memset(to, 0, sizeof(double) * size * size * stride);
  for (int p = 1; p < n; p++)
    for (int q = 0; q < p; q++, row++) {
      int column = 0;
      for (int s = 1; s < n; s++)
        for (int t = 0; t < s; t++, column++) {
          double *entry = to + (row * size + column) * stride;
          for (int k = 0; k < count; k++) {
            double sum = 0;
            if (t == q) sum += a[(p * n + s) * stride + k];
            if (s == p) sum += a[(q * n + t) * stride + k];
            if (t == p) sum -= a[(q * n + s) * stride + k];
            if (s == q) sum -= a[(p * n + t) * stride + k];
            entry[k] = sum;
          }
        }
    }
}

/* The unknowns of a group, by its first one; their number. */
static int group_of(const Layout *l, int first, int32_t *own) {
  int group = 0, n = 0;
  for (int i = 0; i < l->slides; i++) if (l->sliding[i] == first) group = l->group[i];
  for (int i = 0; i < l->slides; i++) if (l->group[i] == group) own[n++] = l->sliding[i];
  return n;
}

/* The scale of a guard of stability: a product of slopes of r->slope. */
static double branch_scale(const Run *r, const Layout *l, int row) {
  int kind = l->side[row], first = l->index[row], w = r->width;
  int32_t own[MOST_ENUMERATED];
  if (kind == OF_ONE) return fabs(r->slope[first * (w + 1)]);
  int n = group_of(l, first, own), count = kind == OF_GROUP ? n : n * (n - 1) / 2;
  double most = 0, product = 1;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double weight = kind == OF_GROUP ? 1 : fabs(factor_of(r, own[i])) / element(r, own[i])->width;
      most = larger(weight * fabs(r->slope[own[i] * w + own[j]]), most);
    }
  while (count--) product *= most;
  return product;
}

/* One guard of stability; positive where the mode was entered. */
static void branch_row(const Run *r, const Layout *l, int row, int count, double *g) {
  int kind = l->side[row], first = l->index[row], n, stride = r->stride;
  double turn = l->mode == r->turned_mode ? r->turned[row] : 1;
  if (kind == OF_ONE) {
    memcpy(g, slope_row(r, first, first), sizeof(double) * count);
    for (int k = 0; k < count; k++) if (g[k] != 0) { turn = ns_sign(g[k]); break; }
    for (int k = 0; k < count; k++) g[k] *= turn;
    return;
  }
  if (l->mode == r->dependent) { memset(g, 0, sizeof(double) * count); return; }
  int32_t own[MOST_ENUMERATED];
  n = group_of(l, first, own);
  double *a = r->layer_series, *sums = a + (int64_t)n * n * stride;
  group_matrix(r, own, n, count, kind == OF_SUMS, a);
  if (kind == OF_GROUP) determinant_series(a, n, count, stride, g);
  else {
    sums_matrix(a, n, count, stride, sums);
    determinant_series(sums, n * (n - 1) / 2, count, stride, g);
  }
  for (int k = 0; k < count; k++) g[k] *= turn;
}
