/* The numbers that straight-line functions compute with: `real` is double or, where EOMGEN_WIDTH is defined, so many
   doubles side by side (lanes). The operations are the same, so every lane has the bits of the plain function. */
#ifndef EOMGEN_REAL_H
#define EOMGEN_REAL_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__cplusplus) && !defined(restrict)
#define restrict __restrict /* C++ has no such word */
#endif

/* EOMGEN_PORTABLE: do without the vector types of GCC and Clang. */
#if defined(__GNUC__) && !defined(EOMGEN_PORTABLE)
#define EOMGEN_VECTORS
#endif

#ifdef EOMGEN_WIDTH
typedef double real __attribute__((vector_size(8 * EOMGEN_WIDTH)));
typedef int64_t flag __attribute__((vector_size(8 * EOMGEN_WIDTH))); /* all bits where true */
typedef uint64_t numeral __attribute__((vector_size(8 * EOMGEN_WIDTH)));
#define EOMGEN_LANE(x, k) (x)[k]
/* A check that fails marks its lanes and the others go on. */
#define EOMGEN_BEGIN flag failed = { 0 };
#define EOMGEN_REJECT(lost) failed |= (lost);
#define EOMGEN_RETURN return failed;
#define EOMGEN_REFUSE const flag none = { 0 }; return ~none;

static inline real same(double a)
{
    const real zero = { 0.0 };
    return a - zero;
}

static inline real choose(flag condition, real a, real b)
{
    return (real)(((flag)a & condition) | ((flag)b & ~condition));
}

static inline real abs_of(real a)
{
    return (real)((flag)a & ~(flag)same(-0.0));
}

static inline int any_of(flag a)
{
    int64_t found = 0;
    for (int k = 0; k < EOMGEN_WIDTH; k++) { found |= a[k]; }
    return found != 0;
}
#else
#define EOMGEN_WIDTH 1
#define EOMGEN_PLAIN
typedef double real;
typedef int flag;
#define EOMGEN_LANE(x, k) (x)
#define EOMGEN_BEGIN
#define EOMGEN_REJECT(lost) if (lost) { return 2; }
#define EOMGEN_RETURN return 0;
#define EOMGEN_REFUSE return -1; /* EOMGEN_BAD_ARGUMENT */
#define same(a) (a)
#define choose(condition, a, b) ((condition) ? (a) : (b))
#define abs_of(a) fabs(a)

/* The same value of two alike branches, such as the legs of a robot. */
#ifdef EOMGEN_VECTORS
typedef double both __attribute__((vector_size(16)));
typedef double both_anywhere __attribute__((vector_size(16), aligned(8), may_alias));
typedef uint64_t bits_of_both __attribute__((vector_size(16)));
#define first_of(a) (a)[0]
#define second_of(a) (a)[1]
#define both_at(place) (*(const both_anywhere *)(place))
#define both_put(place, a) *(both_anywhere *)(place) = (a)
#define both_plus(a, b) ((a) + (b))
#define both_minus(a, b) ((a) - (b))
#define both_times(a, b) ((a)*(b))
#define both_over(a, b) ((a)/(b))
#define both_negated(a) (-(a))

static inline both both_of(double a, double b)
{
    const both result = { a, b };
    return result;
}

/* The second with the other sign. */
static inline both both_turned(both a)
{
    const bits_of_both sign = { 0, 0x8000000000000000u };
    return (both)((bits_of_both)a ^ sign);
}
#else
typedef struct { double first, second; } both;
#define first_of(a) (a).first
#define second_of(a) (a).second
#define both_at(place) both_of((place)[0], (place)[1])
#define both_put(place, a) (place)[0] = (a).first, (place)[1] = (a).second

static inline both both_of(double a, double b)
{
    both result;
    result.first = a;
    result.second = b;
    return result;
}

static inline both both_plus(both a, both b) { return both_of(a.first + b.first, a.second + b.second); }
static inline both both_minus(both a, both b) { return both_of(a.first - b.first, a.second - b.second); }
static inline both both_times(both a, both b) { return both_of(a.first*b.first, a.second*b.second); }
static inline both both_over(both a, both b) { return both_of(a.first/b.first, a.second/b.second); }
static inline both both_negated(both a) { return both_of(-a.first, -a.second); }
static inline both both_turned(both a) { return both_of(a.first, -a.second); }
#endif
#endif

/* NAME(a), NAME(a, b): a function of doubles in every lane; of files that include eomgen.h. */
#define EOMGEN_EACH(NAME, FUNCTION) \
    EOMGEN_SHARED inline real NAME(real a) \
    { \
        real y = same(0.0); \
        for (int k = 0; k < EOMGEN_WIDTH; k++) { EOMGEN_LANE(y, k) = FUNCTION(EOMGEN_LANE(a, k)); } \
        return y; \
    }
#define EOMGEN_EACH_PAIR(NAME, FUNCTION) \
    EOMGEN_SHARED inline real NAME(real a, real b) \
    { \
        real y = same(0.0); \
        for (int k = 0; k < EOMGEN_WIDTH; k++) { EOMGEN_LANE(y, k) = FUNCTION(EOMGEN_LANE(a, k), EOMGEN_LANE(b, k)); } \
        return y; \
    }

#endif
