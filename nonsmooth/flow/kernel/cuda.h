/* Declarations that NVRTC has no headers for, and C names missing in C++. */
#define ON_DEVICE 1
#define restrict __restrict__
#define LONGEST_SEARCH 64 /* entries of a hash table that are tried */
#ifdef __CUDACC_RTC__
typedef signed char int8_t;
typedef int int32_t;
typedef unsigned uint32_t;
typedef long long int64_t;
typedef unsigned long long uint64_t;
#define INFINITY (__longlong_as_double(0x7ff0000000000000LL))
#define NAN (__longlong_as_double(0x7ff8000000000000LL))
#define INT64_MIN (-0x7fffffffffffffffLL - 1)
#define KERNEL extern "C" __global__ void
#define BOUNDS __launch_bounds__(THREADS, RESIDENT)
/* Whether the condition is true in a thread of the warp; synchronises the warp, which else would diverge. */
#define ANY_OF_GROUP(one) __any_sync(0xffffffffu, one)
#define INLINE_MEMBER
#define UNROLL _Pragma("unroll")
static inline int64_t bits_of(double a) { return __double_as_longlong(a); }
static inline double of_bits(int64_t a) { return __longlong_as_double(a); }
/* Each operation is rounded, so that random numbers have the same bits everywhere. */
static inline double sum(double a, double b) { return __dadd_rn(a, b); }
static inline double product(double a, double b) { return __dmul_rn(a, b); }
#else
#include <math.h>
#include <stdint.h>
#include <string.h>
#define KERNEL extern "C" void
#define BOUNDS
#define ANY_OF_GROUP(one) (one)
#define INLINE_MEMBER inline
#define UNROLL
struct Place { int x; };
static thread_local Place threadIdx, blockIdx, blockDim, gridDim;
static inline int64_t bits_of(double a) { int64_t b; memcpy(&b, &a, 8); return b; }
static inline double of_bits(int64_t a) { double b; memcpy(&b, &a, 8); return b; }
static __attribute__((noinline)) double sum(double a, double b) { return a + b; }
static __attribute__((noinline)) double product(double a, double b) { return a * b; }
static inline unsigned long long atomicAdd(unsigned long long *at, unsigned long long a) { unsigned long long b = *at; *at += a; return b; }
static inline unsigned long long atomicCAS(unsigned long long *at, unsigned long long old, unsigned long long a) {
  unsigned long long b = *at;
  if (b == old) *at = a;
  return b;
}
#endif
