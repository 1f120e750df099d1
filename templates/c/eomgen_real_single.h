/* The numbers that straight-line functions compute with, in single precision. */
#ifndef EOMGEN_REAL_H
#define EOMGEN_REAL_H

#include <math.h>
#include <string.h>

#if defined(__cplusplus) && !defined(restrict)
#define restrict __restrict /* C++ has no such word */
#endif

#define EOMGEN_WIDTH 1
#define EOMGEN_PLAIN
#define EOMGEN_SINGLE
typedef float real;
typedef int flag;
#define EOMGEN_LANE(x, k) (x)
#define EOMGEN_BEGIN
#define EOMGEN_REJECT(lost) if (lost) { return 2; }
#define EOMGEN_RETURN return 0;
#define EOMGEN_REFUSE return -1; /* EOMGEN_BAD_ARGUMENT */
#define same(a) (a)
#define choose(condition, a, b) ((condition) ? (a) : (b))
#define abs_of(a) fabsf(a)

/* NAME(a), NAME(a, b): a function of numbers; of files that include eomgen.h. */
#define EOMGEN_EACH(NAME, FUNCTION) \
    EOMGEN_SHARED inline real NAME(real a) \
    { \
        return FUNCTION(a); \
    }
#define EOMGEN_EACH_PAIR(NAME, FUNCTION) \
    EOMGEN_SHARED inline real NAME(real a, real b) \
    { \
        return FUNCTION(a, b); \
    }

#endif
