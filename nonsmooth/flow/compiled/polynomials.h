/* Polynomials of degree P on [0, 1], W at once: whether they have a root there, and where. */
#define HEAD 5 /* below P, which is 6 at least */
#define NEXT (P < 8 ? P : 8) /* terms after the head that are bounded apart from the last */
#define MODEL (P < 8 ? P : 8)

/* Power coefficients of degree n on [0, 1] to Bernstein coefficients, in place. */
INLINE void to_bernstein(T *b, int n) {
  double binomial = 1;
  UNROLL for (int i = 0; i <= n; i++) { b[i] *= 1.0 / binomial; binomial = binomial * (n - i) / (i + 1); }
  UNROLL for (int level = 1; level <= n; level++)
    UNROLL for (int i = n; i >= level; i--) b[i] += b[i - 1];
}

/* Roots on (0, 1] of a polynomial positive at 0, without isolating them: bounds by a head of degree
 * HEAD in Bernstein form and the sum of the rest. ``none``: it stays positive. ``one``: it ends at or
 * below zero and falls throughout, is concave or is convex, so it has exactly one root.
 * ``unresolved``: the series does not converge well within the step. */
INLINE void screen(const T *a, I *none, I *one, I *unresolved, T *end) {
  T near = BC(0), far = BC(0), sum = BC(0), b[HEAD + 1];
  UNROLL for (int k = HEAD + 1; k <= P; k++) {
    if (k <= NEXT) near += ABS(a[k]);
    else far += ABS(a[k]);
    sum += a[k];
  }
  T tail = near + far; /* and of the derivatives, by the largest factor of each part */
  T tail1 = (double)NEXT / HEAD * near + (double)P / HEAD * far;
  T tail2 = (NEXT * (NEXT - 1.0) / (HEAD * (HEAD - 1))) * near + (P * (P - 1.0) / (HEAD * (HEAD - 1))) * far;
  T noise = tail;
  UNROLL for (int k = 0; k <= HEAD; k++) { b[k] = a[k]; noise += ABS(a[k]); }
  to_bernstein(b, HEAD);
  T low = b[0], steepest = b[1] - b[0], most = b[2] - 2.0 * b[1] + b[0], least = most;
  UNROLL for (int k = 1; k <= HEAD; k++) low = MIN(low, b[k]);
  UNROLL for (int k = 1; k < HEAD; k++) {
    T d = b[k + 1] - b[k], dd = d - (b[k] - b[k - 1]);
    steepest = MAX(steepest, d);
    most = MAX(most, dd);
    least = MIN(least, dd);
  }
  *end = b[HEAD] + sum;
  *unresolved = MAX(ABS(a[P]), ABS(a[P - 1])) > RESOLVED * noise;
  I simple = (steepest + tail1 < 0) | (I)(most + tail2 < 0), positive = *end > -ROUNDING * noise;
  *none = (low > tail) | (simple & positive);
  *one = (simple | (I)(least > tail2)) & ~positive;
}

/* Even and odd parts separately: two short chains instead of a long one. */
INLINE T values_at(const T *a, int n, T s, T z) {
  T even = a[n - (n & 1)], odd = a[n - 1 + (n & 1)];
  UNROLL for (int k = n - (n & 1) - 2; k >= 0; k -= 2) even = even * z + a[k];
  UNROLL for (int k = n - 1 + (n & 1) - 2; k >= 1; k -= 2) odd = odd * z + a[k];
  return even + s * odd;
}

/* The Taylor coefficients f[0] to f[2] at s of a polynomial of degree n: a[0] to a[n - 1], and the top. Its even
 * and odd parts are expanded in s^2, in chains of half the length. */
INLINE void expand(const T *a, int n, T top, T s, T *f) {
  T z = s * s, even[3] = {BC(0), BC(0), BC(0)}, odd[3] = {BC(0), BC(0), BC(0)};
  UNROLL for (int k = n; k >= 0; k--) {
    T *part = k % 2 ? odd : even, c = k == n ? top : a[k];
    part[2] = part[2] * z + part[1];
    part[1] = part[1] * z + part[0];
    part[0] = part[0] * z + c;
  }
  f[0] = even[0] + s * odd[0];
  f[1] = odd[0] + 2.0 * (z * odd[1] + s * even[1]);
  f[2] = (even[1] + 4.0 * (z * even[2])) + s * (3.0 * odd[1] + 4.0 * (z * odd[2]));
}

/* Where a step of Halley's iteration leaves less than rounding: its error is step^3 times the difference
 * of (f2/f1)^2 and f3/f1. The size of the step alone says nothing beside another root. */
INLINE I converged(const T *f, T third, T step) {
  T bent = step * f[2], error = ABS(step) * (bent * bent + ABS(step * step * third * f[1]));
  return (ABS(step) <= 2e-6) & (I)(error <= 1e-16 * (f[1] * f[1]));
}

/* In a bracket, or it goes to another root. */
INLINE I within(T next, T lo, T hi) { return (next >= lo - 4 * EPSILON) & (next <= hi + 4 * EPSILON); }

/* After a step of Halley's iteration one of Newton's, with the slope where it ended from the coefficients where
 * it began. Lanes where this leaves less than rounding get its end and that slope. */
INLINE I corrected(const T *a, const T *f, T third, T step, T lo, T hi, I which, T *next, T *slope) {
  T there = f[1] - 2.0 * step * f[2], more = values_at(a, P, *next, *next * *next) * QUICK_INVERSE(there);
  T end = *next - more, error = ABS(more) * (ABS(more * f[2]) + 3.0 * third * (step * step));
  I good = which & (I)(ABS(step) <= 1e-2) & (I)(ABS(more) <= 1e-8) & (I)(error <= 1e-16 * ABS(there)) & within(end, lo, hi);
  *next = SELECT(good, end, *next);
  *slope = SELECT(good, there, *slope);
  return good;
}

/* The root of a polynomial with one on (0, 1], by Halley's iteration in a bracket; converged lanes do
 * not move any more. It starts from the root of a parabola with the same end, improved once on a
 * polynomial of degree MODEL with the same end: one full iteration, corrected, is then enough as a rule. */
INLINE T polish(const T *a, T end, I active, T *slope) {
  T lo = BC(0), hi = BC(1), f[3], top = end;
  T disc = a[1] * a[1] - 4.0 * a[0] * (end - a[0] - a[1]);
  T s = 2.0 * a[0] * QUICK_INVERSE(QUICK_ROOT(MAX(disc, BC(1e-300))) - a[1]);
  s = SELECT((s > 0) & (s <= 1), s, BC(0.5));
  UNROLL for (int k = 0; k < MODEL; k++) top -= a[k];
  expand(a, MODEL, top, s, f);
  T better = s - f[0] * f[1] * QUICK_INVERSE(f[1] * f[1] - f[0] * f[2]);
  s = SELECT((better > 0) & (better <= 1), better, s);
  /* A bound of the third coefficient at s by the magnitudes of the first terms; the others are smaller. */
  T third = ABS(a[3]) + s * (4.0 * ABS(a[4]) + s * (10.0 * ABS(a[5]) + s * (20.0 * ABS(a[6]))));
  for (int it = 0; it < 60; it++) {
    expand(a, P, a[P], s, f);
    T step = f[0] * f[1] * INVERSE(f[1] * f[1] - f[0] * f[2]), next = s - step, at_end = f[1];
    I positive = f[0] > 0;
    lo = SELECT(positive & active, s, lo);
    hi = SELECT(positive | ~active, hi, s);
    I inside = (next > lo) & (next < hi);
    I small = (converged(f, third, step) & within(next, lo, hi)) | (I)(hi - lo <= 4 * EPSILON);
    I rest = active & ~small; /* the others stay, whatever their neighbours need */
    if (any(rest)) small |= corrected(a, f, third, step, lo, hi, rest & inside, &next, &at_end);
    next = SELECT(small, MIN(MAX(next, lo), hi), SELECT(inside, next, 0.5 * (lo + hi)));
    s = SELECT(active, next, s);
    *slope = SELECT(active, at_end, *slope);
    active &= ~small;
    if (!any(active)) break;
  }
  return s;
}
