/* The methods' text for one state at a time; wide.c and eomgen_lane_runs.h take the same text with vectors. */
#include "eomgen_real.h"
#include "eomgen_steppers.h"

#define RUN eomgen_run
#define EVALUATE eomgen_evaluate
#define root(a) sqrt(a)
#define now real
#define ROW(j) K[(j) * n + i]
#define AT(a) (a)[i]
#define OVER(a) (a) / AT(scale)
#define EACH(...) \
    for (int i = 0; i < n; i++) { \
        __VA_ARGS__; \
    }

/* What each state may err by. */
static inline void measure(const eomgen_run *run, double *scale)
{
    for (int i = 0; i < run->n; i++) {
        const double a = fabs(run->y_old[i]), b = fabs(run->y[i]);
        scale[i] = run->atol[i] + (a >= b ? a : b) * run->rtol;
    }
}

#define METHOD(name_, title, K, F, order) \
    const eomgen_method eomgen_##name_ = {title, K, F, order, EOMGEN_TABLED(name_##_attempt), \
        EOMGEN_TABLED(name_##_error), EOMGEN_TABLED(name_##_prepare), EOMGEN_TABLED(name_##_interpolate), 0, 0, 0, NULL, NULL};
#include "eomgen_methods.h"
