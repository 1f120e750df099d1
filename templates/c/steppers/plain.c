/* The methods' text for one state at a time; eomgen_lane_runs.h takes the same text for several. */
#include "eomgen_real.h"
#include "eomgen_steppers.h"

#define RUN eomgen_run
#define EVALUATE eomgen_evaluate
#define root(a) sqrt(a)
#define larger_of(a, b) fmax(a, b)
#define METHOD(name, title, ...) \
    const eomgen_method eomgen_##name = { title, __VA_ARGS__, name##_attempt, name##_error, name##_prepare, \
                                          name##_interpolate, 0 };
#include "eomgen_methods.h"
