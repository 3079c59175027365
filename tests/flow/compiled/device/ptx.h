/* What the instructions of PTX do (PTX ISA 9, chapter 9), for the text that ptx.py makes of them. */
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <type_traits>

/* Before each instruction, and at each label. */
#ifndef AT
#define AT(number, word)
#define LABEL(number) ;
#endif

struct Place { unsigned x, y, z; };
static thread_local Place threadIdx, blockIdx, blockDim, gridDim;
typedef unsigned char Byte;

template <class A> constexpr bool real = std::is_floating_point_v<A>;
template <class A> struct unsigned_of { typedef std::make_unsigned_t<A> type; };
template <> struct unsigned_of<double> { typedef uint64_t type; };
template <> struct unsigned_of<float> { typedef uint32_t type; };

/* A register read or written as another type: its bits where the sizes are the same, else cut or extended. */
template <class A, class B> static inline A as(B b) {
  if constexpr (std::is_same_v<A, B>) return b;
  else if constexpr (sizeof(A) == sizeof(B) && (real<A> || real<B>)) { A a; memcpy(&a, &b, sizeof a); return a; }
  else return (A)b;
}
template <class D, class A> static inline void put(D &d, A a) { d = as<D>(a); }
template <class A> static inline A load(const Byte *at) { A a; memcpy(&a, at, sizeof a); return a; }
template <class A> static inline void save(Byte *at, A a) { memcpy(at, &a, sizeof a); }

/* Integers wrap around. */
#define WRAPS(name, op) \
  template <class A> static inline A name(A a, A b) { \
    if constexpr (real<A>) return a op b; \
    else { typedef typename unsigned_of<A>::type U; return (A)((U)a op (U)b); } \
  }
WRAPS(add_, +) WRAPS(sub_, -) WRAPS(mul_, *)
template <class A> static inline A div_(A a, A b) { return real<A> || b ? a / b : (A)-1; }
template <class A> static inline A rem_(A a, A b) { return b ? a % b : a; }
template <class A> static inline A neg_(A a) { if constexpr (real<A>) return -a; else return sub_((A)0, a); }
template <class A> static inline A abs_(A a) { if constexpr (real<A>) return (A)fabs((double)a); else return a < 0 ? neg_(a) : a; }
/* NaN gives way to a number. */
template <class A> static inline A min_(A a, A b) { return a != a ? b : b != b ? a : a < b ? a : b; }
template <class A> static inline A max_(A a, A b) { return a != a ? b : b != b ? a : a > b ? a : b; }
template <class A> static inline A fma_(A a, A b, A c) { return sizeof(A) == 8 ? (A)__builtin_fma(a, b, c) : (A)__builtin_fmaf(a, b, c); }
template <class A> static inline A mad_(A a, A b, A c) { return add_(mul_(a, b), c); }
template <class A> static inline A sqrt_(A a) { return (A)(sizeof(A) == 8 ? sqrt(a) : sqrtf(a)); }
template <class A> static inline A rcp_(A a) { return 1 / a; }
/* copysign d, a, b: the sign of a on the size of b. */
template <class A> static inline A copysign_(A a, A b) { return (A)copysign((double)b, (double)a); }

/* Gross approximations: the lower half of the bits is zero. */
static inline double upper(double a) { uint64_t b = as<uint64_t>(a) & 0xffffffff00000000ULL; return as<double>(b); }
static inline double rcp_approx(double a) { return upper(1 / upper(a)); }
static inline double rsqrt_approx(double a) { return upper(1 / sqrt(upper(a))); }
static inline float rcp_approx(float a) { return 1 / a; }
static inline float rsqrt_approx(float a) { return 1 / sqrtf(a); }
static inline float ex2_approx(float a) { return exp2f(a); }
static inline float lg2_approx(float a) { return log2f(a); }

/* The upper half of a product, and a product of twice the width. */
template <class A> static inline A mul_hi(A a, A b) {
  if constexpr (sizeof(A) == 8) {
    typedef std::conditional_t<std::is_signed_v<A>, __int128, unsigned __int128> Wide;
    return (A)((Wide)a * (Wide)b >> 64);
  } else {
    typedef std::conditional_t<std::is_signed_v<A>, int64_t, uint64_t> Wide;
    return (A)((Wide)a * (Wide)b >> (8 * sizeof(A)));
  }
}
template <class A> static inline auto mul_wide(A a, A b) {
  typedef std::conditional_t<sizeof(A) == 4, std::conditional_t<std::is_signed_v<A>, int64_t, uint64_t>,
                             std::conditional_t<std::is_signed_v<A>, int32_t, uint32_t>> Wide;
  return (Wide)((Wide)a * (Wide)b);
}

/* With the carry of the instruction before, and for the next one. */
template <class A> static inline A carried(A a, A b, int with, unsigned &cc, int keeps) {
  typedef typename unsigned_of<A>::type U;
  unsigned __int128 s = (unsigned __int128)(U)a + (U)b + (with ? cc : 0);
  if (keeps) cc = (unsigned)(s >> (8 * sizeof(A))) & 1;
  return (A)(U)s;
}
template <class A> static inline A borrowed(A a, A b, int with, unsigned &cc, int keeps) {
  typedef typename unsigned_of<A>::type U;
  unsigned __int128 s = (unsigned __int128)(U)a - (U)b - (with ? cc : 0);
  if (keeps) cc = (unsigned)(s >> (8 * sizeof(A))) & 1;
  return (A)(U)s;
}

/* Bits. Shifts by more than there are bits shift all out. */
template <class A> static inline A and_(A a, A b) { return (A)(a & b); }
template <class A> static inline A or_(A a, A b) { return (A)(a | b); }
template <class A> static inline A xor_(A a, A b) { return (A)(a ^ b); }
template <class A> static inline A not_(A a) { if constexpr (std::is_same_v<A, bool>) return !a; else return (A)~a; }
template <class A> static inline A shl_(A a, uint32_t n) { return n >= 8 * sizeof(A) ? (A)0 : (A)((typename unsigned_of<A>::type)a << n); }
template <class A> static inline A shr_(A a, uint32_t n) {
  const uint32_t most = 8 * sizeof(A) - 1;
  if (n > most) { if (!std::is_signed_v<A>) return 0; n = most; }
  return (A)(a >> n);
}
template <class A> static inline uint32_t clz_(A a) { return a ? (uint32_t)__builtin_clzll((uint64_t)a) - (64 - 8 * sizeof(A)) : 8 * sizeof(A); }
template <class A> static inline uint32_t popc_(A a) { return (uint32_t)__builtin_popcountll((uint64_t)a); }
static inline uint32_t shf_l_wrap(uint32_t a, uint32_t b, uint32_t n) { n &= 31; return n ? b << n | a >> (32 - n) : b; }
static inline uint32_t shf_r_wrap(uint32_t a, uint32_t b, uint32_t n) { n &= 31; return n ? b << (32 - n) | a >> n : a; }

/* Comparisons: of numbers, false with a NaN; with ``u`` true then. */
#define COMPARED(name, op) \
  template <class A> static inline bool name(A a, A b) { return a == a && b == b && a op b; } \
  template <class A> static inline bool name##u(A a, A b) { return a != a || b != b || a op b; }
COMPARED(is_eq, ==) COMPARED(is_ne, !=) COMPARED(is_lt, <) COMPARED(is_le, <=) COMPARED(is_gt, >) COMPARED(is_ge, >=)
template <class A> static inline bool is_num(A a, A b) { return a == a && b == b; }
template <class A> static inline bool is_nan(A a, A b) { return a != a || b != b; }

/* Conversions: out of range to the nearest, NaN to 0. */
template <class D, class A> static inline D cvt(A a, char rounding) {
  if constexpr (real<A>) {
    double v = rounding == 'z' ? trunc((double)a) : rounding == 'i' ? rint((double)a) : rounding == 'm' ? floor((double)a)
               : rounding == 'p' ? ceil((double)a) : (double)a;
    if constexpr (real<D>) return (D)v;
    else {
      const double low = std::is_signed_v<D> ? -ldexp(1, 8 * sizeof(D) - 1) : 0;
      const double high = ldexp(1, 8 * sizeof(D) - std::is_signed_v<D>);
      if (v != v) return 0;
      if (v >= high) return std::is_signed_v<D> ? (D)((typename unsigned_of<D>::type)-1 >> 1) : (D)-1;
      return v < low ? (D)low : (D)v;
    }
  } else return (D)a;
}

template <class A> static inline A atom_add(Byte *at, A a) { A was = load<A>(at); save(at, add_(was, a)); return was; }
template <class A> static inline A atom_cas(Byte *at, A old, A a) { A was = load<A>(at); if (was == old) save(at, a); return was; }
