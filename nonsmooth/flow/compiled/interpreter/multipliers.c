/* The return map of an orbit on what it keeps: nonsmooth/orbit/periodic/multipliers.py -------------------------------- */

/* Legs as they were flown, stacked and dense: ends of s states, starts of n. */
typedef struct {
  int64_t count, n, s;
  const double *by_start, *rate, *gradient, *after_state; /* (s, n), (s), (s), (n, s) */
  const double *wrap, *units;                             /* of the symmetry or null; sizes of the states */
} Returns;

int64_t returns_size(void) { return sizeof(Returns); }

/* c = a b, of (l, m) and (m, n). */
static void product(const double *a, const double *b, int64_t l, int64_t m, int64_t n, double *c) {
  for (int64_t i = 0; i < l; i++)
    for (int64_t k = 0; k < n; k++) {
      double sum = 0;
      for (int64_t j = 0; j < m; j++) sum += a[i * m + j] * b[j * n + k];
      c[i * n + k] = sum;
    }
}

static double norm(const double *a, int64_t count, int64_t stride) {
  double sum = 0;
  for (int64_t i = 0; i < count; i++) sum += a[i * stride] * a[i * stride];
  return sqrt(sum);
}

/* Map across the flow from the start of leg i to that of the next, in units of the states; ``work`` has room for
 * s n + n n. 0 where the leg grazes its event. */
static int leg_map(const Returns *r, int64_t i, double grazing, double *work, double *map) {
  int64_t n = r->n, s = r->s;
  const double *x = r->by_start + i * s * n, *rate = r->rate + i * s, *e = r->gradient + i * s;
  double *across = work, *turned = work + s * n, speed = 0;
  for (int64_t k = 0; k < s; k++) speed += e[k] * rate[k];
  if (!(fabs(speed) >= grazing * norm(e, s, 1) * norm(rate, s, 1)) || speed == 0) return 0;
  for (int64_t c = 0; c < n; c++) {
    double sum = 0;
    for (int64_t k = 0; k < s; k++) sum += e[k] * x[k * n + c];
    for (int64_t k = 0; k < s; k++) across[k * n + c] = x[k * n + c] - rate[k] * (sum / speed);
  }
  product(r->after_state + i * n * s, across, n, s, n, map);
  if (r->wrap && i + 1 == r->count) {
    memcpy(turned, map, sizeof(double) * n * n);
    product(r->wrap, turned, n, n, n, map);
  }
  for (int64_t k = 0; k < n; k++) for (int64_t c = 0; c < n; c++) map[k * n + c] *= r->units[c] / r->units[k];
  return 1;
}

/* The return map (n, n) across the flow, in units of the states, in ``memory``, which has room for 4 n n + s n. 0 where
 * an event is grazed. */
int64_t whole_map(const Returns *r, double *memory) {
  int64_t n = r->n, square = n * n;
  double *map = memory + square, *next = map + square, *work = next + square;
  for (int64_t i = 0; i < r->count; i++) {
    if (!leg_map(r, i, 0, work, i ? map : memory)) return 0;
    if (!i) continue;
    product(map, memory, n, n, n, next);
    memcpy(memory, next, sizeof(double) * square);
  }
  return finite_all(memory, square);
}

/* Orthonormal basis of the range of a (n, m) in its place, column beside column, without what is lost beside
 * ``size``: Gram and Schmidt, the largest first, each twice. Columns that remain. */
static int64_t range_of(double *a, int64_t n, int64_t m, double size, double lost) {
  int64_t found = 0;
  for (; found < m; found++) {
    int64_t best = found;
    for (int64_t c = found; c < m; c++) if (norm(a + c, n, m) > norm(a + best, n, m)) best = c;
    double length = norm(a + best, n, m);
    if (found == 0) size = larger(length, size);
    if (!(length > lost * size)) break;
    for (int64_t k = 0; k < n && best != found; k++) {
      double t = a[k * m + best]; a[k * m + best] = a[k * m + found]; a[k * m + found] = t;
    }
    for (int twice = 0; twice < 2; twice++) {
      for (int64_t c = 0; c < found; c++) {
        double part = 0;
        for (int64_t k = 0; k < n; k++) part += a[k * m + c] * a[k * m + found];
        for (int64_t k = 0; k < n; k++) a[k * m + found] -= part * a[k * m + c];
      }
      length = norm(a + found, n, m);
      for (int64_t k = 0; k < n; k++) a[k * m + found] /= length;
    }
    for (int64_t c = found + 1; c < m; c++) {
      double part = 0;
      for (int64_t k = 0; k < n; k++) part += a[k * m + found] * a[k * m + c];
      for (int64_t k = 0; k < n; k++) a[k * m + c] -= part * a[k * m + found];
    }
  }
  for (int64_t k = 0; k < n; k++) for (int64_t c = 0; c < found; c++) a[k * found + c] = a[k * m + c];
  return found;
}

/* The return map (r, r) on what r directions of ``basis`` (n, columns) become, in ``memory``, which begins with
 * the basis and has room for (2 L + 5) n n + s n. Its size r, or -1 where an event is grazed. */
int64_t reduced_map(const Returns *r, int64_t columns, double grazing, double lost, double *memory) {
  int64_t n = r->n, square = n * n, first = 0;
  double *basis = memory, *maps = basis + square, *bases = maps + r->count * square;
  double *flown = bases + r->count * square, *next = flown + square, *turned = next + square, *work = turned + square;
  int64_t size[1024];
  if (r->count > 1024) return -1;
  for (int64_t i = 0; i < r->count; i++) if (!leg_map(r, i, grazing, work, maps + i * square)) return -1;
  for (int again = 0; again < 2; again++)
    for (int64_t i = 0; i < r->count; i++) {
      const double *x = r->by_start + i * r->s * n;
      int64_t following = i + 1 == r->count ? 0 : i + 1;
      for (int64_t k = 0; k < n; k++)
        for (int64_t c = 0; c < n; c++) turned[k * n + c] = x[k * n + c] * r->units[c] / r->units[k];
      product(turned, basis, n, n, columns, flown);
      product(maps + i * square, basis, n, n, columns, next);
      columns = range_of(next, n, columns, norm(flown, n * columns, 1), lost);
      memcpy(basis, next, sizeof(double) * n * columns);
      memcpy(bases + following * square, next, sizeof(double) * n * columns);
      size[following] = columns;
    }
  for (int64_t i = 1; i < r->count; i++) if (size[i] < size[first]) first = i;
  columns = size[first];
  memset(turned, 0, sizeof(double) * square);
  for (int64_t k = 0; k < columns; k++) turned[k * columns + k] = 1;
  for (int64_t l = 0; l < r->count; l++) { /* ``turned`` is the product so far, (own, columns) */
    int64_t i = (first + l) % r->count, following = (i + 1) % r->count, own = size[i], more = size[following];
    product(bases + i * square, turned, n, own, columns, flown);
    product(maps + i * square, flown, n, n, columns, next);
    const double *b = bases + following * square;
    for (int64_t k = 0; k < more; k++)
      for (int64_t c = 0; c < columns; c++) {
        double sum = 0;
        for (int64_t m = 0; m < n; m++) sum += b[m * more + k] * next[m * columns + c];
        turned[k * columns + c] = sum;
      }
  }
  memcpy(memory, turned, sizeof(double) * columns * columns);
  return columns;
}
