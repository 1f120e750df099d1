/* The methods' text for one state at a time; eomgen_lane_runs.h takes the same text for several. */
#include "eomgen_real.h"
#include "eomgen_steppers.h"

#define RUN eomgen_run
#define EVALUATE eomgen_evaluate
#define root(a) sqrt(a)
#define larger_of(a, b) fmax(a, b)
#define ATTEMPT(name) static void name##_attempt(eomgen_run *run, double h)
#define STAGE(s, at, ...) \
    { \
        const int n = run->n; \
        const double *restrict const y0 = run->y_old, *const K = run->K; \
        double *restrict const y = run->y; \
        for (int i = 0; i < n; i++) { y[i] = y0[i] + h * (__VA_ARGS__); } \
        eomgen_evaluate(run, run->t + at * h, y, run->K + s * n); \
    }
#define LAST_STAGE(s) memcpy(run->f, run->K + s * run->n, (size_t)run->n * sizeof(double));
#define k(j) K[j * n + i]
#define SCALE(a) (a)
#define OVER(a, scale) ((a) / (scale))
#define METHOD(name_, title, K, F, order) \
    const eomgen_method eomgen_##name_ = {.name = title, .rows_K = K, .rows_F = F, .error_order = order, \
        .attempt = name_##_attempt, .error = name_##_error, .prepare = name_##_prepare, \
        .interpolate = name_##_interpolate};
#include "eomgen_methods.h"
