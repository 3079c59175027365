/* One lane per thread: the types and operations of vector.h, for the same sources. A mask is all ones or zeros.
 *
 * CUDA C++ for NVRTC, or C++ for any compiler, with which tests run blocks and threads one by one.
 * All arithmetic is that of vector.h without AVX-512, operation by operation.
 */
#define W 1
#define LAST_KIND (SIMPLE_KINDS - 1) /* the end of a run; events of the kinds before it are counted */
#define INLINE static inline
#define FUNCTION static inline void
#define OUTLINED static inline

struct T;
struct I {
  int64_t v;
  I() = default;
  constexpr I(bool a) : v(a) {}
  constexpr I(int a) : v(a) {}
  constexpr I(unsigned a) : v(a) {}
  constexpr I(long a) : v(a) {}
  constexpr I(long long a) : v(a) {}
  INLINE_MEMBER explicit I(T a);
};
struct T {
  double v;
  T() = default;
  constexpr T(double a) : v(a) {}
  INLINE_MEMBER explicit T(I a);
};
#define BC(a) T((double)(a))
#define NONE I(0)
#define LANE(a, l) ((a).v)
#define LANE_I(a, l) ((a).v)
#define OWN(type, name, size) const type *name
#define RARE_CASES_HERE 0

#define BOTH(op) static inline I operator op(I a, I b) { return I((int64_t)((uint64_t)a.v op (uint64_t)b.v)); }
BOTH(+) BOTH(-) BOTH(&) BOTH(|) BOTH(^)
#define COMPARED(type, op) static inline I operator op(type a, type b) { return I(-(int64_t)(a.v op b.v)); }
COMPARED(I, ==) COMPARED(I, !=) COMPARED(I, <) COMPARED(I, >) COMPARED(I, <=) COMPARED(I, >=)
COMPARED(T, ==) COMPARED(T, !=) COMPARED(T, <) COMPARED(T, >) COMPARED(T, <=) COMPARED(T, >=)
static inline I operator~(I a) { return I(~a.v); }
static inline I operator<<(I a, int n) { return I((int64_t)((uint64_t)a.v << n)); }
static inline I operator>>(I a, int n) { return I(a.v >> n); }
static inline T operator+(T a, T b) { return T(a.v + b.v); }
static inline T operator-(T a, T b) { return T(a.v - b.v); }
static inline T operator*(T a, T b) { return T(a.v * b.v); }
static inline T operator/(T a, T b) { return T(a.v / b.v); }
static inline T operator-(T a) { return T(-a.v); }
#define ASSIGNED(type, op) static inline type &operator op##=(type &a, type b) { a = a op b; return a; }
ASSIGNED(I, +) ASSIGNED(I, -) ASSIGNED(I, &) ASSIGNED(I, |) ASSIGNED(I, ^)
ASSIGNED(T, +) ASSIGNED(T, -) ASSIGNED(T, *)

inline I::I(T a) : v(bits_of(a.v)) {}
inline T::T(I a) : v(of_bits(a.v)) {}
static inline T SELECT(I m, T a, T b) { return m.v ? a : b; }
static inline int any(I m) { return m.v != 0; }
#define EACH(l, mask) (unsigned left_ = any(mask), l = 0; left_; left_ = 0)

#define LANEWISE(NAME, f) static inline T NAME(T a) { return T(f(a.v)); }
#define LANEWISE2(NAME, f) static inline T NAME(T a, T b) { return T(f(a.v, b.v)); }
LANEWISE(SQRT_, sqrt) LANEWISE(ABS, fabs)
static inline T MIN(T a, T b) { return a.v < b.v ? a : b; }
static inline T MAX(T a, T b) { return a.v > b.v ? a : b; }

static inline T NUMBERS(I a) { return T((double)a.v); }
/* The caller handles steps that are not finite; their conversion only must be defined. */
static inline I WHOLE(T a) { return I(fabs(a.v) < 1e15 ? (int64_t)a.v : 0); }
