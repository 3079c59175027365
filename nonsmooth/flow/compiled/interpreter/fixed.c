/* Flow of a fixed duration: nonsmooth/flow/fixed.py -------------------------------------------------------- */

/* Step for which the last two terms stay below ``tol`` times the size of their group of states. */
static double group_step(const double *c, int n, int order, const int32_t *group, int groups, double duration,
                         double tol) {
  double h = INFINITY;
  for (int g = 0; g < groups; g++) {
    double size = 0, rate = 0, before = 0, final = 0;
    for (int i = 0; i < n; i++) {
      const double *own = c + (int64_t)i * (order + 1);
      if (group[i] != g) continue;
      size = larger(fabs(own[0]), size);
      rate = larger(fabs(own[1]), rate);
      before = larger(fabs(own[order - 1]), before);
      final = larger(fabs(own[order]), final);
    }
    double allowed = tol * larger(size, rate * duration);
    if (allowed == 0) continue;
    if (final > 0) h = smaller(pow(allowed / final, 1.0 / order), h);
    if (before > 0) h = smaller(pow(allowed / before, 1.0 / (order - 1)), h);
  }
  return h;
}

/* Move z (n) along a smooth field by a duration of either sign; ``work`` has room for the series of the rules
 * and of the states. The time that is left where the field is not finite or steps are too small, else 0. */
double fixed_flow(const Series *t, int32_t n, int32_t order, const int32_t *group, int32_t groups, const double *p,
                  double *z, double duration, double tol, int64_t most_steps, double *work) {
  int stride = order + 1;
  double *s = work, *c = work + (int64_t)t->size * stride, *x = c + (int64_t)n * stride;
  double left = fabs(duration), whole = left, sign = duration < 0 ? -1 : 1;
  memset(s, 0, sizeof(double) * t->size * stride);
  series_prepare(t, stride, p, s);
  for (int64_t step = 0; step < most_steps && left > 0; step++) {
    double zero = 0;
    for (int i = 0; i < n; i++) c[(int64_t)i * stride] = z[i];
    for (int k = 0; k < order; k++) {
      for (int i = 0; i < n; i++) x[i] = c[(int64_t)i * stride + k];
      series_rules(t, t->moving, t->moving_count, k, stride, x, s);
      for (int i = 0; i < n; i++)
        c[(int64_t)i * stride + k + 1] = s[(int64_t)t->output[i] * stride + k] / (k + 1);
    }
    for (int64_t i = 0; i < (int64_t)n * stride; i++) zero += 0 * c[i];
    double h = group_step(c, n, order, group, groups, whole, tol), ignored;
    if (!(h > 1e-14 * whole) || zero != 0) return left;
    /* Two equal steps rather than a long one and the rest of it. */
    if (h >= left) h = left;
    else if (left < 1.5 * h) h = smaller(h, 0.5 * left);
    for (int i = 0; i < n; i++) z[i] = horner(c + (int64_t)i * stride, order, sign * h, &ignored);
    left -= h;
  }
  return left;
}
