/* The methods' text for one state at a time; eomgen_lane_runs.h takes the same text for several. */
#include "eomgen_real.h"
#include "eomgen_steppers.h"

#define RUN eomgen_run
#define EVALUATE eomgen_evaluate
#define root(a) sqrt(a)
#define larger_of(a, b) fmax(a, b)
#define METHOD(name_, title, K, F, order) \
    const eomgen_method eomgen_##name_ = {.name = title, .rows_K = K, .rows_F = F, .error_order = order, \
        .attempt = name_##_attempt, .error = name_##_error, .prepare = name_##_prepare, \
        .interpolate = name_##_interpolate};
#include "eomgen_methods.h"
