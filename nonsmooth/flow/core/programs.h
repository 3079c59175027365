/* Programs as lists of instructions, and the interpreter that runs them: no system is compiled.
 *
 * The lists are written by nonsmooth/model/printing/tape.py; the operations and the Taylor rules have the
 * numbers of its enumerations. What does not move (constants, parameters) is computed once a run.
 */

/* Values of a graph: node j is op[j] of nodes a[j] and b[j]; inputs have a vector and a position there.
 * ``free`` suffice where nothing slides; ``paired`` are two numbers if the time is (pairs.h). */
typedef struct {
  int32_t size, still_count, moving_count, free_count, output_count, timed;
  const int32_t *op, *a, *b, *still, *moving, *free, *output, *paired;
  const double *constant;
} Values;

/* Power series by rules (nonsmooth/model/expressions/taylor_rules.py), order by order. Those of ``moving`` have a coefficient
 * zero, those of ``later`` further ones; ``late`` are those of them that unknown multipliers enter, which
 * follow from the equations of the same order. */
typedef struct {
  int32_t size, still_count, moving_count, later_count, late_count, output_count, timed, pad;
  const int32_t *rule, *a, *b, *c, *op, *still, *moving, *later, *late, *output, *paired;
  const double *first, *second;
} Series;

/* Not inlined: the same code whoever calls, which no compiler replaces by other arithmetic. */
OUTSIDE double operate(int op, double x, double y) {
  switch (op) {
    case OP_assign: return x;
    case OP_neg: return -x;
    case OP_twice: return x + x;
    case OP_sq: return x * x;
    case OP_inv: return 1.0 / x;
    case OP_sign: return x == x ? ns_sign(x) : NAN;
    case OP_fabs: return fabs(x);
    case OP_not: return !x;
    case OP_floor: return floor(x);
    case OP_ceil: return ceil(x);
    case OP_erfinv: return ns_erfinv(x);
    case OP_sqrt: return sqrt(x);
    case OP_exp: return exp(x);
    case OP_expm1: return expm1(x);
    case OP_log: return log(x);
    case OP_log1p: return log1p(x);
    case OP_sin: return sin(x);
    case OP_cos: return cos(x);
    case OP_tan: return tan(x);
    case OP_asin: return asin(x);
    case OP_acos: return acos(x);
    case OP_atan: return atan(x);
    case OP_sinh: return sinh(x);
    case OP_cosh: return cosh(x);
    case OP_tanh: return tanh(x);
    case OP_asinh: return asinh(x);
    case OP_acosh: return acosh(x);
    case OP_atanh: return atanh(x);
    case OP_erf: return erf(x);
    case OP_add: return x + y;
    case OP_sub: return x - y;
    case OP_mul: return x * y;
    case OP_div: return x / y;
    case OP_pow: case OP_constpow: return pow(x, y);
    case OP_atan2: return atan2(x, y);
    case OP_hypot: return hypot(x, y);
    case OP_fmin: return fmin(x, y);
    case OP_fmax: return fmax(x, y);
    case OP_fmod: return fmod(x, y);
    case OP_remainder: return remainder(x, y);
    case OP_copysign: return copysign(x, y);
    case OP_lt: return x < y;
    case OP_le: return x <= y;
    case OP_eq: return x == y;
    case OP_ne: return x != y;
    case OP_and: return x && y;
    case OP_or: return x || y;
    case OP_if_else_zero: return x ? y : 0;
  }
  return NAN;
}

/* Aligned: where its jumps lie makes a tenth of a run's time. */
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

/* Sums of u_i v_(k-i) and of i u_i v_(k-i), i from first to last, in four chains. */
static inline double convolve(const double *u, const double *v, int k, int first, int last) {
  int count = last - first + 1, i = 4;
  if (count <= 0) return 0;
  u += first;
  v += k - first;
  double a = u[0] * v[0], b, c, d;
  if (count == 1) return a;
  b = u[1] * v[-1];
  if (count == 2) return a + b;
  c = u[2] * v[-2];
  if (count == 3) return (a + b) + c;
  d = u[3] * v[-3];
  for (; i + 3 < count; i += 4) {
    a = MULADD(u[i], v[-i], a);
    b = MULADD(u[i + 1], v[-i - 1], b);
    c = MULADD(u[i + 2], v[-i - 2], c);
    d = MULADD(u[i + 3], v[-i - 3], d);
  }
  if (i < count) a = MULADD(u[i], v[-i], a);
  if (i + 1 < count) b = MULADD(u[i + 1], v[-i - 1], b);
  if (i + 2 < count) c = MULADD(u[i + 2], v[-i - 2], c);
  return (a + b) + (c + d);
}

/* Terms up to the last that is not zero. */
static inline int terms_of(const double *c, int count) {
  while (count && c[count - 1] == 0) count--;
  return count;
}

/* Coefficient k of a product of series of which so many terms are not zero. */
static inline double product_of(const double *u, int u_terms, const double *v, int v_terms, int k) {
  int first = k < v_terms ? 0 : k + 1 - v_terms, last = u_terms <= k ? u_terms - 1 : k;
  if (first < last) return convolve(u, v, k, first, last);
  return first == last ? u[first] * v[k - first] : 0;
}
static inline double weigh(const double *u, const double *v, int k, int first, int last) {
  int count = last - first + 1, i = 4;
  if (count <= 0) return 0;
  double x = first;
  u += first;
  v += k - first;
  double a = x * u[0] * v[0], b, c, d;
  if (count == 1) return a;
  b = (x + 1) * u[1] * v[-1];
  if (count == 2) return a + b;
  c = (x + 2) * u[2] * v[-2];
  if (count == 3) return (a + b) + c;
  d = (x + 3) * u[3] * v[-3];
  for (; i + 3 < count; i += 4) {
    a = MULADD((x + i) * u[i], v[-i], a);
    b = MULADD((x + i + 1) * u[i + 1], v[-i - 1], b);
    c = MULADD((x + i + 2) * u[i + 2], v[-i - 2], c);
    d = MULADD((x + i + 3) * u[i + 3], v[-i - 3], d);
  }
  if (i < count) a = MULADD((x + i) * u[i], v[-i], a);
  if (i + 1 < count) b = MULADD((x + i + 1) * u[i + 1], v[-i - 1], b);
  if (i + 2 < count) c = MULADD((x + i + 2) * u[i + 2], v[-i - 2], c);
  return (a + b) + (c + d);
}

/* A coefficient that is zero stays so, whatever it is divided by: a square root of zero at rest. */
static inline double over(double a, double b) { return a == 0 ? 0 : a * (1.0 / b); }

/* The same with the reciprocal of b. */
static inline double divided(double a, double reciprocal) { return a == 0 ? 0 : a * reciprocal; }

/* The value of a quotient: 0/0 is none, though all further coefficients that are zero stay so. */
static inline double ratio(double a, double b) { return a == 0 && b == 0 ? NAN : over(a, b); }

/* A later coefficient of a quotient: nothing is left of one that is no number because the divisor's overflow,
 * as in 1/(1 + exp(1000)). */
static inline double settled(double coefficient, double value, double divisor) {
  return isfinite(coefficient) || !(fabs(value) < TINY_VALUE && fabs(divisor) > HUGE_DIVISOR) ? coefficient : 0;
}

/* Of a power of what is zero: t^(i exponent) where t^i is the first term of ``u``, without further derivatives. */
static double power_at_zero(const double *u, double exponent, int k) {
  int i = 1;
  while (i <= k && u[i] == 0) i++;
  return i > k || k < i * exponent ? 0 : INFINITY;
}

static double power_coefficient(const double *u, const double *w, double exponent, int k) {
  if (u[0] == 0) return power_at_zero(u, exponent, k);
  double sum = exponent * k * (u[k] * w[0]);
  for (int j = 1; j < k; j++) sum = MULADD(exponent * (k - j) - j, u[k - j] * w[j], sum);
  return settled(over(sum, u[0]) * (1.0 / k), w[0], u[0]);
}

/* Coefficient k of some rules; coefficient i of rule j is s[j * stride + i], of input x[i] x[k]. */
static void series_rules(const Series *t, const int32_t *which, int32_t count, int k, int stride, const double *x,
                         double *s) {
  for (int32_t l = 0; l < count; l++) {
    int32_t j = which[l];
    const double *u = s + (int64_t)t->a[j] * stride, *v = s + (int64_t)t->b[j] * stride;
    double *w = s + (int64_t)j * stride;
    switch (t->rule[j]) {
      case RULE_input: w[k] = x[t->b[j]]; break;
      case RULE_add: w[k] = u[k] + v[k]; break;
      case RULE_shift: w[k] = k ? u[k] : u[0] + v[0]; break;
      case RULE_sub: w[k] = u[k] - v[k]; break;
      case RULE_lower: w[k] = k ? u[k] : u[0] - v[0]; break;
      case RULE_below: w[k] = k ? -v[k] : u[0] - v[0]; break;
      case RULE_neg: w[k] = -u[k]; break;
      case RULE_twice: w[k] = u[k] + u[k]; break;
      case RULE_scale: w[k] = u[k] * v[0]; break;
      case RULE_over: w[k] = k ? over(u[k], v[0]) : ratio(u[0], v[0]); break;
      case RULE_mul: w[k] = convolve(u, v, k, 0, k); break;
      case RULE_sq: {
        double half = 2 * convolve(u, u, k, 0, (k + 1) / 2 - 1);
        w[k] = k % 2 ? half : k ? MULADD(u[k / 2], u[k / 2], half) : u[0] * u[0];
        break;
      }
      case RULE_div:
        w[k] = k ? settled(over(u[k] - convolve(w, v, k, 0, k - 1), v[0]), w[0], v[0]) : ratio(u[0], v[0]);
        break;
      case RULE_under:
        w[k] = k ? settled(over(-convolve(w, v, k, 0, k - 1), v[0]), w[0], v[0]) : ratio(u[0], v[0]);
        break;
      case RULE_sqrt: w[k] = k ? over(0.5 * (u[k] - convolve(w, w, k, 1, k - 1)), w[0]) : sqrt(u[0]); break;
      case RULE_power: w[k] = k ? power_coefficient(u, w, v[0], k) : operate(OP_pow, u[0], v[0]); break;
      case RULE_affine: w[k] = k ? t->second[j] * u[k] : MULADD(t->second[j], u[0], t->first[j]); break;
      case RULE_integral:
        w[k] = k ? t->first[j] / k * weigh(u, v, k, 1, k) : operate(t->op[j], u[0], 0);
        break;
      case RULE_turn:
        w[k] = k ? t->first[j] / k * (u[1] * v[k - 1]) : operate(t->op[j], u[0], 0);
        break;
      case RULE_quotient:
        w[k] = k ? over(t->first[j] * k * u[k] - weigh(w, v, k, 1, k - 1), v[0]) * (1.0 / k)
                 : operate(t->op[j], u[0], 0);
        break;
      case RULE_atan2: {
        const double *r = s + (int64_t)t->c[j] * stride;
        if (k == 0) { w[0] = operate(OP_atan2, u[0], v[0]); break; }
        double top = weigh(u, v, k, 1, k) - weigh(v, u, k, 1, k) - weigh(w, r, k, 1, k - 1);
        w[k] = over(top, r[0]) * (1.0 / k);
        break;
      }
      /* A term that the mode leaves out has a factor that is zero; its other factors are not evaluated. */
      case RULE_gated: w[k] = u[0] != 0 ? v[k] : 0; break;
      case RULE_chosen: {
        int i = 0;
        while (i < k && u[i] == 0) i++;
        w[k] = u[i] != 0 ? v[k] : 0;
        break;
      }
      default: w[k] = NAN;
    }
  }
}

/* Rounding of the values of some rules, in units of EPSILON, from that of their inputs, of the ``size`` that
 * these have at least: 0 for none. */
static void series_rounding(const Series *t, const int32_t *which, int32_t count, int stride, double size,
                            const double *s, double *error) {
  for (int32_t l = 0; l < count; l++) {
    int32_t j = which[l];
    double u = s[(int64_t)t->a[j] * stride], v = s[(int64_t)t->b[j] * stride], w = s[(int64_t)j * stride];
    double of_u = error[t->a[j]], of_v = error[t->b[j]], sum = 0;
    switch (t->rule[j]) {
      case RULE_input: error[j] = size > 0 ? size + fabs(w) : 0; continue;
      case RULE_add: case RULE_shift: case RULE_sub: case RULE_lower: case RULE_below: sum = of_u + of_v; break;
      case RULE_neg: error[j] = of_u; continue;
      case RULE_twice: error[j] = 2 * of_u; continue;
      case RULE_scale: case RULE_mul: sum = fabs(u) * of_v + fabs(v) * of_u; break;
      case RULE_over: case RULE_div: case RULE_under: sum = over(of_u + fabs(w) * of_v, fabs(v)); break;
      case RULE_sq: sum = 2 * fabs(u) * of_u; break;
      case RULE_sqrt: sum = over(0.5 * of_u, w); break;
      case RULE_power: sum = over(fabs(w * v) * of_u, fabs(u)); break;
      case RULE_affine: sum = fabs(t->second[j]) * of_u + fabs(t->first[j]); break;
      case RULE_integral: case RULE_turn: sum = fabs(t->first[j] * v) * of_u; break;
      case RULE_quotient: sum = over(fabs(t->first[j]) * of_u, fabs(v)); break;
      case RULE_atan2: sum = over(fabs(u) * of_v + fabs(v) * of_u, s[(int64_t)t->c[j] * stride]); break;
      case RULE_gated: case RULE_chosen: error[j] = of_v; continue;
    }
    error[j] = sum + fabs(w);
  }
}

/* What does not move: constants, parameters and operations of them; later coefficients stay zero. */
static void series_prepare(const Series *t, int stride, const double *p, double *s) {
  for (int32_t l = 0; l < t->still_count; l++) {
    int32_t j = t->still[l];
    double *w = s + (int64_t)j * stride, u = s[(int64_t)t->a[j] * stride], v = s[(int64_t)t->b[j] * stride];
    if (t->rule[j] == RULE_constant) w[0] = t->first[j];
    else if (t->rule[j] == RULE_input) w[0] = p[t->b[j]];
    else w[0] = operate(t->op[j], u, v);
  }
}
