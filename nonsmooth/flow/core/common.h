/* Shared by the driver and the lanes: limits, operations on double, first root of a polynomial.
 *
 * The generated text defines before this file the constants of nonsmooth/flow/constants.py (EPSILON, SAFETY, ..., the
 * enumerations of statuses, kinds of events and guards, reasons), and P, which is the order or more.
 */
#ifndef ON_DEVICE
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#endif

typedef struct {
  double t_end, rtol, atol, max_step, rest_below; /* the last: 0 for none */
  int64_t max_steps, max_events, max_jumps;
  int64_t at_count;
  int32_t at_kind, dense, hit_after, method;
  /* Events that are hits: kinds as bits; whether each guard is named, by kind and index; side (or 0). */
  int64_t hit_kinds, hit_width, hit_side, hit_skip, hit_every, hit_count;
  const int8_t *hit_named;
  const int8_t *passed; /* stops that do not end the run, or NULL */
} Options;

/* Letters of a set: off it, off it with h integrated, first step away from it, and without friction. */
enum { OFF = 2, LEFT_BEHIND = 3, LEAVING = 4, LEAVING_AGAIN = 5, IDLE = 6 };

/* Trajectories of a call; where results go. */
typedef struct {
  int64_t count, p_stride;
  double t0;
  const double *x0, *p;
  double *x, *t;
  int8_t *status;
  int32_t *itinerary, *kinds;
  double *at_x, *at_t;
  int64_t *totals;
  int64_t room, times_stride; /* samples of each trajectory; times are NULL where hits are kept */
  const double *times;
  double *sample_t, *sample_x;
  int64_t kinds_width; /* kinds that are counted: the first ones, and the last */
} Batch;

/* Events that are remembered. */
#define HISTORY 48

/* An event: the time since the one before; kinds of event and guard, and its index, as a number. */
typedef struct { double interval; int64_t pattern; } Recent;

/* Whether intervals, the last one first, decrease like a geometric series. */
static inline int shrink_alike(const double *block) {
  double low = INFINITY, high = 0;
  for (int b = 0; b < BLOCKS - 1; b++) {
    double ratio = block[b] / block[b + 1]; /* not a number after an empty block */
    low = ratio < low ? ratio : ratio > 0 ? low : -INFINITY;
    high = ratio > high ? ratio : high;
  }
  return high < SHRINKS && high - low <= SPREAD * (1 - block[0] / block[1]);
}

/* The data of a run between two steps: lanes pass it to the driver for a step that they cannot decide. */
typedef struct {
  double t, since, length, shortened; /* since: the last event; length of the step before in this mode, or 0 */
  int64_t steps, events, segment_steps, history, seen, hits, kept; /* seen: history in the driver; hits: of the section; kept: samples */
  int64_t *kinds;
  double *x;
  double *unknowns; /* of a set that is left: its direction, then h; not given back */
  int8_t *letter, *side; /* side: of guards of events that are located, doubled where they begin at a zero */
  double *motion, *jumped; /* of a restart, besides the state; of the last events; or none where all events are stops */
  Recent *past;
  int32_t drop, itinerary, status; /* drop: first coefficients of the first guard that vanish */
  int32_t driven; /* whether the driver makes the events at surfaces too */
  int32_t near; /* 1 close to a set, 2 if its guard fell: the set is treated instead of a step */
  int32_t arrived; /* number of the guard of an event that is at its zero, from 1: the event is made instead of a step */
} Suspended;

/* The driver as lanes call it: a run, and functions that begin it or make a step. */
typedef struct {
  void *run;
  void (*begin)(void *run, const Batch *b, const Options *o, int64_t i, Suspended *m);
  void (*step)(void *run, const Batch *b, const Options *o, int64_t i, Suspended *m);
  int64_t random; /* not 0: the driver makes every other step, at random, which changes no result */
} Core;

/* The data of a run between two steps of a GPU, as words of 64 bits: ``begun`` is 0 where its start is undecided. The
 * states follow, with time, then the sides of stops. */
typedef struct {
  int64_t index;
  double t, since, length, shortest;
  int64_t steps, events, entered, shrinking, code, letter, drop, begun, kinds[SIMPLE_KINDS - 1];
} Left;

/* Itineraries on a GPU are numbers in base 4, digits from 1, the last mode lowest; FROZEN is set where modes overflow. */
#define MOST_MODES 30
#define FROZEN (1LL << 62)

/* a * b + c, in lanes with one rounding where the processor has a fused operation. The driver is compiled without
 * contraction and UNFUSED, so that its results are the same bits on every processor. */
#if defined(UNFUSED)
#define MULADD(a, b, c) ((a) * (b) + (c))
#elif defined(__FMA__) || defined(__ARM_FEATURE_FMA) || defined(__FP_FAST_FMA)
#define MULADD(a, b, c) __builtin_fma(a, b, c)
#else
#define MULADD(a, b, c) ((a) * (b) + (c))
#endif

/* Functions that compilers neither inline nor clone. */
#define OUTSIDE __attribute__((noinline, noclone, const))

/* fmax and fmin for a number b, without the calls. */
static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double ns_sign(double a) { return (a > 0) - (a < 0); }

/* Inverse error function: Giles 2010, then two Newton steps. */
static double ns_erfinv(double y) {
  double w = -log((1 - y) * (1 + y)), x;
  if (w < 5) {
    w -= 2.5;
    x = y * (1.50140941 + w * (0.246640727 + w * (-0.00417768164 + w * (-0.00125372503
        + w * (0.00021858087 + w * (-4.39150654e-06 + w * (-3.5233877e-06 + w * (3.43273939e-07
        + w * 2.81022636e-08))))))));
  } else {
    w = sqrt(w) - 3;
    x = y * (2.83297682 + w * (1.00167406 + w * (0.00943887047 + w * (-0.0076224613
        + w * (0.00573950773 + w * (-0.00367342844 + w * (0.00134934322 + w * (0.000100950558
        + w * -0.000200214257))))))));
  }
  for (int k = 0; k < 2; k++) x -= (erf(x) - y) / (1.1283791670955126 * exp(-x * x));
  return x;
}

/* First root ------------------------------------------------------------------------------- */

static double horner(const double *c, int n, double x, double *slope) {
  double f = c[n], d = 0;
  for (int k = n - 1; k >= 0; k--) { d = MULADD(d, x, f); f = MULADD(f, x, c[k]); }
  *slope = d;
  return f;
}

/* Even and odd terms apart: two short chains. */
static inline double value_at(const double *c, int n, double x) {
  double z = x * x, even = c[n - n % 2], odd = c[n - 1 + n % 2], slope;
  if (!(z < INFINITY)) return horner(c, n, x, &slope);
  for (int k = n - n % 2 - 2; k >= 0; k -= 2) even = MULADD(even, z, c[k]);
  for (int k = n - 3 + n % 2; k >= 1; k -= 2) odd = MULADD(odd, z, c[k]);
  return MULADD(x, odd, even);
}

/* Newton steps near a root that rounding in Bernstein form placed slightly late. */
static double polish_late(const double *c, int n, double x, double h) {
  double d, f = horner(c, n, x, &d);
  for (int it = 0; it < 4 && d != 0; it++) {
    double next = x - f / d, fn;
    if (!(next >= 0 && next <= h)) break;
    fn = horner(c, n, next, &d);
    if (fabs(fn) >= fabs(f)) break;
    x = next;
    f = fn;
  }
  return x;
}

/* Root in (lo, hi], positive at lo; |step| is tested before the bracket, because at a root near an
 * end the iterate may leave it by rounding. */
static double newton(const double *c, int n, double lo, double hi, double x) {
  for (int it = 0; it < 100; it++) {
    double d, f = horner(c, n, x, &d);
    if (f > 0) lo = x; else hi = x;
    double step = d != 0 ? f / d : INFINITY, next = x - step;
    if (fabs(step) <= SOLVED * larger(fabs(x), hi)) return next < lo ? lo : next > hi ? hi : next;
    if (!(next > lo && next < hi)) {
      next = 0.5 * (lo + hi);
      if (!(next > lo && next < hi)) return hi;
    }
    x = next;
  }
  return hi;
}

/* Power coefficients of degree n on [0, 1] to Bernstein coefficients, in place. */
static void bernstein(double *b, int n) {
  double binomial = 1;
  for (int i = 0; 2 * i <= n; i++) {
    b[i] /= binomial;
    if (2 * i < n) b[n - i] /= binomial;
    binomial = binomial * (n - i) / (i + 1);
  }
  for (int level = 1; level <= n; level++)
    for (int i = n; i >= level; i--) b[i] += b[i - 1];
}

/* Bernstein coefficients on the left half, and in place of b those on the right one. */
static inline void halve(double *b, int n, double *left) {
  left[0] = b[0];
  for (int level = n; level > 0; level--) {
    for (int i = 0; i < level; i++) b[i] = 0.5 * (b[i] + b[i + 1]);
    left[n - level + 1] = b[0];
  }
}

/* First root on (lo, hi] given Bernstein coefficients there; -1 if none. */
static double first_in(const double *c, int n, double *b, double lo, double hi, int depth) {
  if (b[0] <= 0) return polish_late(c, n, lo, hi);
  int changes = 0, first = -1;
  for (int j = 0; j < n; j++) {
    if ((b[j] > 0) != (b[j + 1] > 0)) { if (first < 0) first = j; changes++; }
  }
  if (changes == 0) return -1;
  if (changes == 1) {
    double d;
    if (horner(c, n, lo, &d) <= 0) return polish_late(c, n, lo, hi);
    double s = (first + b[first] / (b[first] - b[first + 1])) / n;
    return newton(c, n, lo, hi, lo + (hi - lo) * s);
  }
  if (depth == DEPTH) return b[n] <= 0 ? hi : -1;
  double left[P + 1], mid = 0.5 * (lo + hi);
  halve(b, n, left);
  double x = first_in(c, n, left, lo, mid, depth + 1);
  return x >= 0 ? x : first_in(c, n, b, mid, hi, depth + 1);
}

/* Coefficients of a polynomial in powers of the distance from t, all or the first ``count``. */
static inline void move_origin(double *c, int n, double t, int count) {
  for (int i = 0; i < count; i++) for (int k = n - 1; k >= i; k--) c[k] += t * c[k + 1];
}

/* Sum of the magnitudes of all terms but the first, odd and even ones apart: a chain of half the
 * length. */
static inline double rest_of(const double *c, int n, double h) {
  double even = 0, odd = 0, z = h * h;
  int k = n;
  if (k % 2) { odd = fabs(c[k]); k--; }
  for (; k >= 2; k -= 2) { even = MULADD(even, z, fabs(c[k])); odd = MULADD(odd, z, fabs(c[k - 1])); }
  return MULADD(odd, h, even * z);
}

/* Bound of the magnitudes of all roots (Fujiwara 1916), with a margin for rounding. */
static double largest_root(const double *c, int n) {
  double most = 0;
  while (n > 0 && c[n] == 0) n--;
  for (int k = 0; k < n; k++) most = larger(pow(fabs(c[k] / c[n]), 1.0 / (n - k)), most);
  return 2.5 * most;
}

/* Whether a polynomial stays positive on [0, h]: the Bernstein coefficients of its first terms exceed the sum of the
 * magnitudes of the rest. A tenth of the work of all coefficients. */
#define FIRST_TERMS 8
static inline int stays_positive(const double *c, int n, double h) {
  const double part[] = {1, 1.0 / 8, 1.0 / 28, 1.0 / 56, 1.0 / 70, 1.0 / 56, 1.0 / 28, 1.0 / 8, 1};
  double b[FIRST_TERMS + 1], power = 1, rest = 0;
  if (n < FIRST_TERMS) return 0;
  for (int k = n; k > FIRST_TERMS; k--) rest = MULADD(rest, h, fabs(c[k]));
  for (int k = 0; k <= FIRST_TERMS; k++) {
    b[k] = c[k] * power * part[k];
    power *= h;
  }
  for (int level = 1; level <= FIRST_TERMS; level++)
    for (int i = FIRST_TERMS; i >= level; i--) b[i] += b[i - 1];
  double low = b[0];
  for (int i = 1; i <= FIRST_TERMS; i++) low = smaller(b[i], low);
  return low > rest * power;
}

/* Whether a polynomial positive at 0 clearly stays so on [0, h], from the sum of its other terms. */
static inline int is_far(const double *c, int n, double h, double rest) {
  return c[0] > rest || (rest < LARGEST && stays_positive(c, n, h));
}

/* Bernstein coefficients of a polynomial that is not far from zero on [0, h], where the sum of its other terms is ``rest``,
 * and the number of their sign changes; h is shortened to the range of possible roots. */
static int isolate(const double *c, int n, double rest, double *h, double *b) {
  double power = 1;
  int changes = 0;
  /* More halvings than there are would be needed, or an overflow. */
  if (!(rest < ldexp(c[0], DEPTH))) *h = smaller(*h, largest_root(c, n));
  b[0] = c[0];
  for (int k = 1; k <= n; k++) { power *= *h; b[k] = c[k] * power; }
  /* A minimum that reaches zero only by rounding, ROUNDING sum |c_k| t^k, is no root. */
  for (int k = 0; k <= n; k++) b[k] += ROUNDING * fabs(b[k]);
  bernstein(b, n);
  for (int k = 0; k < n; k++) changes += (b[k] > 0) != (b[k + 1] > 0);
  return changes;
}

/* First t in (0, h] at which a polynomial positive at 0 stops being positive; 0 if it is not; -1 if
 * it stays positive. */
static double first_root(const double *c, int n, double h) {
  double b[P + 1], rest = rest_of(c, n, h);
  if (c[0] <= 0) return 0;
  return is_far(c, n, h, rest) || !isolate(c, n, rest, &h, b) ? -1 : first_in(c, n, b, 0, h, 0);
}

/* First t in (0, h] at which a polynomial is below some of its errors and ``floor``: 0 at once, -1 nowhere. */
static double first_low(const double *c, int n, double h, double errors, double floor) {
  double b[P + 1];
  for (int k = 0; k <= n; k++) b[k] = c[k] - (k < n - 1 || n < 2 ? errors * ROUNDING : 1) * fabs(c[k]);
  b[0] -= errors * floor;
  return first_root(b, n, h);
}

/* Whether a polynomial passes zero exactly once near a root, despite its errors. */
static int passes_once(const double *c, int n, double root, double low, double floor, double exact) {
  double d[P + 1], noise = fabs(c[n]), spread = 0, width;
  memcpy(d, c, sizeof(double) * (n + 1));
  for (int k = n - 1; k >= 0; k--) noise = noise * root + (k < n - 1 ? LOW * ROUNDING : 1) * fabs(c[k]);
  move_origin(d, n, root, n);
  width = (noise + LOW * floor) / fabs(d[1]);
  for (int k = n; k > 1; k--) spread = (spread + k * fabs(d[k])) * width;
  return spread <= 0.25 * fabs(d[1]) && width <= exact && fabs(low - root) <= 2 * width;
}

/* First t in (0, h] at which a polynomial passes zero falling (-1), rising (1) or either way (0).
 * Leading zeros are a start on the zero and are skipped. */
static double first_crossing(const double *given, int n, double h, int direction) {
  double c[P + 1], s = direction > 0 ? -1 : 1;
  while (n >= 0 && *given == 0) { given++; n--; }
  if (n < 0) return -1;
  for (int k = 0; k <= n; k++) c[k] = s * given[k];
  if (c[0] > 0) return first_root(c, n, h);
  for (int k = 0; k <= n; k++) c[k] = -c[k];
  double rise = first_root(c, n, h);
  if (rise < 0 || direction == 0) return rise;
  if (n == 0 || rise >= h) return -1;
  move_origin(c, n, rise, n);
  for (int k = 0; k <= n; k++) c[k] = -c[k];
  double fall = first_root(c + 1, n - 1, h - rise);
  return fall < 0 ? -1 : rise + fall;
}

/* Sign of a polynomial just before t; 0 where rounding hides it. */
static int side_before(const double *c, int n, double t, double rounding) {
  double slope, value = horner(c, n, t, &slope), sum = 0;
  for (int k = n; k >= 0; k--) sum = sum * t + fabs(c[k]);
  rounding += ROUNDING * sum;
  if (fabs(value) > rounding) return value > 0 ? 1 : -1;
  return fabs(slope) * t > rounding ? (slope > 0 ? -1 : 1) : 0;
}

/* Whether a function leaves a side through zero in a direction, by its first nonzero coefficient. */
static int passed(const double *c, int n, int side, int direction) {
  if (side * direction > 0) return 0;
  for (int k = 0; k <= n; k++) if (c[k] != 0) return c[k] * side < 0;
  return 0;
}

static inline int finite_all(const double *a, int n) {
  double s = 0;
  for (int i = 0; i < n; i++) s += a[i] - a[i];
  return s == 0;
}

#ifndef ON_DEVICE
/* Itineraries as a tree: the parent of a node is its itinerary without the last mode. */
typedef struct { int32_t parent, mode, child, sibling; } Node;
typedef struct { Node *node; int32_t size, room; } Tree;

static __attribute__((noinline)) int32_t tree_grow(Tree *tree, int32_t parent, int mode) {
  if (tree->size == tree->room) {
    Node *more = realloc(tree->node, 2 * (size_t)tree->room * sizeof(Node));
    if (!more) return parent;
    tree->node = more;
    tree->room *= 2;
  }
  int32_t at = tree->size++, *child = &tree->node[parent].child;
  tree->node[at] = (Node){.parent = parent, .mode = mode, .sibling = *child};
  *child = at;
  return at;
}

static inline int32_t tree_child(Tree *tree, int32_t parent, int mode) {
  int32_t at = tree->node[parent].child;
  while (at && tree->node[at].mode != mode) at = tree->node[at].sibling;
  return at ? at : tree_grow(tree, parent, mode);
}
#endif
