/* Polynomials of degree P on [0, 1], W at once: whether they have a root there, and where. */
/* Below P, which is 6 at least. At a tight tolerance the steps of a linear system are so long that a twentieth of its
 * guards would be hard cases with one term less. */
#if defined(LINEAR) && LINEAR && P >= 15
#define HEAD 6
#else
#define HEAD 5
#endif
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

/* The following functions treat ``n`` vectors together, at most MOST, so that one computes while another waits. */
#define MOST 2
#define IN_STEP UNROLL for (int i = 0; i < n; i++)

/* The Taylor coefficients f[0] to f[2] at s of polynomials of a degree: a[0] to a[degree - 1], and the top. Their
 * even and odd parts are expanded in s^2, in chains of half the length. */
INLINE void expand(int n, const T *const *a, int degree, const T *top, const T *s, T f[MOST][3]) {
  T z[MOST], even[MOST][3], odd[MOST][3];
  IN_STEP {
    z[i] = s[i] * s[i];
    UNROLL for (int j = 0; j < 3; j++) even[i][j] = odd[i][j] = BC(0);
  }
  UNROLL for (int k = degree; k >= 0; k--) {
    IN_STEP {
      T *part = k % 2 ? odd[i] : even[i], c = k == degree ? top[i] : a[i][k];
      part[2] = part[2] * z[i] + part[1];
      part[1] = part[1] * z[i] + part[0];
      part[0] = part[0] * z[i] + c;
    }
  }
  IN_STEP {
    f[i][0] = even[i][0] + s[i] * odd[i][0];
    f[i][1] = odd[i][0] + 2.0 * (z[i] * odd[i][1] + s[i] * even[i][1]);
    f[i][2] = (even[i][1] + 4.0 * (z[i] * even[i][2])) + s[i] * (3.0 * odd[i][1] + 4.0 * (z[i] * odd[i][2]));
  }
}

/* Where the error of a step of Halley's iteration, step^3 times the difference of (f2/f1)^2 and f3/f1, is below rounding. The
 * size of the step alone is no measure near another root. */
INLINE I converged(const T *f, T third, T step) {
  T bent = step * f[2], error = ABS(step) * (bent * bent + ABS(step * step * third * f[1]));
  return (ABS(step) <= 2e-6) & (I)(error <= 1e-16 * (f[1] * f[1]));
}

/* In the bracket; outside it another root is found. */
INLINE I within(T next, T lo, T hi) { return (next >= lo - 4 * EPSILON) & (next <= hi + 4 * EPSILON); }

/* A Newton step after one of Halley's iteration, with the slope from the coefficients at its start. Lanes whose error is then
 * below rounding get its end and that slope. */
INLINE void corrected(int n, const T *const *a, T f[MOST][3], const T *third, const T *step, const T *lo, const T *hi,
                      const I *which, T *next, T *slope, I *good) {
  T value[MOST];
  IN_STEP value[i] = values_at(a[i], P, next[i], next[i] * next[i]);
  IN_STEP {
    T there = f[i][1] - 2.0 * step[i] * f[i][2], more = value[i] * QUICK_INVERSE(there);
    T end = next[i] - more, error = ABS(more) * (ABS(more * f[i][2]) + 3.0 * third[i] * (step[i] * step[i]));
    good[i] = which[i] & (I)(ABS(step[i]) <= 1e-2) & (I)(ABS(more) <= 1e-8) & (I)(error <= 1e-16 * ABS(there))
              & within(end, lo[i], hi[i]);
    next[i] = SELECT(good[i], end, next[i]);
    slope[i] = SELECT(good[i], there, slope[i]);
  }
}

/* The root of a parabola with the same end as a polynomial, improved once on a polynomial of degree MODEL with
 * that end; and a bound of the third coefficient there by the magnitudes of the first terms: the others are smaller. */
INLINE void guess_roots(int n, const T *const *a, const T *end, T *s, T *third) {
  T top[MOST], f[MOST][3];
  IN_STEP {
    const T *c = a[i];
    T disc = c[1] * c[1] - 4.0 * c[0] * (end[i] - c[0] - c[1]);
    s[i] = 2.0 * c[0] * QUICK_INVERSE(QUICK_ROOT(MAX(disc, BC(1e-300))) - c[1]);
    s[i] = SELECT((s[i] > 0) & (s[i] <= 1), s[i], BC(0.5));
    top[i] = end[i];
    UNROLL for (int k = 0; k < MODEL; k++) top[i] -= c[k];
  }
  expand(n, a, MODEL, top, s, f);
  IN_STEP {
    T better = s[i] - f[i][0] * f[i][1] * QUICK_INVERSE(f[i][1] * f[i][1] - f[i][0] * f[i][2]);
    s[i] = SELECT((better > 0) & (better <= 1), better, s[i]);
    third[i] = ABS(a[i][3]) + s[i] * (4.0 * ABS(a[i][4]) + s[i] * (10.0 * ABS(a[i][5]) + s[i] * (20.0 * ABS(a[i][6]))));
  }
}

/* The roots of polynomials with one on (0, 1], by Halley's iteration in a bracket; converged lanes do
 * not move any more. From such a start one full iteration, corrected, is enough as a rule. */
INLINE void polish(int n, const T *const *a, const T *end, const I *which, T *s, T *slope) {
  T lo[MOST], hi[MOST], top[MOST], third[MOST], f[MOST][3], step[MOST], next[MOST], at_end[MOST];
  I active[MOST], small[MOST], rest[MOST], inside[MOST], good[MOST], some;
  guess_roots(n, a, end, s, third);
  IN_STEP { lo[i] = BC(0); hi[i] = BC(1); top[i] = a[i][P]; active[i] = which[i]; }
  for (int it = 0; it < 60; it++) {
    expand(n, a, P, top, s, f);
    IN_STEP {
      step[i] = f[i][0] * f[i][1] * INVERSE(f[i][1] * f[i][1] - f[i][0] * f[i][2]);
      next[i] = s[i] - step[i];
      at_end[i] = f[i][1];
      I positive = f[i][0] > 0;
      lo[i] = SELECT(positive & active[i], s[i], lo[i]);
      hi[i] = SELECT(positive | ~active[i], hi[i], s[i]);
      inside[i] = (next[i] > lo[i]) & (next[i] < hi[i]);
      small[i] = (converged(f[i], third[i], step[i]) & within(next[i], lo[i], hi[i])) | (I)(hi[i] - lo[i] <= 4 * EPSILON);
      rest[i] = active[i] & ~small[i]; /* the others stay */
    }
    some = NONE;
    IN_STEP { some |= rest[i]; rest[i] &= inside[i]; }
    if (any(some)) {
      corrected(n, a, f, third, step, lo, hi, rest, next, at_end, good);
      IN_STEP small[i] |= good[i];
    }
    some = NONE;
    IN_STEP {
      next[i] = SELECT(small[i], MIN(MAX(next[i], lo[i]), hi[i]), SELECT(inside[i], next[i], 0.5 * (lo[i] + hi[i])));
      s[i] = SELECT(active[i], next[i], s[i]);
      slope[i] = SELECT(active[i], at_end[i], slope[i]);
      active[i] &= ~small[i];
      some |= active[i];
    }
    if (!any(some)) return;
  }
}

/* Sign changes of all Bernstein coefficients of polynomials on [0, 1], which are lost; whether the first is positive. */
INLINE I sign_changes(T *b, I *first) {
  UNROLL for (int k = 0; k <= P; k++) b[k] += ROUNDING * ABS(b[k]);
  to_bernstein(b, P);
  I changes = {0}, positive = b[0] > 0;
  *first = positive;
  UNROLL for (int k = 1; k <= P; k++) {
    I next = b[k] > 0;
    changes -= positive ^ next;
    positive = next;
  }
  return changes;
}

#if RARE_CASES_HERE
/* Shorten steps until a guard's series converges within them, as in the interpreter. */
static __attribute__((noinline)) void resolve_step(const T *g, I active, T *h) {
  while (any(active)) {
    T power = BC(1), sum = BC(0), step = *h;
    for (int k = P - 2; k >= 0; k--) { sum = sum * step + ABS(g[k]); power *= step; }
    T last = MAX(ABS(g[P]) * step, ABS(g[P - 1])) * power, rest = RESOLVED * sum;
    active &= (last > rest) & (rest > 0) & (rest < INFINITY);
    *h = SELECT(active, step * 0.99 * EXP2(LOG2(rest / last) * (1.0 / (P - 1))), step);
  }
}

/* Whether a polynomial's errors hide which root on (0, h] is its first, as ``root`` or, with -1, none is. */
static inline int hides_roots(const double *c, int n, double h, double root) {
  double end = root < 0 ? h : root, low = first_low(c, n, end, LOW, 0);
  return low > 0 && !passes_once(c, n, end, low, 0, LOCATED);
}

/* The root of one lane of any polynomial, and the slope there: of a stop that is passed in its direction, or of another
 * guard (a negative number). NAN where errors hide which root is the first, or a stop has an earlier one. */
static __attribute__((noinline)) double hard_root(const T *a, int l, int stop, int flipped, int hides, double *slope) {
  double c[P + 1], d = 0;
  for (int k = 0; k <= P; k++) c[k] = LANE(a[k], l);
  int direction = stop < 0 ? 0 : flipped ? -DIRECTION[stop] : DIRECTION[stop];
  double s = c[0] > 0 ? first_root(c, P, 1) : 0, at = s;
  if (hides && s != 0 && hides_roots(c, P, 1, s)) return NAN;
  /* A positive guard that must fall crosses at its first root; one that stays positive has no crossing. */
  if (stop >= 0 && !(c[0] > 0 && (s < 0 || direction <= 0))) at = first_crossing(c, P, 1, direction);
  for (int k = P; k > 0; k--) d = d * at + k * c[k];
  *slope = d;
  return stop >= 0 && s > 0 && at > s ? NAN : at;
}
#endif
