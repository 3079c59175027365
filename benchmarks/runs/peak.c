/* Peak rate of one core: independent chains of multiply-adds, in the widest vectors and in scalars.
   Prints Gflop/s of both (the best of several turns, in processor time) and the number of lanes. */
#include <stdio.h>
#include <time.h>

#if defined(__AVX512F__)
#define LANES 8
#define REGISTER "v"
#elif defined(__AVX__)
#define LANES 4
#define REGISTER "x"
#else
#define LANES 2
#if defined(__aarch64__)
#define REGISTER "w"
#else
#define REGISTER "x"
#endif
#endif
#define CHAINS 12

typedef double vector __attribute__((vector_size(8 * LANES)));

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* Named variables, since the compilers keep an array in memory. */
#define EACH(f) f(0) f(1) f(2) f(3) f(4) f(5) f(6) f(7) f(8) f(9) f(10) f(11)
#define DECLARE(i) real a##i = zero + i;
#define STEP(i) a##i = a##i * m + c; __asm__ volatile("" : "+" REGISTER(a##i));
#define RATE(name, type, start, lanes)                                       \
    static double name(long n) {                                             \
        typedef type real;                                                   \
        const real zero = start, m = zero + 0.999999999, c = zero + 1e-9;    \
        EACH(DECLARE)                                                        \
        double begin = now();                                                \
        for (long k = 0; k < n; k++) { EACH(STEP) }                          \
        return n * 2.0 * CHAINS * (lanes) / (now() - begin);                 \
    }

RATE(vector_rate, vector, {0}, LANES)
RATE(scalar_rate, double, 0.0, 1)

int main(void) {
    double vectors = 0, scalars = 0;
    for (int turn = 0; turn < 10; turn++) {
        double v = vector_rate(5000000), s = scalar_rate(5000000);
        vectors = v > vectors ? v : vectors;
        scalars = s > scalars ? s : scalars;
    }
    printf("%.3f %.3f %d\n", vectors / 1e9, scalars / 1e9, LANES);
    return 0;
}
