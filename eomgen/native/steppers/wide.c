/* The methods' text on processors with AVX2: rows are gone through four states at a time, the last four again where n is no
   multiple. The bits are those of plain.c: no sum is taken in another order, and nothing is contracted. */
#include "eomgen_real.h"
#include "eomgen_steppers.h"

/* States from which on this pays: what a right-hand side has just written one by one is slow to read four at a time. */
enum { WIDE_FROM = 6 };

#if defined(EOMGEN_VECTORS) && defined(__x86_64__)
#define EOMGEN_ASKS_PROCESSOR
#include "eomgen_calls.h"
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif

typedef double four __attribute__((vector_size(32), aligned(8), may_alias));

#define RUN eomgen_run
#define EVALUATE eomgen_evaluate
#define root(a) sqrt(a)
#define now four
#define AT(a) (*(four *)((a) + i))
#define ROW(j) AT(K + (j) * n)
#define OVER(a) (a) / AT(scale)
#define EACH(...) \
    for (int i = 0;; i = i + 8 > n ? n - 4 : i + 4) { \
        __VA_ARGS__; \
        if (i == n - 4) { \
            break; \
        } \
    }

static inline void measure(const eomgen_run *run, double *scale)
{
    for (int i = 0; i < run->n; i++) {
        const double a = fabs(run->y_old[i]), b = fabs(run->y[i]);
        scale[i] = run->atol[i] + (a >= b ? a : b) * run->rtol;
    }
}

#define METHOD(name_, title, K, F, order) \
    static const eomgen_method wide_##name_ = {title, K, F, order, name_##_attempt, name_##_error, name_##_prepare, \
        name_##_interpolate, 0, 0, 0, NULL, NULL};
#include "eomgen_methods.h"

#if defined(__clang__)
#pragma clang attribute pop
#endif

const eomgen_method *eomgen_suited(const eomgen_method *method, int n)
{
    const eomgen_method *const plain[] = {&eomgen_dop853, &eomgen_rk45};
    const eomgen_method *const wide[] = {&wide_dop853, &wide_rk45};
    for (int k = 0; n >= WIDE_FROM && k < 2; k++) {
        if (method == plain[k] && eomgen_processor() != 0) {
            return wide[k];
        }
    }
    return method;
}
#else
const eomgen_method *eomgen_suited(const eomgen_method *method, int n)
{
    (void)n;
    return method;
}
#endif
