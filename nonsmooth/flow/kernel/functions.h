/* Functions of W numbers at once: those of libm lane by lane, rough ones for a step size, sine and cosine. */
LANEWISE(EXP_, exp) LANEWISE(LOG_, log) LANEWISE(TAN_, tan) LANEWISE(ASIN_, asin) LANEWISE(ACOS_, acos)
LANEWISE(ATAN_, atan) LANEWISE(SINH_, sinh) LANEWISE(COSH_, cosh) LANEWISE(TANH_, tanh)
LANEWISE(ASINH_, asinh) LANEWISE(ACOSH_, acosh) LANEWISE(ATANH_, atanh) LANEWISE(ERF_, erf)
LANEWISE(ERFINV_, ns_erfinv) LANEWISE(EXPM1_, expm1) LANEWISE(LOG1P_, log1p)
LANEWISE2(POW_, pow) LANEWISE2(ATAN2_, atan2) LANEWISE2(HYPOT_, hypot)

/* Binary logarithm and exponential to 1e-4, reciprocal to 1e-3: enough for a step size, a hundredth
 * of libm's cost. */
INLINE T LOG2(T a) {
  I b = (I)a;
  T m = (T)((b & 0xfffffffffffffLL) | 0x3ff0000000000000LL) - 1.5, z = m * m;
  T high = (0.1424883991 * m - 0.3205988980) + z * ((0.0379969064 * m - 0.0712441996) - 0.0211093925 * z);
  return (NUMBERS((b >> 52) - 1023) + (0.5849625007 + 0.9617966939 * m)) + z * high;
}
INLINE T EXP2(T a) {
  T k = (a + 6755399441055744.0) - 6755399441055744.0, f = (a - k) * 0.6931471805599453;
  T z = f * f, y = (1.0 + f) + z * ((0.5 + 0.16666666666 * f) + z * (0.0416666666 + 0.0083333333 * f));
  return y * (T)((WHOLE(k) + 1023) << 52);
}
#ifndef INVERSES_HERE /* by instructions of the processor */
INLINE T ROUGH_INVERSE(T a) {
  T y = (T)(0x7fde6238da3c2118LL - (I)a);
  y = y * (2.0 - a * y);
  return y * (2.0 - a * y);
}
INLINE T QUICK_INVERSE(T a) { return 1.0 / a; }
INLINE T INVERSE(T a) { return 1.0 / a; }
INLINE T QUICK_ROOT(T a) { return SQRT_(a); }
#endif

/* Sine and cosine of W numbers at once, to less than 1 ulp: the reduction and the polynomials of fdlibm (Sun
 * Microsystems 1993), without branches. */
#define LARGEST_ANGLE 1e6 /* below, a multiple of half of pi has few enough digits that its products are exact */

/* The angle less the nearest multiple of pi/2, as a sum of two numbers; the multiple. */
INLINE I reduced(T a, T *high, T *low) {
  const double parts[] = {1.57079632673412561417e+00, 6.07710050630396597660e-11, 2.02226624879595063154e-21};
  T shifted = a * 6.36619772367581382433e-01 + 6755399441055744.0, k = shifted - 6755399441055744.0;
  T first = a - k * parts[0], product = k * parts[1], rest = first - product;
  T tail = k * parts[2] - ((first - rest) - product);
  *high = rest - tail;
  *low = (rest - *high) - tail;
  return (I)shifted;
}

INLINE T sine_near(T x, T y) {
  T z = x * x, v = z * x;
  T r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06
        + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
  return x - ((z * (0.5 * y - v * r) - y) + v * 1.66666666666666324348e-01);
}

INLINE T cosine_near(T x, T y) {
  T z = x * x, half = 0.5 * z, w = 1.0 - half;
  T r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05
        + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
  return w + (((1.0 - w) - half) + (z * r - x * y));
}

/* sin(a + quarters pi/2). */
INLINE T sine_of(T a, int quarters) {
  T x, y;
  I n = reduced(a, &x, &y) + quarters, odd = ~((n & 1) - 1), negative = (n & 2) << 62;
  return (T)((I)SELECT(odd, cosine_near(x, y), sine_near(x, y)) ^ negative);
}

OUTLINED T SIN_(T a) {
  T found = sine_of(a, 0);
  for EACH(l, ~(I)(ABS(a) < LARGEST_ANGLE)) LANE(found, l) = sin(LANE(a, l));
  return found;
}
OUTLINED T COS_(T a) {
  T found = sine_of(a, 1);
  for EACH(l, ~(I)(ABS(a) < LARGEST_ANGLE)) LANE(found, l) = cos(LANE(a, l));
  return found;
}
