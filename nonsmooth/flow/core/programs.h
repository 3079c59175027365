/* Programs as lists of instructions, and the interpreter that runs them: no system is compiled.
 *
 * nonsmooth/model/printing/instructions.py writes the lists; operations and Taylor rules have the numbers of its
 * enumerations. Nodes of constants and parameters are computed once a run.
 */

/* Values of a graph: node j is op[j] of nodes a[j] and b[j]; inputs have a vector and an index.
 * ``free`` suffice without sliding; ``paired`` are two numbers if the time is (pairs.h). */
typedef struct {
  int32_t size, still_count, moving_count, free_count, output_count, timed;
  const int32_t *op, *a, *b, *still, *moving, *free, *output, *paired;
  const double *constant;
} Values;

/* A rule (nonsmooth/model/expressions/taylor_rules.py): kinds of its value and of later coefficients; offsets of its own row
 * and those of its arguments; the operation of its value; whether that is two numbers if the time is (pairs.h). A sum has
 * terms ``begin`` to ``end``, of which ``from`` to ``to`` have later coefficients: a factor times the product of rows a and
 * b, sorted by kind: constant, only a moves, both move, a square. */
typedef struct { int32_t rule, later, op, w, a, b, c, paired, begin, from, to, end; double first, second; } Rule;
typedef struct { double factor; int32_t a, b, kind, pad; } Term;
enum { AT_REST, LINEAR, PRODUCT, SQUARE };

/* Rules in order of evaluation. */
typedef struct { int32_t count, pad; const int32_t *rule; } List;

/* Power series by rules, order by order, with given moving inputs. ``still`` depend on parameters only; ``moving`` have a
 * coefficient zero, of which ``values`` suffice for the outputs, and ``later`` further ones. Unknown multipliers enter
 * ``late``, which follow from the equations of the same order, but not ``early``. Of ``later``, the field and the layer
 * follow from ``loop``, whose ``loop_late`` contain multipliers; ``before`` depend on the time alone, and ``after`` are
 * evaluated once all orders of these are known. */
typedef struct {
  int32_t size, terms, inputs, states, outputs, timed; /* states: inputs that are states, the first ones */
  const Rule *rule;
  const Term *term;
  const int32_t *input, *index, *output; /* rows of inputs, and their indices in the vector */
  List still, values, moving, later, late, early, loop, loop_late, before, after;
} Series;

/* Not inlined, so that the arithmetic is the same for all callers. The cases are written from model/numbering.py. */
OUTSIDE double operate(int op, double x, double y) {
  switch (op) {
    OPERATIONS_OF(x, y)
  }
  return NAN;
}

/* Aligned: the addresses of its jumps change a run's time by a tenth. */
static void values_nodes(const Values *t, const int32_t *which, int32_t count, const double *x, const double *p,
                         double *w) __attribute__((aligned(64)));
static void values_nodes(const Values *t, const int32_t *which, int32_t count, const double *x, const double *p,
                         double *w) {
  for (int32_t k = 0; k < count; k++) {
    int32_t j = which[k], a = t->a[j], b = t->b[j];
    switch (t->op[j]) { /* the frequent ones at once */
      case OP_const: w[j] = t->constant[j]; break;
      case OP_input: w[j] = a ? p[b] : x[b]; break;
      case OP_add: w[j] = w[a] + w[b]; break;
      case OP_sub: w[j] = w[a] - w[b]; break;
      case OP_mul: w[j] = w[a] * w[b]; break;
      case OP_neg: w[j] = -w[a]; break;
      default: w[j] = operate(t->op[j], w[a], w[b]);
    }
  }
}
static void values_prepare(const Values *t, const double *p, double *w) {
  values_nodes(t, t->still, t->still_count, p, p, w);
}
static void values_run(const Values *t, const double *x, const double *p, double *w) {
  values_nodes(t, t->moving, t->moving_count, x, p, w);
}
static void values_free(const Values *t, const double *x, const double *p, double *w) {
  values_nodes(t, t->free, t->free_count, x, p, w);
}

/* PART[k] is 1/k. */
#define FOUR(k) (double)1 / (k), (double)1 / ((k) + 1), (double)1 / ((k) + 2), (double)1 / ((k) + 3)
#define SIXTEEN(k) FOUR(k), FOUR((k) + 4), FOUR((k) + 8), FOUR((k) + 12)
static const double PART[] = {0, SIXTEEN(1), SIXTEEN(17), SIXTEEN(33)};
#undef FOUR
#undef SIXTEEN

/* Sum of u_i v_(k-i), i from first to last, in four chains; the ends, which are computed last, are added last. */
static inline double convolve(const double *u, const double *v, int k, int first, int last) {
  int count = last - first, i = 1;
  if (count < 0) return 0;
  u += first;
  v += k - first;
  double ends = u[0] * v[0], a = 0, b = 0, c = 0, d = 0;
  if (count == 0) return ends;
  ends += u[count] * v[-count];
  for (; i + 3 < count; i += 4) {
    a += u[i] * v[-i];
    b += u[i + 1] * v[-i - 1];
    c += u[i + 2] * v[-i - 2];
    d += u[i + 3] * v[-i - 3];
  }
  if (i < count) a += u[i] * v[-i];
  if (i + 1 < count) b += u[i + 1] * v[-i - 1];
  if (i + 2 < count) c += u[i + 2] * v[-i - 2];
  return ((a + b) + (c + d)) + ends;
}

/* Terms up to the last that is not zero. */
static inline int terms_of(const double *c, int count) {
  while (count && c[count - 1] == 0) count--;
  return count;
}

/* Coefficient k of a product of series with given numbers of nonzero terms. */
static inline double product_of(const double *u, int u_terms, const double *v, int v_terms, int k) {
  int first = k < v_terms ? 0 : k + 1 - v_terms, last = u_terms <= k ? u_terms - 1 : k;
  if (first < last) return convolve(u, v, k, first, last);
  return first == last ? u[first] * v[k - first] : 0;
}

/* Sums of i u_i v_(k-i) and of i u_i w_(k-i), i from 1 to ``last``, which is added last. */
static inline double weigh_both(const double *u, const double *v, const double *w, int k, int last, double *other) {
  double a = 0, b = 0, c = 0, d = 0, x = 1;
  if (last < 1) return *other = 0;
  for (int i = 1; i + 1 < last; i += 2, x += 2) {
    double one = x * u[i], two = (x + 1) * u[i + 1];
    a += one * v[k - i];
    b += two * v[k - i - 1];
    c += one * w[k - i];
    d += two * w[k - i - 1];
  }
  if (last % 2 == 0) {
    double one = (last - 1) * u[last - 1];
    a += one * v[k - last + 1];
    c += one * w[k - last + 1];
  }
  double end = last * u[last];
  *other = (c + d) + end * w[k - last];
  return (a + b) + end * v[k - last];
}
static inline double weigh(const double *u, const double *v, int k, int last) {
  double other;
  return weigh_both(u, v, v, k, last, &other);
}

/* a / b, and 0 where a = 0 for every b: as of a square root of zero at rest. */
static inline double over(double a, double b) { return a == 0 ? 0 : a * (1.0 / b); }

/* over(a, b) with the reciprocal of b. */
static inline double divided(double a, double reciprocal) { return a == 0 ? 0 : a * reciprocal; }

/* The value of a quotient: 0/0 is NaN. */
static inline double ratio(double a, double b) { return a == 0 && b == 0 ? NAN : over(a, b); }

/* A later coefficient of a quotient: 0 where it is NaN because the divisor overflows, as in 1/(1 + exp(1000)). */
static inline double settled(double coefficient, double value, double divisor) {
  return isfinite(coefficient) || !(fabs(value) < TINY_VALUE && fabs(divisor) > HUGE_DIVISOR) ? coefficient : 0;
}

/* Coefficient of a power of a series without constant term: t^(i exponent), where t^i is the first term of ``u``. */
static double power_at_zero(const double *u, double exponent, int k) {
  int i = 1;
  while (i <= k && u[i] == 0) i++;
  return i > k || k < i * exponent ? 0 : INFINITY;
}

static double power_coefficient(const double *u, const double *w, double exponent, int k) {
  if (u[0] == 0) return power_at_zero(u, exponent, k);
  double sum = exponent * k * (u[k] * w[0]);
  for (int j = 1; j < k; j++) sum = MULADD(exponent * (k - j) - j, u[k - j] * w[j], sum);
  return settled(over(sum, u[0]) * PART[k], w[0], u[0]);
}

/* The rows are followed by second numbers, the time of the start (pairs.h), and coefficients of terms. */
static size_t series_room(const Series *t, int stride) { return (size_t)t->size * (stride + 1) + 2 + t->terms; }
#define COEFFICIENTS(t, stride, s) ((s) + (int64_t)(t)->size * ((stride) + 1) + 2)

/* Coefficients of order zero. */
static void series_values(const Series *t, const int32_t *which, int32_t count, int stride, double *s) {
  double *coefficient = COEFFICIENTS(t, stride, s);
  for (int32_t l = 0; l < count; l++) {
    const Rule *q = t->rule + which[l];
    double w = 0;
    switch (q->rule) {
      case RULE_sum:
        for (int32_t i = q->begin; i < q->end; i++) {
          const Term *e = t->term + i;
          coefficient[i] = e->factor * s[e->b];
          w += coefficient[i] * s[e->a];
        }
        break;
      case RULE_div: w = ratio(s[q->a], s[q->b]); break;
      default: w = operate(q->op, s[q->a], s[q->b]);
    }
    s[q->w] = w;
  }
}

static inline double square_of(const double *u, int k) {
  double half = 2 * convolve(u, u, k, 0, (k + 1) / 2 - 1);
  return k % 2 ? half : MULADD(u[k / 2], u[k / 2], half);
}

/* Coefficients of orders from ``first``, above zero, to ``last``. */
static void series_rules(const Series *t, const List *list, int first, int last, int stride, double *s) {
  const double *coefficient = COEFFICIENTS(t, stride, s);
#define EACH for (int k = first; k <= last; k++)
#define TERM(i) (f[i] * s[e[i].a + k])
  for (int32_t l = 0; l < list->count; l++) {
    const Rule *q = t->rule + list->rule[l];
    const Term *e = t->term + q->from;
    const double *u = s + q->a, *v = s + q->b, *f = coefficient + q->from;
    double *w = s + q->w;
    switch (q->later) {
      case RULE_linear1: EACH w[k] = TERM(0); break;
      case RULE_linear2: EACH w[k] = TERM(0) + TERM(1); break;
      case RULE_linear3: EACH w[k] = TERM(0) + TERM(1) + TERM(2); break;
      case RULE_linear4: EACH w[k] = TERM(0) + TERM(1) + TERM(2) + TERM(3); break;
      case RULE_linear: EACH {
        double sum = TERM(0) + TERM(1) + TERM(2) + TERM(3);
        for (int32_t i = 4; i < q->to - q->from; i++) sum += TERM(i);
        w[k] = sum;
      } break;
      case RULE_sum: EACH {
        double sum = 0;
        for (int32_t i = 0; i < q->to - q->from; i++) {
          if (e[i].kind == LINEAR) sum += TERM(i);
          else if (e[i].kind == PRODUCT) sum += e[i].factor * convolve(s + e[i].a, s + e[i].b, k, 0, k);
          else if (e[i].kind == SQUARE) sum += e[i].factor * square_of(s + e[i].a, k);
        }
        w[k] = sum;
      } break;
      case RULE_over: EACH w[k] = over(u[k], v[0]); break;
      case RULE_div: EACH w[k] = settled(over(u[k] - convolve(w, v, k, 0, k - 1), v[0]), w[0], v[0]); break;
      case RULE_under: EACH w[k] = settled(over(-convolve(w, v, k, 0, k - 1), v[0]), w[0], v[0]); break;
      case RULE_sqrt: EACH w[k] = over(0.5 * (u[k] - convolve(w, w, k, 1, k - 1)), w[0]); break;
      case RULE_power: EACH w[k] = power_coefficient(u, w, v[0], k); break;
      case RULE_integral: EACH w[k] = q->first * PART[k] * weigh(u, v, k, k); break;
      case RULE_turn: EACH w[k] = q->first * PART[k] * (u[1] * v[k - 1]); break;
      case RULE_pair: EACH { /* row b is written too */
        double other, own = weigh_both(u, v, w, k, k, &other);
        w[k] = q->first * PART[k] * own;
        s[q->b + k] = q->second * PART[k] * other;
      } break;
      case RULE_turns: EACH {
        w[k] = q->first * PART[k] * (u[1] * v[k - 1]);
        s[q->b + k] = q->second * PART[k] * (u[1] * w[k - 1]);
      } break;
      case RULE_quotient: EACH w[k] = over(q->first * k * u[k] - weigh(w, v, k, k - 1), v[0]) * PART[k]; break;
      case RULE_atan2: EACH {
        const double *r = s + q->c;
        double top = weigh(u, v, k, k) - weigh(v, u, k, k) - weigh(w, r, k, k - 1);
        w[k] = over(top, r[0]) * PART[k];
      } break;
      /* A term without effect in the mode has a zero factor; its other factors are not evaluated. */
      case RULE_gated: EACH w[k] = u[0] != 0 ? v[k] : 0; break;
      case RULE_chosen: EACH {
        int i = 0;
        while (i < k && u[i] == 0) i++;
        w[k] = u[i] != 0 ? v[k] : 0;
      } break;
      default: EACH w[k] = NAN;
    }
  }
#undef EACH
#undef TERM
}

/* Coefficients k of the inputs. */
static void series_inputs(const Series *t, int k, const double *x, double *s) {
  for (int32_t l = 0; l < t->inputs; l++) s[t->input[l] + k] = x[t->index[l]];
}

/* Functions of an argument of two numbers (pairs.h). */
static int has_pair_rule(int op) { return op == OP_sin || op == OP_cos || op == OP_tan; }

/* Rounding of the values of all moving rules, in units of EPSILON, from that of their inputs of at least ``size``, or of the
 * input ``time`` alone; 0 for none. It is stored as the coefficient of order zero. In a run that begins at ``start``
 * arithmetic with the time has two numbers (pairs.h) and no rounding. */
static void series_rounding(const Series *t, double size, int32_t time, double time_size, double start, const double *s,
                            double *error) {
  for (int32_t l = 0; l < t->inputs; l++) {
    int is_time = t->index[l] == time;
    double value = s[t->input[l]] - (is_time ? start : 0);
    error[t->input[l]] = size > 0 ? (is_time ? time_size : size) + fabs(value) : 0;
  }
  for (int32_t l = 0; l < t->moving.count; l++) {
    const Rule *q = t->rule + t->moving.rule[l];
    double u = s[q->a], v = s[q->b], w = s[q->w], of_u = error[q->a], of_v = error[q->b], sum = 0, partial = 0;
    int is_pair = start != 0 && q->paired;
    if (is_pair && q->rule != RULE_div && !has_pair_rule(q->op)) of_u += fabs(u);
    switch (q->rule) {
      case RULE_sum:
        for (int32_t i = q->begin; i < q->end; i++) {
          const Term *e = t->term + i;
          double y = s[e->a], z = s[e->b], term = e->factor * z * y;
          sum += fabs(e->factor) * (fabs(y) * error[e->b] + fabs(z) * error[e->a]);
          if (is_pair) continue;
          if (e->b || !(e->factor == 1 || e->factor == -1)) sum += fabs(term); /* row 0 is one */
          partial += term;
          if (i > q->begin) sum += fabs(partial);
        }
        error[q->w] = sum;
        continue;
      case RULE_div: sum = over(of_u + fabs(w) * of_v, fabs(v)); break;
      case RULE_sqrt: sum = over(0.5 * of_u, w); break;
      case RULE_power: sum = over(fabs(w * v) * of_u, fabs(u)); break;
      case RULE_integral: sum = fabs(q->first * v) * of_u; break;
      case RULE_quotient: sum = over(fabs(q->first) * of_u, fabs(v)); break;
      case RULE_atan2: sum = over(fabs(u) * of_v + fabs(v) * of_u, s[q->c]); break;
      case RULE_chosen: error[q->w] = of_v; continue;
    }
    error[q->w] = sum + (is_pair && q->rule == RULE_div ? 0 : fabs(w));
  }
}

/* Evaluate constants, parameters and operations on them; their later coefficients stay zero. */
static void series_prepare(const Series *t, const double *p, double *s) {
  for (int32_t l = 0; l < t->still.count; l++) {
    const Rule *q = t->rule + t->still.rule[l];
    s[q->w] = q->rule == RULE_constant ? q->first : q->rule == RULE_input ? p[q->begin] : operate(q->op, s[q->a], s[q->b]);
  }
}
