/* Double-double arithmetic with the time, for runs that do not begin at time zero.
 *
 * The time state counts from the start. The time in a formula is its sum with the start, whose rounding is too large for a
 * large start: 1e-7 at 1.7e9, also in the argument of cos(omega t). ``paired`` nodes are evaluated in two numbers, up to
 * the first function with one.
 */
typedef struct { double high, low; } Pair;

static inline Pair pair_of(double high, double low) {
  double sum = high + low;
  return isfinite(sum) ? (Pair){sum, low - (sum - high)} : (Pair){high, 0};
}
static Pair pair_sum(Pair u, Pair v) {
  double sum = u.high + v.high, moved = sum - u.high;
  return pair_of(sum, (u.high - (sum - moved)) + (v.high - moved) + (u.low + v.low));
}
static Pair pair_minus(Pair u) { return (Pair){-u.high, -u.low}; }
static Pair pair_product(Pair u, Pair v) {
  double product = u.high * v.high;
  return pair_of(product, fma(u.high, v.high, -product) + (u.high * v.low + u.low * v.high));
}
static Pair pair_quotient(Pair u, Pair v) {
  double quotient = ratio(u.high, v.high);
  if (!isfinite(quotient)) return (Pair){quotient, 0};
  return pair_of(quotient, (fma(-quotient, v.high, u.high) + (u.low - quotient * v.low)) / v.high);
}

/* The largest integer not above a pair whose first number is an integer. */
static double pair_floor(Pair u) {
  double low = floor(u.high);
  return low == u.high && u.low < 0 ? low - 1 : low;
}
static Pair pair_remainder(Pair u, Pair v) {
  Pair part = pair_sum((Pair){fmod(u.high, v.high), 0}, (Pair){u.low - trunc(u.high / v.high) * v.low, 0});
  Pair period = u.high * v.high < 0 ? pair_minus(v) : v;
  if (part.high * u.high < 0) return pair_sum(part, period);
  return fabs(part.high) < fabs(v.high) ? part : pair_sum(part, pair_minus(period));
}

static Pair pair_operate(int op, Pair u, Pair v) {
  switch (op) {
    case OP_assign: return u;
    case OP_neg: return pair_minus(u);
    case OP_twice: return (Pair){2 * u.high, 2 * u.low};
    case OP_sq: return pair_product(u, u);
    case OP_inv: return pair_quotient((Pair){1, 0}, u);
    case OP_add: return pair_sum(u, v);
    case OP_sub: return pair_sum(u, pair_minus(v));
    case OP_mul: return pair_product(u, v);
    case OP_div: return pair_quotient(u, v);
    case OP_fabs: return u.high < 0 ? pair_minus(u) : u;
    case OP_if_else_zero: return u.high ? v : (Pair){0, 0};
    case OP_fmod: return pair_remainder(u, v);
    case OP_floor: return (Pair){pair_floor(u), 0};
    case OP_ceil: return (Pair){-pair_floor(pair_minus(u)), 0};
  }
  double apart = pair_sum(u, pair_minus(v)).high;
  switch (op) {
    case OP_fmin: return apart < 0 ? u : v;
    case OP_fmax: return apart > 0 ? u : v;
    case OP_lt: return (Pair){apart < 0, 0};
    case OP_le: return (Pair){apart <= 0, 0};
    case OP_eq: return (Pair){apart == 0, 0};
    case OP_ne: return (Pair){apart != 0, 0};
    case OP_sin: return (Pair){sin(u.high) * cos(u.low) + cos(u.high) * sin(u.low), 0};
    case OP_cos: return (Pair){cos(u.high) * cos(u.low) - sin(u.high) * sin(u.low), 0};
    case OP_tan: return (Pair){(tan(u.high) + tan(u.low)) / (1 - tan(u.high) * tan(u.low)), 0};
  }
  return (Pair){operate(op, u.high, v.high), 0};
}

/* The values of all nodes are followed by their second numbers, then the time of the start. */
static size_t pair_room(int32_t size, int stride) { return (size_t)size * (stride + 1) + 2; }
static void pairs_begin(int32_t size, int stride, Pair start, double *w) {
  w += (int64_t)size * (stride + 1);
  w[0] = start.high;
  w[1] = start.low;
}
static int has_pairs(int timed, int32_t size, int stride, const double *w) {
  w += (int64_t)size * (stride + 1);
  return timed && (w[0] != 0 || w[1] != 0);
}

static void values_pairs(const Values *t, const int32_t *which, int32_t count, const double *x, const double *p, double *w) {
  double *low = w + t->size;
  const double *start = low + t->size;
  for (int32_t k = 0; k < count; k++) {
    int32_t j = which[k], a = t->a[j], b = t->b[j];
    if (!t->paired[j]) { values_nodes(t, which + k, 1, x, p, w); continue; }
    Pair value = t->op[j] == OP_input ? pair_sum((Pair){start[0], start[1]}, (Pair){x[b], 0})
                                      : pair_operate(t->op[j], (Pair){w[a], low[a]}, (Pair){w[b], low[b]});
    w[j] = value.high;
    low[j] = value.low;
  }
}

/* Values of a program at a point of a run, and the part that suffices without sliding. */
static void values_at(const Values *t, const double *x, const double *p, double *w) {
  if (has_pairs(t->timed, t->size, 1, w)) values_pairs(t, t->moving, t->moving_count, x, p, w);
  else values_run(t, x, p, w);
}
static void values_free_at(const Values *t, const double *x, const double *p, double *w) {
  if (has_pairs(t->timed, t->size, 1, w)) values_pairs(t, t->free, t->free_count, x, p, w);
  else values_free(t, x, p, w);
}

/* The value of a rule in two numbers; ``low`` are the second ones. */
static Pair pair_rule(const Series *t, const Rule *q, int stride, const double *s, const double *low) {
  Pair total = {0, 0};
#define PAIR(row) ((Pair){s[row], low[(row) / stride]})
  if (q->rule != RULE_sum) return pair_operate(q->op, PAIR(q->a), PAIR(q->b));
  for (const Term *e = t->term + q->begin, *end = t->term + q->end; e < end; e++)
    total = pair_sum(total, pair_product((Pair){e->factor, 0}, pair_product(PAIR(e->a), PAIR(e->b))));
#undef PAIR
  return total;
}

static void series_pairs(const Series *t, const List *list, int stride, const double *x, double *s) {
  double *low = s + (int64_t)t->size * stride;
  Pair start = {low[t->size], low[t->size + 1]};
  for (int32_t l = 0; l < t->inputs; l++) {
    int32_t row = t->input[l];
    if (!t->rule[row / stride].paired) continue;
    Pair value = pair_sum(start, (Pair){x[t->index[l]], 0});
    s[row] = value.high;
    low[row / stride] = value.low;
  }
  for (int32_t l = 0; l < list->count; l++) {
    const Rule *q = t->rule + list->rule[l];
    series_values(t, list->rule + l, 1, stride, s);
    if (!q->paired) continue;
    Pair value = pair_rule(t, q, stride, s, low);
    s[q->w] = value.high;
    low[q->w / stride] = value.low;
  }
}

/* Coefficient k of some rules in a run. */
static void series_at(const Series *t, const List *list, int k, int stride, const double *x, double *s) {
  series_inputs(t, k, x, s);
  if (k) series_rules(t, list, k, k, stride, s);
  else if (has_pairs(t->timed, t->size, stride, s)) series_pairs(t, list, stride, x, s);
  else series_values(t, list->rule, list->count, stride, s);
}
