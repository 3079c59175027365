/* Sine and cosine of W numbers at once, to less than 1 ulp: the reduction and the polynomials of fdlibm (Sun
 * Microsystems 1993), for all lanes alike. */
#define LARGEST_ANGLE 1e6 /* below, a multiple of half of pi has few enough digits that its products are exact */

/* The angle less the nearest multiple of half of pi, as a sum of two; the multiple. */
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

/* The sine of an angle and of so many quarters of a turn more. */
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
