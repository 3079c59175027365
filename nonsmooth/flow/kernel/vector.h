/* No code motion or automatic vectorisation: hoisted values fill registers, and vectors are written by hand. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("no-tree-pre", "no-gcse", "no-tree-vectorize")
#endif

/* W doubles at once with the vector extensions of GCC and Clang; masks are all ones or all zeros. */
typedef double T __attribute__((vector_size(8 * W)));
typedef int64_t I __attribute__((vector_size(8 * W)));

#define BC(v) ((T){0} + (double)(v))
#define NONE ((I){0})
#define LANE(v, l) (((double *)&(v))[l])
#define LANE_I(v, l) (((int64_t *)&(v))[l])
#define OWN(type, name, size) type name[size] /* a copy for each lane */
#define RARE_CASES_HERE 1
#define LAST_KIND (SIMPLE_KINDS - 1) /* the end of a run; events of the kinds before it are counted */
#define SELECT(m, a, b) ((T)(((I)(a) & (m)) | ((I)(b) & ~(m))))
#define INLINE static inline __attribute__((always_inline))
#define FUNCTION static __attribute__((noinline)) void
#define OUTLINED static __attribute__((noinline))
#define UNROLL _Pragma("GCC unroll 32")

#define LANEWISE(NAME, f) \
  static T NAME(T a) { for (int l = 0; l < W; l++) a[l] = f(a[l]); return a; }
#define LANEWISE2(NAME, f) \
  static T NAME(T a, T b) { for (int l = 0; l < W; l++) a[l] = f(a[l], b[l]); return a; }
#if defined(__AVX512F__) && W == 8 && !defined(__clang__)
static inline T SQRT_(T a) { return (T)__builtin_ia32_sqrtpd512_mask(a, a, -1, 4); }
#else
LANEWISE(SQRT_, sqrt)
#endif
INLINE T ABS(T a) { return (T)((I)a & 0x7fffffffffffffffLL); }
#if defined(__AVX512F__) && W == 8 && !defined(__clang__)
/* As below; GCC does not select the instruction. */
INLINE T MIN(T a, T b) { return (T)__builtin_ia32_minpd512_mask(a, b, BC(0), -1, 4); }
INLINE T MAX(T a, T b) { return (T)__builtin_ia32_maxpd512_mask(a, b, BC(0), -1, 4); }
#else
INLINE T MIN(T a, T b) { I m = a < b; return SELECT(m, a, b); }
INLINE T MAX(T a, T b) { I m = a > b; return SELECT(m, a, b); }
#endif
/* One bit for each lane of a mask. */
#if defined(__AVX512DQ__) && W == 8
typedef long long Bits __attribute__((vector_size(64)));
INLINE unsigned bits(I m) { return (unsigned char)__builtin_ia32_cvtq2mask512((Bits)m); }
#elif defined(__AVX__) && W == 4
INLINE unsigned bits(I m) { return (unsigned)__builtin_ia32_movmskpd256((T)m); }
#else
INLINE unsigned bits(I m) {
  unsigned r = 0;
  UNROLL for (int l = 0; l < W; l++) r |= (unsigned)(m[l] & 1) << l;
  return r;
}
#endif
INLINE int any(I m) { return bits(m) != 0; }
/* Loop over the lanes of a mask. */
#define EACH(l, mask) (unsigned left_ = bits(mask), l; left_ && (l = (unsigned)__builtin_ctz(left_), 1); left_ &= left_ - 1)

INLINE T NUMBERS(I a) { return __builtin_convertvector(a, T); }
INLINE I WHOLE(T a) { return __builtin_convertvector(a, I); }
#if defined(__AVX512F__) && W == 8 && !defined(__clang__)
#define INVERSES_HERE
INLINE T ROUGH_INVERSE(T a) { return (T)__builtin_ia32_rcp14pd512_mask(a, BC(0), -1); }
/* To some 1e-8, NaN at the ends of the range: for iterations that correct themselves. */
INLINE T QUICK_INVERSE(T a) {
  T y = ROUGH_INVERSE(a);
  return y * (2.0 - a * y);
}
/* To rounding, or NaN there. */
INLINE T INVERSE(T a) {
  T y = QUICK_INVERSE(a);
  return y * (2.0 - a * y);
}
INLINE T QUICK_ROOT(T a) {
  T y = (T)__builtin_ia32_rsqrt14pd512_mask(a, BC(0), -1), root = a * y;
  return root * (1.5 - 0.5 * (root * y));
}
#endif
