/* One block of coupled elements, at one order: w = a - A nu, and w_i in the normal cone of the set of nu_i. One solution by
 * pivoting, Lemke's method or Gauss-Seidel iteration, a point inside all solutions, or all of them by enumeration.
 * Independent of the run; used by decide.c.
 *
 * Source: Cottle, Pang & Stone 1992, The Linear Complementarity Problem.
 */

/* The state of an element after some orders: undecided; nu at a bound and w = 0 so far; decided. An open contact is
 * BELOW. */
enum { UNDECIDED, AT_TOP, AT_BOTTOM, INSIDE, ABOVE, BELOW };

/* The position of nu in a trial: inside its set with w = 0, or at a bound. */
enum { HELD, TOP, BOTTOM };

enum { MOST_TRIED = 8, TRIED = 1 << MOST_TRIED, DIODES_TRIED = 1 << 12, MOST_SOLUTIONS = 16, MOST_FOUND = 64, COVERINGS = 4 };
enum { SOLUTIONS_ROOM = MOST_SOLUTIONS * MOST_ENUMERATED, LIMITS = 6, GROWTHS = 8 }; /* growths: steps of a continuation */

/* One block of coupled elements, with copies of its part of the law at one order. */
typedef struct {
  int size, is_coupled, is_joined, may_end; /* joints may make its rows dependent; at a limit it is decided by later times */
  double tie; /* part of terms that is zero */
  const int32_t *own;
  double *a, *b, *matrix, *share, *floor; /* share: bounds by the reactions in the block; floor: rounding of w */
  double *room; /* rounding of nu where the diagonal does not determine it, or NULL */
  int8_t *state, *is_contact;
  const int8_t *span; /* of a vector multiplier the number of its rows, at the first, and -1 at the others; or none */
} Block;

/* Lemke's method ------------------------------------------------------------------------------------ */

/* Whether row i leaves before row j: lexicographic minimum ratio test. */
static int leaves_first(const double *t, int width, int n, int i, int j, int column) {
  const double *one = t + (int64_t)i * width, *two = t + (int64_t)j * width;
  double x = one[width - 1] / one[column], y = two[width - 1] / two[column];
  for (int k = 0; k <= n; k++) {
    if (fabs(x - y) > SINGULAR * (fabs(x) + fabs(y))) return x < y;
    if (k < n) { x = one[k] / one[column]; y = two[k] / two[column]; }
  }
  return i < j;
}

/* z >= 0 with w = M z + q >= 0 and z w = 0; 0 where the method ends on a ray. The tableau is of n (2 n + 2), m is
 * (n, n). */
static int lemke(const double *m, const double *q, int n, uint32_t seed, double *z, double *t, int32_t *basis) {
  int width = 2 * n + 2, row = -1, column = 2 * n;
  for (int i = 0; i < n; i++) {
    double *own = t + (int64_t)i * width;
    memset(own, 0, sizeof(double) * width);
    own[i] = 1;
    for (int j = 0; j < n; j++) own[n + j] = -m[(int64_t)i * n + j];
    seed = seed * 1664525u + 1013904223u;
    own[2 * n] = -1 - (seed >> 8) / 16777216.0;
    own[width - 1] = q[i];
    basis[i] = i;
    if (q[i] < 0 && (row < 0 || q[i] * t[(int64_t)row * width + 2 * n] > q[row] * own[2 * n])) row = i;
  }
  memset(z, 0, sizeof(double) * n);
  if (row < 0) return 1;
  for (int count = 0; count < 100 * (n + 10); count++) {
    double *own = t + (int64_t)row * width, head = own[column];
    for (int j = 0; j < width; j++) own[j] /= head;
    for (int i = 0; i < n; i++) {
      double *to = t + (int64_t)i * width, f = to[column];
      if (i == row || f == 0) continue;
      for (int j = 0; j < width; j++) if (own[j] != 0) to[j] -= f * own[j];
      to[column] = 0;
    }
    int left = basis[row];
    basis[row] = column;
    if (left == 2 * n) {
      for (int i = 0; i < n; i++) if (basis[i] >= n) z[basis[i] - n] = larger(t[(int64_t)i * width + width - 1], 0);
      return finite_all(z, n);
    }
    column = left < n ? left + n : left - n;
    row = -1;
    for (int i = 0; i < n; i++)
      if (t[(int64_t)i * width + column] > SINGULAR && (row < 0 || leaves_first(t, width, n, i, row, column))) row = i;
    for (int i = 0; i < n; i++) /* the covering variable leaves at the first opportunity */
      if (row >= 0 && basis[i] == 2 * n && i != row && t[(int64_t)i * width + column] > SINGULAR) {
        const double *one = t + (int64_t)i * width, *two = t + (int64_t)row * width;
        if (one[width - 1] / one[column] <= two[width - 1] / two[column]) row = i;
      }
    if (row < 0) return 0;
  }
  return 0;
}

/* Lemke's method after scaling of rows and columns; m and q are overwritten. */
static int lemke_scaled(double *m, double *q, int n, double *z, double *work, int32_t *basis) {
  double *unit = work, largest;
  equilibrate(m, n, n, n, q, unit);
  largest = largest_of(q, n);
  if (largest > 0) for (int i = 0; i < n; i++) q[i] /= largest;
  uint32_t seed = 1; /* of the covering vector: rounding in ties may end on a ray */
  while (!lemke(m, q, n, seed, z, work + n, basis)) if (seed++ == COVERINGS) return 0;
  for (int j = 0; j < n; j++) z[j] *= largest / unit[j];
  return 1;
}

/* One block at one order --------------------------------------------------------------------------- */

/* Bound of nu_i by the reactions of its block. */
static double bound_of(const Block *k, int i, const double *nu) {
  double b = k->b[i];
  if (k->is_coupled)
    for (int j = 0; j < k->size; j++) if (k->share[i * k->size + j] != 0) b += k->share[i * k->size + j] * nu[j];
  return b;
}

/* w_i, and the sum of its terms. */
static double rate_of(const Block *k, int i, const double *nu, double *terms) {
  double w = k->a[i];
  *terms = fabs(w);
  for (int j = 0; j < k->size; j++) {
    double term = k->matrix[i * k->size + j] * nu[j];
    if (term != 0) { w -= term; *terms += fabs(term); }
  }
  return w;
}

/* Tolerances at which w_i and nu_i count as zero. */
static double zero_of(const Block *k, int i, double terms) { return larger(k->floor[i], k->tie * terms); }
static double room_zero(const Block *k, int i, double zero, double bound) {
  double own = fabs(k->matrix[i * (k->size + 1)]), most = k->tie * fabs(bound);
  if (k->room) return larger(k->room[i], most);
  return own > 0 ? larger(zero / own, most) : most;
}

static int span_of(const Block *k, int i) { return k->span ? k->span[i] : 0; }

/* Whether a state allows a position; the position of those that are decided. */
static int allows(const Block *k, int i, int position) {
  switch (k->state[i]) {
    case UNDECIDED: return span_of(k, i) ? position != BOTTOM : !k->is_contact[i] || position != TOP;
    case AT_TOP: return position != BOTTOM;
    case AT_BOTTOM: return position != TOP;
    case INSIDE: return position == HELD;
    case ABOVE: return position == TOP;
    default: return position == BOTTOM;
  }
}

/* nu for given positions, vectors at their bounds unchanged; 0 where there is none. ``work`` has room for 3 n^2 + 4 n. */
static int place_unknowns(const Block *k, const int8_t *position, double *nu, double *work, int32_t *pivot) {
  int n = k->size;
  double *m = work;
  for (int i = 0; i < n; i++) {
    double *row = m + (int64_t)i * n;
    if (position[i] == HELD) {
      memcpy(row, k->matrix + (int64_t)i * n, sizeof(double) * n);
      nu[i] = k->is_joined && fabs(k->a[i]) <= k->floor[i] ? 0 : k->a[i];
      continue;
    }
    double side = position[i] == TOP ? 1 : -1;
    for (int j = 0; j < n; j++) row[j] = i == j;
    if (span_of(k, i)) continue;
    nu[i] = k->is_contact[i] ? 0 : side * k->b[i];
    if (k->is_coupled && !k->is_contact[i]) for (int j = 0; j < n; j++) row[j] -= side * k->share[i * n + j];
  }
  return solve_any(m, nu, n, TIED, work + (int64_t)n * n, pivot);
}

/* The next position of a vector, given its first row: inside ``room``, or w along nu. */
static int next_of_vector(const Block *k, int i, int position, const double *nu, double zero, double room) {
  double along = 0, terms;
  if (k->span[i] < 0 || !allows(k, i, position == HELD ? TOP : HELD)) return position;
  if (position == HELD) return length_of(nu + i, k->span[i]) > room ? TOP : HELD;
  for (int q = i; q < i + k->span[i]; q++) along += rate_of(k, q, nu, &terms) * nu[q];
  return along < -zero ? HELD : TOP;
}

/* The next position of an element: its present one if that is consistent. */
static int next_position(const Block *k, int i, int position, const double *nu) {
  double terms, w = rate_of(k, i, nu, &terms), zero = zero_of(k, i, terms), bound = bound_of(k, i, nu);
  double low = k->is_contact[i] ? 0 : -bound, room = room_zero(k, i, zero, bound);
  if (span_of(k, i)) return next_of_vector(k, i, position, nu, zero * bound, bound + room);
  if (position == HELD) {
    if (allows(k, i, TOP) && nu[i] > bound + room) return TOP;
    if (allows(k, i, BOTTOM) && nu[i] < low - room) return BOTTOM;
    return HELD;
  }
  if (!allows(k, i, HELD)) return position;
  if (position == TOP ? w >= -zero : w <= zero) return position;
  int is_empty = !k->is_contact[i] && k->state[i] == UNDECIDED && bound <= room; /* {0}: any w */
  return is_empty ? position == TOP ? BOTTOM : TOP : HELD;
}

/* Principal pivoting: all inconsistent elements change, or one at a time where that does not help. */
static int pivot_block(const Block *k, int8_t *position, double *nu, int most, double *work, int32_t *pivot) {
  int best = k->size + 1, patience = 10;
  for (int count = 0; count < most; count++) {
    if (!place_unknowns(k, position, nu, work, pivot)) return 0;
    int wrong = 0, first = -1, next = 0;
    for (int i = 0; i < k->size; i++) {
      int other = next_position(k, i, position[i], nu);
      if (other != position[i] && wrong++ == 0) { first = i; next = other; }
    }
    if (!wrong) return 1;
    if (wrong < best) { best = wrong; patience = 10; }
    if (--patience > 0) {
      for (int i = 0; i < k->size; i++) pivot[i] = next_position(k, i, position[i], nu);
      for (int i = 0; i < k->size; i++) position[i] = (int8_t)pivot[i];
    } else position[first] = (int8_t)next;
  }
  return 0;
}

/* Standard form with variables z >= 0: nu, and ``beside`` >= 0 complementary to z. z is the distance to a bound; for two
 * bounds that to the lower one and the positive part of w; two parts of nu where w = 0. The number of variables. */
static int standard_form(const Block *k, const double *z, double *nu, double *beside) {
  int at = 0, n = k->size;
  for (int contacts = 1; contacts >= 0; contacts--) /* bounds depend on contacts */
    for (int i = 0, v = 0; i < n; i++) {
      int state = k->state[i], two = state == INSIDE || (state == UNDECIDED && !k->is_contact[i]);
      int count = state == ABOVE || state == BELOW ? 0 : two ? 2 : 1, from = v;
      v += count;
      at = v;
      if (k->is_contact[i] != contacts) continue;
      double bound = k->is_contact[i] ? 0 : bound_of(k, i, nu);
      nu[i] = state == ABOVE ? bound : state == BELOW ? -bound : state == INSIDE ? z[from] - z[from + 1]
              : state == AT_TOP ? bound - z[from] : z[from] - bound;
    }
  for (int i = 0, v = 0; i < n; i++) {
    int state = k->state[i];
    double terms, w = rate_of(k, i, nu, &terms);
    if (state == ABOVE || state == BELOW) continue;
    if (state == INSIDE) { beside[v++] = -w; beside[v++] = w; }
    else if (state == AT_TOP) beside[v++] = w;
    else if (state == AT_BOTTOM || k->is_contact[i]) beside[v++] = -w;
    else { beside[v] = z[v + 1] - w; beside[v + 1] = bound_of(k, i, nu) - nu[i]; v += 2; }
  }
  return at;
}

/* A solution by Lemke's method. ``work`` has room for 14 n^2 + 20 n with n twice the size. */
static int lemke_block(const Block *k, double *nu, double *work, int32_t *pivot) {
  int most = 2 * k->size, n;
  double *z = work, *q = z + most, *other = q + most, *m = other + most, *rest = m + (int64_t)most * most;
  memset(z, 0, sizeof(double) * most);
  n = standard_form(k, z, nu, q);
  for (int j = 0; j < n; j++) {
    z[j] = 1;
    standard_form(k, z, nu, other);
    for (int i = 0; i < n; i++) m[(int64_t)i * n + j] = other[i] - q[i];
    z[j] = 0;
  }
  if (!lemke_scaled(m, q, n, z, rest, pivot)) return 0;
  standard_form(k, z, nu, other);
  return finite_all(nu, k->size);
}

/* The class of an element in a solution; ``part`` of its terms counts as zero, if that is more than rounding. */
static int class_of(const Block *k, int i, const double *nu, double part) {
  double terms, w = rate_of(k, i, nu, &terms), bound = bound_of(k, i, nu), zero = larger(zero_of(k, i, terms), part * terms);
  double room = larger(room_zero(k, i, zero, bound), part * fabs(bound));
  int state = k->state[i];
  if (state >= INSIDE) return state;
  if (k->is_contact[i]) return w < -zero ? BELOW : nu[i] > room ? INSIDE : AT_BOTTOM;
  if (w > zero) return ABOVE;
  if (w < -zero) return BELOW;
  if (state == UNDECIDED && bound <= room_zero(k, i, zero_of(k, i, terms), bound)) return UNDECIDED;
  if (state != AT_BOTTOM && bound - nu[i] <= room) return AT_TOP;
  if (state != AT_TOP && nu[i] + bound <= room) return AT_BOTTOM;
  return INSIDE;
}

/* The class of a vector, given its first row. */
static int class_of_vector(const Block *k, int i, const double *nu, double part) {
  double w[3], terms, zero = 0, room = 0, bound = bound_of(k, i, nu);
  int size = k->span[i];
  for (int j = 0; j < size; j++) {
    w[j] = rate_of(k, i + j, nu, &terms);
    double own = larger(zero_of(k, i + j, terms), part * terms);
    zero = larger(own, zero);
    room = larger(larger(room_zero(k, i + j, own, bound), part * bound), room);
  }
  if (k->state[i] >= INSIDE) return k->state[i];
  if (k->is_coupled) room = larger(part, VANISHES) * bound; /* loads are redistributed until all are at their bounds */
  if (length_of(w, size) > zero) return ABOVE;
  if (bound <= room) return UNDECIDED;
  return bound - length_of(nu + i, size) <= room ? AT_TOP : INSIDE;
}

/* A point inside ------------------------------------------------------------------------------------ */

/* The largest c y with c y <= cap and G y + s >= 0, y (d) free: 0 where it is not found. */
static int maximise(const double *g, const double *s, const double *c, double cap, int rows, int d, double *y,
                    double *work, int32_t *basis) {
  int n = 2 * d + rows + 1;
  double *m = work, *q = m + (int64_t)n * n, *z = q + n, *rest = z + n;
  memset(m, 0, sizeof(double) * n * n);
  for (int j = 0; j < d; j++) { q[j] = -c[j]; q[d + j] = c[j]; }
  for (int i = 0; i <= rows; i++) {
    q[2 * d + i] = i < rows ? s[i] : cap;
    for (int j = 0; j < d; j++) {
      double of = i < rows ? g[(int64_t)i * d + j] : -c[j];
      m[(int64_t)(2 * d + i) * n + j] = of;
      m[(int64_t)(2 * d + i) * n + d + j] = -of;
      m[(int64_t)j * n + 2 * d + i] = -of;
      m[(int64_t)(d + j) * n + 2 * d + i] = of;
    }
  }
  if (!lemke_scaled(m, q, n, z, rest, basis)) return 0;
  for (int j = 0; j < d; j++) y[j] = z[j] - z[d + j];
  return 1;
}

/* Distances of nu from its bounds where w is zero (rows), and their elements. */
static int distances(const Block *k, const double *nu, const int8_t *is_moving, double *s, int32_t *of) {
  int rows = 0;
  for (int i = 0; i < k->size; i++) {
    double bound = k->is_contact[i] ? 0 : bound_of(k, i, nu);
    if (!is_moving[i] || k->state[i] == INSIDE) continue;
    if (!k->is_contact[i] && k->state[i] != AT_BOTTOM) { of[rows] = i; s[rows++] = bound - nu[i]; }
    if (k->state[i] != AT_TOP) { of[rows] = i; s[rows++] = nu[i] + bound; }
  }
  return rows;
}

/* The largest size of an unbounded unknown, from the other unknowns. */
static double reach_of(const Block *k, const double *nu, int i) {
  double reach = 0, own = 0;
  if (!k->is_contact[i]) return 0;
  for (int l = 0; l < k->size; l++) own = larger(fabs(k->matrix[l * k->size + i]), own);
  for (int j = 0; j < k->size && own > 0; j++)
    for (int l = 0; l < k->size; l++) reach = larger(fabs(k->matrix[l * k->size + j] * nu[j]) / own, reach);
  return reach;
}

/* Move a solution, whose w is unique, inside all solutions: the mean of those that are farthest from a bound. Room as
 * lemke_block's and 40 n^2 + 40 n. Returns the dimension of the set of solutions. */
static int move_inside(const Block *k, double *nu, double *work, int32_t *pivot) {
  int n = k->size, rows = 0, found = 1;
  int8_t *is_moving = (int8_t *)work;
  int32_t of[2 * n];
  double *e = work + n, *z = e + 2 * (int64_t)n * n, *g = z + (int64_t)n * n, *s = g + 2 * (int64_t)n * n, *mean = s + 2 * n;
  double *y = mean + n, *trial = y + n, *shifted = trial + n, *rest = shifted + 2 * n;
  for (int i = 0; i < n; i++) {
    int class = class_of(k, i, nu, 0);
    is_moving[i] = class != ABOVE && class != BELOW;
  }
  memset(e, 0, sizeof(double) * 2 * n * n);
  for (int i = 0; i < n; i++) {
    double side = class_of(k, i, nu, 0) == ABOVE ? 1 : -1;
    memcpy(e + (int64_t)rows++ * n, k->matrix + (int64_t)i * n, sizeof(double) * n);
    if (is_moving[i]) continue;
    for (int j = 0; j < n && !k->is_contact[i]; j++) e[(int64_t)rows * n + j] = -side * k->share[i * n + j];
    e[(int64_t)rows++ * n + i] += 1;
  }
  int d = null_space(e, rows, n, z, rest, pivot);
  if (!d) return 0;
  memcpy(mean, nu, sizeof(double) * n);
  rows = distances(k, nu, is_moving, s, of);
  for (int l = 0; l < d; l++) { /* distances are affine */
    for (int i = 0; i < n; i++) trial[i] = nu[i] + z[(int64_t)l * n + i];
    distances(k, trial, is_moving, shifted, of);
    for (int q = 0; q < rows; q++) g[(int64_t)q * d + l] = shifted[q] - s[q];
  }
  for (int q = 0; q < rows; q++) s[q] = larger(s[q], 0);
  double cap = 0;
  for (int i = 0; i < n; i++) cap = larger(cap, fabs(nu[i]) + (k->is_contact[i] ? 0 : fabs(bound_of(k, i, nu))));
  for (int q = 0; q < rows; q++) {
    distances(k, mean, is_moving, shifted, of);
    if (shifted[q] > TIED * cap || !(cap > 0)) continue;
    if (!maximise(g, s, g + (int64_t)q * d, larger(cap, reach_of(k, nu, of[q])), rows, d, y, rest, pivot)) continue;
    found++;
    for (int i = 0; i < n; i++) {
      trial[i] = nu[i];
      for (int l = 0; l < d; l++) trial[i] += z[(int64_t)l * n + i] * y[l];
      mean[i] += (trial[i] - mean[i]) / found;
    }
  }
  memcpy(nu, mean, sizeof(double) * n);
  return d;
}

/* All solutions of a block ---------------------------------------------------------------------------- */

/* Whether two solutions are equal, or have the same w. */
static int is_same(const Block *k, const double *one, const double *two, int only_rates) {
  for (int i = 0; i < k->size; i++) {
    double terms, more, w = rate_of(k, i, one, &terms), v = rate_of(k, i, two, &more);
    double zero = larger(zero_of(k, i, larger(terms, more)), MERGED * larger(terms, more));
    if (fabs(w - v) > zero) return 0;
    if (only_rates) continue;
    double bound = larger(fabs(one[i]), fabs(two[i]));
    if (fabs(one[i] - two[i]) > larger(room_zero(k, i, zero, bound), MERGED * bound)) return 0;
  }
  return 1;
}

/* Solutions for given positions; more than one where a vector is at its bound. */
static int solutions_at(const Block *k, const int8_t *position, double *found, double *work, int32_t *pivot) {
  int n = k->size, first = -1, size, count;
  double base[MOST_ENUMERATED], moved[3][MOST_ENUMERATED], a[3], m[9], u[6][3], terms;
  for (int i = 0; i < n; i++) {
    if (span_of(k, i) <= 0 || position[i] == HELD) continue;
    if (first >= 0) return 0;
    first = i;
  }
  if (first < 0) return place_unknowns(k, position, found, work, pivot);
  size = k->span[first];
  for (int c = -1; c < size; c++) { /* w is affine in it */
    double *nu = c < 0 ? base : moved[c];
    for (int i = 0; i < size; i++) nu[first + i] = i == c ? k->b[first] : 0;
    if (!place_unknowns(k, position, nu, work, pivot)) return 0;
    for (int i = 0; i < size; i++) {
      if (c < 0) a[i] = rate_of(k, first + i, nu, &terms);
      else m[i * size + c] = a[i] - rate_of(k, first + i, nu, &terms);
    }
  }
  count = limit_directions(a, m, size, u);
  for (int q = 0; q < count; q++)
    for (int i = 0; i < n; i++) {
      found[q * n + i] = base[i];
      for (int c = 0; c < size; c++) found[q * n + i] += u[q][c] * (moved[c][i] - base[i]);
    }
  return count;
}

/* Try all positions; solutions with the same w are averaged. Writes ``found`` (MOST_SOLUTIONS, n), returns their number. */
static int enumerate(const Block *k, double *found, double *work, int32_t *pivot) {
  int n = k->size, count = 0, groups = 0, in_group[MOST_SOLUTIONS];
  int8_t position[MOST_ENUMERATED];
  double all[MOST_FOUND * MOST_ENUMERATED], each[6 * MOST_ENUMERATED];
  int64_t total = 1;
  for (int i = 0; i < n; i++) total *= 3;
  for (int64_t number = 0; number < total && count < MOST_FOUND; number++) {
    int64_t rest = number;
    int fits = 1;
    for (int i = 0; i < n && fits; i++, rest /= 3) {
      fits = allows(k, i, position[i] = (int8_t)(rest % 3));
      fits = fits && (span_of(k, i) >= 0 || position[i] == position[i - 1]);
    }
    for (int some = fits ? solutions_at(k, position, each, work, pivot) : 0; some > 0 && count < MOST_FOUND; some--) {
      const double *nu = each + (some - 1) * n;
      fits = 1;
      for (int i = 0; i < n && fits; i++) {
        fits = next_position(k, i, position[i], nu) == position[i];
        double bound = bound_of(k, i, nu);
        fits = fits && (k->is_contact[i] || k->state[i] != UNDECIDED || bound >= -room_zero(k, i, k->floor[i], bound));
      }
      for (int q = 0; q < count && fits; q++) fits = !is_same(k, all + q * n, nu, 0);
      if (fits) memcpy(all + n * count++, nu, sizeof(double) * n);
    }
  }
  for (int q = 0; q < count; q++) {
    int g = 0;
    while (g < groups && !is_same(k, found + g * n, all + q * n, 1)) g++;
    if (g == MOST_SOLUTIONS) continue;
    if (g == groups) { in_group[groups++] = 0; memset(found + g * n, 0, sizeof(double) * n); }
    in_group[g]++;
    for (int i = 0; i < n; i++) found[g * n + i] += (all[q * n + i] - found[g * n + i]) / in_group[g];
  }
  return groups;
}

/* nu - P(nu + w/slope), P being the projection to the sets of the unknowns, and its derivatives by them (n, n); its
 * largest element. */
static double natural_map(const Block *k, const double *nu, double *rest, double *slopes) {
  int n = k->size;
  for (int i = 0, size; i < n; i += size) {
    size = span_of(k, i) > 0 ? k->span[i] : 1;
    int state = k->state[i], is_open = state == UNDECIDED, is_vector = span_of(k, i) > 0;
    double y[3], u[3], slope = 0, bound = bound_of(k, i, nu), terms;
    for (int q = i; q < i + size; q++) slope = larger(k->matrix[q * (n + 1)], slope);
    double per = slope > 0 ? 1 / slope : 1;
    for (int q = 0; q < size; q++) y[q] = nu[i + q] + per * rate_of(k, i + q, nu, &terms);
    double length = is_vector ? unit_of(y, size, u) : bound;
    if (!is_vector) {
      int is_above = state == ABOVE || ((is_open || state == AT_TOP) && !k->is_contact[i] && y[0] > bound);
      int is_below = state == BELOW || ((is_open || state == AT_BOTTOM) && y[0] < (k->is_contact[i] ? 0 : -bound));
      u[0] = is_above - is_below;
    }
    int is_out = is_vector ? length > bound : u[0] != 0;
    for (int q = 0; q < size; q++) {
      rest[i + q] = nu[i + q] - (is_out ? k->is_contact[i] ? 0 : bound * u[q] : y[q]);
      for (int j = 0; j < n; j++) {
        double *to = slopes + (int64_t)(i + q) * n + j, along = 0, turns = per * k->matrix[(i + q) * n + j];
        *to = is_out ? (j == i + q) - (k->is_coupled ? k->share[i * n + j] * u[q] : 0) : turns;
        if (!is_out || !is_vector) continue;
        for (int c = 0; c < size; c++) along += u[c] * ((j == i + c) - per * k->matrix[(i + c) * n + j]);
        *to -= bound / length * ((j == i + q) - turns - u[q] * along);
      }
    }
  }
  return largest_of(rest, n);
}

/* A solution close to nu by Newton's method; whether it converges. */
static int polish(const Block *k, double *nu, double most, double *work, int32_t *pivot) {
  int n = k->size;
  double *slopes = work, *step = slopes + (int64_t)n * n, *trial = step + n, *rest = trial + n, left = INFINITY;
  memcpy(trial, nu, sizeof(double) * n);
  for (int again = 0; again < LAYER_NEWTON && left > EPSILON * most; again++) {
    double now = natural_map(k, trial, step, slopes);
    if (now < left) { left = now; memcpy(nu, trial, sizeof(double) * n); }
    if (!solve_any(slopes, step, n, INFINITY, rest, pivot)) break;
    for (int i = 0; i < n; i++) trial[i] -= step[i];
  }
  return left <= VANISHES * most;
}

/* Gauss-Seidel iteration of a block with vectors, finished by Newton's method; whether it converges. */
static int relax_from(const Block *k, double *nu, double most, double *work, int32_t *pivot) {
  int n = k->size;
  double change = INFINITY, last = INFINITY, *found = work;
  for (int again = 0; again < 2000 && change > 4 * EPSILON * most && !(change >= last && last < TIED * most); again++) {
    last = change;
    change = 0;
    if (again == 10 || again == 100 || again == 1000) {
      memcpy(found, nu, sizeof(double) * n);
      if (polish(k, found, most, work + n, pivot)) { memcpy(nu, found, sizeof(double) * n); return 1; }
    }
    for (int i = 0, size; i < n; i += size) {
      double rest[3], y[3], own[9], bound = bound_of(k, i, nu), low = k->is_contact[i] ? 0 : -bound;
      int state = k->state[i];
      size = span_of(k, i) > 0 ? k->span[i] : 1;
      for (int q = 0; q < size; q++) {
        rest[q] = k->a[i + q];
        for (int j = 0; j < n; j++) {
          double of = k->matrix[(i + q) * n + j];
          if (j >= i && j < i + size) own[q * size + j - i] = of; else rest[q] -= of * nu[j];
        }
      }
      int is_inside = solve_vector(own, size, 0, rest, y);
      if (span_of(k, i) > 0) {
        if (state != INSIDE && (state == ABOVE || !is_inside || length_of(y, size) > bound)) {
          for (int q = 0; q < size * size; q++) own[q] *= bound;
          if (bound > 0 && !leaving_direction(rest, own, size, y)) { /* it has no inverse: a step downhill */
            double most_of = largest_of(own, size * size) / bound;
            for (int q = 0; q < size; q++) y[q] = nu[i + q] + (rest[q] - dot(own + q * size, nu + i, size) / bound) / (size * most_of);
            unit_of(y, size, y);
          }
          for (int q = 0; q < size; q++) y[q] = bound > 0 ? bound * y[q] : 0;
        }
      } else {
        if (state == ABOVE || state == BELOW) y[0] = state == ABOVE ? bound : low;
        if (state != INSIDE && state != AT_BOTTOM && !k->is_contact[i]) y[0] = smaller(y[0], bound);
        if (state != INSIDE && state != AT_TOP) y[0] = larger(y[0], low);
      }
      for (int q = 0; q < size; q++) { change = larger(fabs(y[q] - nu[i + q]), change); nu[i + q] = y[q]; }
    }
  }
  return finite_all(nu, n) && (!k->is_coupled || change <= TIED * most);
}

/* Where all vectors are held: another solution, in which some slip and friction is against their slip. It is followed from
 * the one without friction as the bounds grow; 0 where there is none. */
static int slip_beside(const Block *k, const double *held, double *nu, double *work, int32_t *pivot) {
  int n = k->size, slips = 0;
  double *bound = work, *next = bound + n, *share = next + n, *rest = share + (int64_t)n * n, most = largest_of(held, n), terms;
  Block part = *k;
  part.b = bound;
  part.share = share;
  for (int i = 0; i < n; i++) {
    if (k->state[i] != UNDECIDED || (span_of(k, i) > 0 && class_of_vector(k, i, held, 0) == ABOVE)) return 0;
    nu[i] = k->is_contact[i] ? held[i] : 0;
  }
  for (int step = 0; step <= GROWTHS; step++) {
    for (int i = 0; i < n; i++) bound[i] = k->b[i] * step / GROWTHS;
    for (int i = 0; i < n * n; i++) share[i] = k->share[i] * step / GROWTHS;
    if (step == 0 ? !relax_from(&part, nu, most, rest, pivot) : !polish(&part, nu, most, rest, pivot)) return 0;
    memcpy(next, nu, sizeof(double) * n);
    slips = 0;
    for (int i = 0; i < n; i++) { /* the next friction is in the direction of slip */
      double w[3], u[3];
      if (span_of(k, i) <= 0 || class_of_vector(&part, i, nu, 0) != ABOVE) continue;
      slips = 1;
      for (int q = 0; q < k->span[i]; q++) w[q] = rate_of(&part, i + q, nu, &terms);
      unit_of(w, k->span[i], u);
      for (int q = 0; q < k->span[i] && step < GROWTHS; q++) next[i + q] = bound_of(k, i, nu) * (step + 1) / GROWTHS * u[q];
    }
    if (!slips) return 0;
    memcpy(nu, next, sizeof(double) * n);
  }
  return 1;
}

/* Whether w is zero with nu inside all bounds, to rounding. */
static int needs_no_bound(const Block *k, const double *nu) {
  for (int i = 0; i < k->size; i++) {
    int size = span_of(k, i), state = k->state[i];
    double terms, w = rate_of(k, i, nu, &terms), most = (1 + TIED) * bound_of(k, i, nu);
    if ((state != UNDECIDED && state != INSIDE) || fabs(w) > zero_of(k, i, terms)) return 0;
    if (state == INSIDE || size < 0) continue;
    if (k->is_contact[i] ? nu[i] < 0 : size ? length_of(nu + i, size) > most : fabs(nu[i]) > most) return 0;
  }
  return 1;
}

/* Gradient and Hessian of the barrier function tau s - sum log(distances from the bounds, with the slack s) by ``n``
 * variables, s the last; 0 where a distance is not positive. Columns of z (n - 1, size) are the directions of nu. */
static int barrier_of(const Block *k, const double *nu, const double *z, int n, double s, double unit, double tau, double *grad,
                      double *hess) {
  int size = k->size;
  double of[size + 1];
  memset(hess, 0, sizeof(double) * n * n);
  for (int l = 0; l < n; l++) grad[l] = l == n - 1 ? tau : 0;
  for (int i = 0, own; i < size; i += own) {
    own = span_of(k, i) > 0 ? k->span[i] : 1;
    int is_contact = k->is_contact[i];
    double b = (is_contact ? nu[i] : bound_of(k, i, nu)) + s * unit, phi = is_contact ? b : b * b - dot(nu + i, nu + i, own);
    if (!(b > 0 && phi > 0)) return 0;
    for (int l = 0; l < n; l++) {
      const double *to = z + (int64_t)l * size;
      double rate = l == n - 1 ? unit : is_contact ? to[i] : dot(k->share + (int64_t)i * size, to, size);
      of[l] = is_contact ? rate : 2 * (b * rate - (l < n - 1 ? dot(nu + i, to + i, own) : 0));
      grad[l] -= of[l] / phi;
      for (int m = 0; m <= l; m++) {
        const double *other = z + (int64_t)m * size;
        double second = l == n - 1 ? unit : dot(k->share + (int64_t)i * size, to, size);
        second *= m == n - 1 ? unit : dot(k->share + (int64_t)i * size, other, size);
        if (l < n - 1) second -= dot(to + i, other + i, own);
        hess[l * n + m] += of[l] * of[m] / (phi * phi) - (is_contact ? 0 : 2 * second / phi);
      }
    }
  }
  for (int l = 0; l < n; l++) for (int m = 0; m < l; m++) hess[m * n + l] = hess[l * n + m];
  return 1;
}

/* Move a solution with w = 0 to where it is farthest from all bounds, by an interior-point method: how
 * far outside it is, in units of the largest bound or unknown; 1 where it cannot move. */
static double move_into_cones(const Block *k, double *nu, double *work, int32_t *pivot) {
  int size = k->size, n;
  double *z = work, *trial = z + (int64_t)size * size, *grad = trial + size, *hess = grad + size + 1;
  double *step = hess + (int64_t)(size + 1) * (size + 1), unit = 0, s = 0;
  for (int i = 0; i < size; i++) unit = larger(unit, larger(fabs(nu[i]), k->is_contact[i] ? 0 : fabs(bound_of(k, i, nu))));
  n = null_space(k->matrix, size, size, z, step, pivot) + 1;
  if (n == 1 || n > size || !(unit > 0)) return 1;
  while (!barrier_of(k, nu, z, n, s, unit, 1, grad, hess)) if ((s = 2 * s + 1) > 1 / MERGED) return 1;
  for (double tau = 1; tau < 1 / TIED; tau *= 3)
    for (int again = 0; again < 20; again++) {
      if (!barrier_of(k, nu, z, n, s, unit, tau, grad, hess)) return 1;
      if (s < -0.5) return s;
      memcpy(step, grad, sizeof(double) * n);
      if (!solve(hess, step, n)) return 1;
      double decrement = sqrt(larger(dot(grad, step, n), 0)), part = 1 / (1 + decrement), before = s;
      memcpy(trial, nu, sizeof(double) * size);
      do { /* as far as rounding in the step lets it stay inside */
        memcpy(nu, trial, sizeof(double) * size);
        for (int l = 0; l < n - 1; l++) for (int i = 0; i < size; i++) nu[i] -= part * step[l] * z[(int64_t)l * size + i];
        s = before - part * step[n - 1];
      } while ((part /= 2) > TIED && !barrier_of(k, nu, z, n, s, unit, tau, grad, hess));
      if (decrement < WEAK) break;
    }
  return s;
}

/* Whether all that holds with w = 0 does so at a bound, of many unknowns: sizes of vectors are at theirs, or loads none. */
static int is_at_limit(const Block *k, const double *nu, double *work, int32_t *pivot) {
  int is_tight = 0;
  double most = 0, terms;
  for (int i = 0; i < k->size; i++) most = larger(most, larger(fabs(nu[i]), k->is_contact[i] ? 0 : fabs(bound_of(k, i, nu))));
  for (int i = 0; i < k->size; i++) {
    double w = rate_of(k, i, nu, &terms);
    if (fabs(w) > zero_of(k, i, terms)) return 0;
    if (span_of(k, i) < 0) continue;
    double bound = k->is_contact[i] ? 2 * nu[i] : bound_of(k, i, nu);
    is_tight |= bound - length_of(nu + i, span_of(k, i) > 0 ? k->span[i] : 1) <= 8 * TIED * most;
  }
  return is_tight && null_space(k->matrix, k->size, k->size, work, work + k->size * k->size, pivot);
}

/* The solution of a block with vectors, symmetric but for loads, starting at the least nu with w = 0, in units of the roots
 * of the bounds. Undetermined loads are shared in proportion to the bounds. */
static int relax(const Block *k, double *nu, double *work, int32_t *pivot) {
  int n = k->size;
  double *unit = work, *inverse = unit + n, *last = inverse + 4 * (int64_t)n * n + n, most = 0, change = INFINITY;
  for (int i = 0; i < n; i++) unit[i] = 1;
  for (int pass = 0; pass < (k->is_coupled ? 60 : 1) && change > VANISHES * most; pass++) {
    most = change = 0;
    invert_any(k->matrix, n, unit, inverse, inverse + (int64_t)n * n, pivot);
    apply(inverse, k->a, n, nu);
    for (int i = 0; i < n; i++) {
      most = larger(larger(fabs(k->b[i]), fabs(nu[i])), most);
      change = pass ? larger(fabs(nu[i] - last[i]), change) : INFINITY;
      last[i] = nu[i];
    }
    for (int i = 0; i < n; i++)
      unit[i] = sqrt(larger(k->is_contact[i] ? nu[i] : bound_of(k, i, nu), MERGED * (most > 0 ? most : 1)));
  }
  int is_kept = (k->is_coupled || k->is_joined) && needs_no_bound(k, nu), may_move = 1;
  for (int i = 0; i < n; i++) may_move &= k->state[i] == UNDECIDED;
  memcpy(last, nu, sizeof(double) * n);
  double out = may_move && k->span ? move_into_cones(k, nu, last + n, pivot) : 1;
  if (out < (k->may_end ? MERGED : -TIED)) return 1;
  memcpy(nu, last, sizeof(double) * n);
  return is_kept || relax_from(k, nu, most, last + n, pivot);
}

/* Solutions of a block of several elements: only one where a certificate proves uniqueness or the block is large. */
static int solve_block_of_many(const Block *k, int certificate, int8_t *position, double *found, double *work,
                               int32_t *pivot) {
  int is_loaded = k->span && k->is_coupled; /* friction in space by reactions */
  if (certificate == NOTHING && k->size <= MOST_ENUMERATED && !is_loaded) return enumerate(k, found, work, pivot);
  if (k->span) return relax(k, found, work, pivot);
  int most = certificate >= UNIQUE ? 10000 : 20 + 4 * k->size;
  int solved = pivot_block(k, position, found, most, work, pivot) || lemke_block(k, found, work, pivot);
  if (solved && certificate < UNIQUE) move_inside(k, found, work, pivot);
  return solved;
}

/* Solutions of one element. Without a matrix higher orders decide between its bounds. */
static int solve_single(const Block *k, double *found) {
  double a = k->a[0], m = k->matrix[0], b = k->b[0], low = k->is_contact[0] ? 0 : -b, zero = k->floor[0];
  int state = k->state[0], count = 0;
  if (state == ABOVE || state == BELOW) { found[0] = state == ABOVE ? b : low; return 1; }
  if (state == INSIDE) { found[0] = a / m; return isfinite(found[0]); }
  if (m > 0) {
    double nu = a / m;
    if (state != AT_BOTTOM && !k->is_contact[0]) nu = smaller(nu, b);
    if (state != AT_TOP) nu = larger(nu, low);
    found[0] = nu;
    return 1;
  }
  if (allows(k, 0, HELD) && m < 0) {
    double nu = a / m;
    if ((state == AT_BOTTOM || k->is_contact[0] || nu <= b) && (state == AT_TOP || nu >= low)) found[count++] = nu;
  }
  if (allows(k, 0, TOP) && a - m * b >= -zero) found[count++] = b;
  if (allows(k, 0, BOTTOM) && a - m * low <= zero && !(count && found[count - 1] == low)) found[count++] = low;
  if (count == 2 && found[0] == found[1]) count = 1;
  return count;
}
