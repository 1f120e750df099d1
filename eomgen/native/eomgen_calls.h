/* What processors can do: operations that may be contracted, and what instructions there are. How the public functions of
   a model are made: of straight-line functions, or by the solvers, each with a check of its result; and a step in real
   time. */
#ifndef EOMGEN_CALLS_H
#define EOMGEN_CALLS_H

#include "eomgen.h"

/* EOMGEN_CONTRACT: of a file whose operations may be contracted, which includes this first: the compiler forms fused
   operations, whatever its flags say of other files. EOMGEN_CONTRACTS: it does, where the processor has them; gcc forms
   none without this optimization. */
#if defined(EOMGEN_CONTRACT) && defined(__clang__)
#pragma STDC FP_CONTRACT ON
#pragma clang fp contract(fast)
#define EOMGEN_CONTRACTS
#elif defined(EOMGEN_CONTRACT) && defined(__GNUC__) && defined(__OPTIMIZE__)
#pragma GCC optimize("O2", "fp-contract=fast")
#define EOMGEN_CONTRACTS
#endif

#if defined(__x86_64__) && defined(EOMGEN_ASKS_PROCESSOR)
#include <cpuid.h>

/* EOMGEN_ASKS_PROCESSOR: what instructions this x86-64 processor, and the system for its registers, has; the compilers' own
   test for that is not in every runtime library. */
enum { EOMGEN_AVX2 = 1 /* and FMA */, EOMGEN_AVX512 = 2 /* with its extensions DQ and VL */ };

static inline int eomgen_processor(void)
{
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & (1u << 27 | 1u << 12)) != (1u << 27 | 1u << 12)) {
        return 0;
    }
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 0x06u) != 0x06u || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & 1u << 5)) {
        return 0;
    }
    const unsigned wanted = 1u << 16 | 1u << 17 | 1u << 31;
    return (low & 0xe6u) == 0xe6u && (b & wanted) == wanted ? EOMGEN_AVX2 | EOMGEN_AVX512 : EOMGEN_AVX2;
}

#endif

/* NAME, whose result of LENGTH numbers BLOCK writes, or a SOLVER. */
#define EOMGEN_PUBLIC(NAME, AT, STATUS, LENGTH) \
    int NAME(double t, const double *restrict x, const double *restrict u, const double *restrict c, \
        double *restrict out, double *restrict w) \
    { \
        if (out == NULL) { \
            return EOMGEN_SUCCESS; \
        } \
        AT const int status = STATUS; \
        return status != 0 ? status : LENGTH > 256 ? check_rows(out, LENGTH) : check_finite(out, LENGTH); \
    }
#define EOMGEN_FUNCTION(NAME, BLOCK, LENGTH) EOMGEN_PUBLIC(NAME, , BLOCK(t, x, u, c, out, w), LENGTH)
#define EOMGEN_AT const eom_at at = { MODEL, t, u, c, w };
#define EOMGEN_SOLVED(NAME, SOLVER, LENGTH) EOMGEN_PUBLIC(NAME, EOMGEN_AT, SOLVER(&at, x, out), LENGTH)

/* 1 if an entry of the result is NaN or infinite; four sums, because each addition waits for the one before. */
EOMGEN_SHARED int check_finite(const double *out, int length)
{
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= length; i += 4) {
        sum[0] += out[i] * 0.0;
        sum[1] += out[i + 1] * 0.0;
        sum[2] += out[i + 2] * 0.0;
        sum[3] += out[i + 3] * 0.0;
    }
    for (; i < length; i++) {
        sum[0] += out[i] * 0.0;
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]) == 0.0 ? EOMGEN_SUCCESS : EOMGEN_NON_FINITE;
}

#ifdef EOMGEN_LONG_RESULTS
/* The same of a long result. */
EOMGEN_ROWS static int check_rows(const double *out, int length)
{
    double sum[8] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 8 <= length; i += 8) {
        for (int k = 0; k < 8; k++) {
            sum[k] += out[i + k] * 0.0;
        }
    }
    for (int k = 1; k < 8; k++) {
        sum[0] += sum[k];
    }
    return sum[0] == 0.0 ? check_finite(out + i, length - i) : EOMGEN_NON_FINITE;
}
#else
#define check_rows check_finite
#endif

/* One classical Runge-Kutta step of size h from x at time t into out, which may be x: for real time, where each step must
   cost the same. k: 5 n doubles of work. Nothing is allocated; the status of the first evaluation that fails. */
EOMGEN_SHARED int step_by_rk4(eomgen_function rhs, int n, double t, double h, const double *x, const double *u,
    const double *c, double *out, double *w, double *k)
{
    static const double at[4] = {0.0, 0.5, 0.5, 1.0};
    double *const y = k + 4 * n;
    for (int s = 0; s < 4; s++) {
        const double *const last = k + (s > 0 ? s - 1 : 0) * n;
        for (int i = 0; i < n; i++) {
            y[i] = s > 0 ? x[i] + at[s] * h * last[i] : x[i];
        }
        const int status = rhs(t + at[s] * h, y, u, c, k + s * n, w);
        if (status != 0) {
            return status;
        }
    }
    for (int i = 0; i < n; i++) {
        out[i] = x[i] + h / 6.0 * (k[i] + 2.0 * (k[n + i] + k[2 * n + i]) + k[3 * n + i]);
    }
    return 0;
}

#endif
