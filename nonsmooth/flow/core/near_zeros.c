/* Zeros of guards that are close together -------------------------------------------------------------
 *
 * Rounding and truncation of a guard's polynomial hide whether it touches zero, passes once or passes several times
 * near a point. Coefficients at a closer point have smaller terms and smaller errors. So steps end before such a point
 * while that helps: only rounding of the guard's own formula remains.
 */

/* Rounding of a guard at a time of the step: of the states, and of its own formula. */
static double guard_noise(Run *r, const Expansion *e, int row, double time) {
  double *x = r->vector, *lam = x + r->n;
  at_time(r, e, time, x, lam);
  evaluate(r, e, x, lam);
  weigh_rounding(r, e->l.is_free, r->size);
  return guard_rounding(r, e, row);
}

/* Errors of the leading terms of a polynomial that are known to be zero. */
static double left_out(const double *c, int count, double time) {
  double sum = 0;
  for (int k = -1; k >= -count; k--) sum = sum * time + fabs(c[k]);
  return sum;
}

/* First root of c, positive at 0, within h. The guard is (t - from)^drop t^known c. Where errors hide whether the root is the
 * first, r->hold is a time before it. */
static double sure_root(Run *r, const Expansion *e, int row, const double *c, int n, double h, double from, int drop,
                        int known) {
  if (!(c[0] > 0)) return 0;
  double rest = rest_of(c, n, h);
  if (is_far(c, n, h, rest)) return -1;
  const double *g = e->guards + (int64_t)row * r->stride;
  double b[P + 1], within = h, exact = LOCATED * larger(time_scale(r), h), slope, noise = 0, floor = 0;
  int changes = isolate(c, n, rest, &within, b);
  if (!changes) return -1;
  double root = first_in(c, n, b, 0, within, 0), end = root < 0 ? h : root;
  if (changes == 1 && root > 0) {
    horner(c, n, root, &slope);
    if (LOW * ROUNDING * (c[0] + rest_of(c, n, root)) <= exact * fabs(slope)) return root;
  }
  double low = first_low(c, n, end, LOW, 0);
  if (low > 0) {
    noise = guard_noise(r, e, row, from + low);
    if (from > 0) /* of the shift by ``from``, and of the terms known to be zero before it */
      noise += ROUNDING * (fabs(g[0]) + rest_of(g, r->order, from + low)) + left_out(g + known, known, from + low);
    noise = noise / pow(from + low, known) + left_out(c, drop, low);
    floor = noise / pow(low, drop);
    if (floor > 0) low = first_low(c, n, end, LOW, floor);
  }
  if (low < 0 || passes_once(c, n, end, low, floor, exact)) return root;
  double hidden = low;
  double before = first_low(c, n, low, FAR_FROM_LOW * LOW, floor);
  if (before > NEARER * low && low - before > SEPARATE / LOCATED * exact) {
    r->hold = smaller(r->hold, from + before);
    return -1;
  }
  if (floor > 0) { /* a minimum that reaches zero only by rounding is no root */
    memset(b, 0, sizeof(double) * drop);
    memcpy(b + drop, c, sizeof(double) * (n + 1));
    b[0] += LOW * noise;
    root = first_root(b, n + drop, h);
    if (root > 0) root = polish_late(c, n, root, h);
  }
  r->hidden[row] = larger(root - hidden, 0);
  return root;
}

/* First time within h at which a guard passes zero falling (-1), rising (1) or either way (0), after ``drop`` terms
 * that are zero; as first_crossing. */
static double sure_crossing(Run *r, const Expansion *e, int row, int drop, double h, int direction) {
  const double *g = e->guards + (int64_t)row * r->stride;
  double all[P + 1], *c = all, s = direction > 0 ? -1 : 1;
  int n = r->order - drop;
  for (; n >= 0 && g[drop] == 0; drop++) n--;
  if (n < 0) return -1;
  for (int k = 0; k <= r->order; k++) all[k] = s * g[k];
  c += drop;
  if (c[0] > 0) return sure_root(r, e, row, c, n, h, 0, drop, 0);
  for (int k = 0; k <= n; k++) c[k] = -c[k];
  double rise = sure_root(r, e, row, c, n, h, 0, drop, 0);
  if (rise < 0 || direction == 0) return rise;
  if (n == 0 || rise >= h) return -1;
  move_origin(c, n, rise, n);
  for (int k = 0; k <= n; k++) c[k] = -c[k];
  double fall = sure_root(r, e, row, c + 1, n - 1, h - rise, rise, 1, drop);
  return fall < 0 ? -1 : rise + fall;
}
