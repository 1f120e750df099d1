/* The numbers that straight-line functions compute with, and sin and cos of several angles together. `real` is double
   or, where EOMGEN_WIDTH is defined, so many doubles side by side (lanes). The operations are the same, so every lane has
   the bits of the plain function. EOMGEN_SINGLE: the text is written in single precision. */
#ifndef EOMGEN_REAL_H
#define EOMGEN_REAL_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__cplusplus) && !defined(restrict)
#define restrict __restrict /* C++ has no such word */
#endif

/* EOMGEN_PORTABLE: do without the vector types of GCC and Clang. */
#if defined(__GNUC__) && !defined(EOMGEN_PORTABLE) && !defined(EOMGEN_SINGLE)
#define EOMGEN_VECTORS
#endif

#ifdef EOMGEN_WIDTH
typedef double real __attribute__((vector_size(8 * EOMGEN_WIDTH)));
typedef int64_t flag __attribute__((vector_size(8 * EOMGEN_WIDTH))); /* all bits where true */
typedef uint64_t numeral __attribute__((vector_size(8 * EOMGEN_WIDTH)));
#define EOMGEN_LANE(x, k) (x)[k]
/* A check that fails marks its lanes and the others go on. */
#define EOMGEN_BEGIN flag failed = { 0 }; EOMGEN_UNUSED
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
#define EOMGEN_BEGIN EOMGEN_UNUSED
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

/* The arguments of a straight-line function, of which few read all. */
#define EOMGEN_ARGUMENTS real t, const real *restrict x, const real *restrict u, const real *restrict c, \
    real *restrict out, real *restrict w
#define EOMGEN_UNUSED (void)t, (void)x, (void)u, (void)c, (void)out, (void)w;

/* NAME(a): a function of doubles in every lane; of files that include eomgen.h. */
#define EOMGEN_EACH(NAME, FUNCTION) \
    EOMGEN_SHARED inline real NAME(real a) \
    { \
        real y = same(0.0); \
        for (int k = 0; k < EOMGEN_WIDTH; k++) { EOMGEN_LANE(y, k) = FUNCTION(EOMGEN_LANE(a, k)); } \
        return y; \
    }

/* sin and cos of several angles together, without branches, within 2 units in the last place for |angle| <= EOMGEN_NEAR;
   farther angles, infinities and NaN are left to libm, or NaN where EOMGEN_OWN_ANGLES is defined. Plain functions take
   packs of angles, lanes one angle each.

   Reduction by multiples of pi/2 in four parts (W. J. Cody, W. Waite, Software Manual for the Elementary Functions,
   1980), of 33 bits each, so that their products with up to 2^20 are exact; then polynomials on [-pi/4, pi/4], made by
   interpolation at Chebyshev nodes in 60 digits, with errors of 2^-56 and 2^-60. */
#ifdef EOMGEN_SINGLE
#define EOMGEN_NEAR 1.0e4
#else
#define EOMGEN_NEAR 1.0e6
#endif

#ifdef EOMGEN_VECTORS
#ifndef EOMGEN_PLAIN
#define EOMGEN_PACK EOMGEN_WIDTH
#elif defined(__AVX2__)
#define EOMGEN_PACK 4
#else
#define EOMGEN_PACK 2
#endif
typedef double pack __attribute__((vector_size(8 * EOMGEN_PACK)));
typedef uint64_t bits __attribute__((vector_size(8 * EOMGEN_PACK)));

/* A part of its caller however long that is: compilers tire of it in long functions. */
#define EOMGEN_INSIDE __attribute__((always_inline)) static inline

#ifdef EOMGEN_CONTRACTED
/* Where a*b + c is rounded once: three parts of all bits, the first subtraction is exact. NaN needs no help of libm. */
EOMGEN_INSIDE bits sincos_pack(pack a, pack *restrict sine, pack *restrict cosine)
{
    const pack turns = a * 0.6366197723675814 + 0x1.8p52, n = turns - 0x1.8p52;
    const bits quarter = (bits)turns;
    const pack r = ((a - n * 0x1.921fb54442d18p+0) - n * 0x1.1a62633145c07p-54) + n * 0x1.f1976b7ed8fbcp-110;
    const pack z = r * r, z2 = z * z, size = (pack)((bits)a & 0x7fffffffffffffffu);
    const pack s = r + r * z * ((-0.16666666666666666 + z * 0.008333333333330925) + z2 * ((-0.00019841269836722437
        + z * 2.755731608382574e-06) + z2 * (-2.505112794596564e-08 + z * 1.591784866512194e-10)));
    const pack c = (1.0 - 0.5 * z) + z2 * ((0.041666666666666664 - z * 0.0013888888888887382) + z2
        * ((2.480158729874308e-05 - z * 2.755731726001471e-07) + z2 * (2.0876143829213935e-09
        - z * 1.1382456865840483e-11)));
    const bits odd = -(quarter & 1), apart = ((bits)s ^ (bits)c) & odd;
    *sine = (pack)((bits)s ^ apart ^ ((quarter & 2) << 62));
    *cosine = (pack)((bits)c ^ apart ^ (((quarter + 1) & 2) << 62));
    return (bits)(size > EOMGEN_NEAR);
}
#else
EOMGEN_INSIDE bits sincos_pack(pack x, pack *restrict sine, pack *restrict cosine)
{
    const bits sign = (bits)x & 0x8000000000000000u;
    const pack a = (pack)((bits)x ^ sign);
    const pack turns = a * 0.6366197723675814 + 0x1p52; /* the multiple is in the last bits */
    const pack n = turns - 0x1p52;
    const bits quarter = (bits)turns;
    const pack a1 = a - n * 0x1.921fb54400000p+0, n2 = n * 0x1.0b4611a600000p-34, a2 = a1 - n2;
    const pack lost = (a1 - a2) - n2; /* what rounding took from a2 */
    const pack r = (a2 - (n * 0x1.3198a2e000000p-69 - lost)) - n * 0x1.b839a252049c1p-104;
    const pack z = r * r;
    const pack s = r + r * z * (-0.16666666666666666 + z * (0.008333333333330925 + z * (-0.00019841269836722437
        + z * (2.755731608382574e-06 + z * (-2.505112794596564e-08 + z * 1.591784866512194e-10)))));
    const pack c = 1.0 - (0.5 * z - z * z * (0.041666666666666664 + z * (-0.0013888888888887382 + z
        * (2.480158729874308e-05 + z * (-2.755731726001471e-07 + z * (2.0876143829213935e-09
        + z * -1.1382456865840483e-11))))));
    const bits odd = -(quarter & 1), apart = ((bits)s ^ (bits)c) & odd;
    *sine = (pack)((bits)s ^ apart ^ ((quarter & 2) << 62) ^ sign);
    *cosine = (pack)((bits)c ^ apart ^ (((quarter + 1) & 2) << 62));
    const bits none = { 0 };
    return (bits)(a <= EOMGEN_NEAR) ^ ~none;
}
#endif

static inline int any_far(bits far)
{
    uint64_t found = 0;
    for (int k = 0; k < EOMGEN_PACK; k++) { found |= far[k]; }
    return found != 0;
}
#else
typedef int bits;
#define any_far(far) (far)
#endif

/* What is far in these angles. */
static inline void sincos_far(real a, real *restrict sine, real *restrict cosine)
{
    for (int k = 0; k < EOMGEN_WIDTH; k++) {
        if (!(fabs(EOMGEN_LANE(a, k)) <= EOMGEN_NEAR)) {
#ifdef EOMGEN_OWN_ANGLES
            EOMGEN_LANE(*sine, k) = EOMGEN_LANE(*cosine, k) = NAN;
#else
            EOMGEN_LANE(*sine, k) = sin(EOMGEN_LANE(a, k));
            EOMGEN_LANE(*cosine, k) = cos(EOMGEN_LANE(a, k));
#endif
        }
    }
}

/* sincos_one, _two, _four: of so many angles, into consecutive places; what they return tells any_far whether some are. */
#if defined(EOMGEN_SINGLE)
/* Reduction in three parts, of which the first two have 11 bits, so that their products with up to 2^13 are exact; then
   polynomials on [-pi/4, pi/4], made by interpolation at Chebyshev nodes in 50 digits. */
static inline bits sincos_one(real a, real *restrict sine, real *restrict cosine)
{
    if (!(fabsf(a) <= EOMGEN_NEAR)) {
        *sine = *cosine = 0.0f;
        return 1;
    }
    const int n = (int)(a * 0.63661977f + (a < 0.0f ? -0.5f : 0.5f));
    const float m = (float)n;
    const float r = ((a - m * 1.5703125f) - m * 0.00048375129699707031f) - m * 7.5497901264043e-08f, z = r * r;
    const float s = r + r * z * (-0.16666664f + z * (0.008332748f + z * -0.0001958789f));
    const float c = (1.0f - 0.5f * z) + z * z * (0.041666664f + z * (-0.0013888302f + z * 2.4547942e-05f));
    *sine = (n & 1 ? c : s) * (n & 2 ? -1.0f : 1.0f);
    *cosine = (n & 1 ? s : c) * ((n + 1) & 2 ? -1.0f : 1.0f);
    return 0;
}
#elif !defined(EOMGEN_VECTORS)
static inline bits sincos_one(real a, real *restrict sines, real *restrict cosines)
{
#ifdef __CUDACC__
    sincos(a, sines, cosines);
#else
    *sines = sin(a);
    *cosines = cos(a);
#endif
    return 0;
}
#elif !defined(EOMGEN_PLAIN)
#define sincos_one sincos_pack
#else
EOMGEN_INSIDE bits sincos_wide(pack a, int n, double *restrict sines, double *restrict cosines)
{
    pack s, c;
    const bits far = sincos_pack(a, &s, &c);
    for (int k = 0; k < n; k++) {
        sines[k] = s[k];
        cosines[k] = c[k];
    }
    return far;
}

#if EOMGEN_PACK == 4
static inline pack pack_of(double a, double b, double c, double d)
{
    const pack result = { a, b, c, d };
    return result;
}

#define sincos_one(a, sines, cosines) sincos_wide(pack_of(a, a, a, a), 1, sines, cosines)
#define sincos_two(a, b, sines, cosines) sincos_wide(pack_of(a, b, a, b), 2, sines, cosines)
#define sincos_four(a, b, c, d, sines, cosines) sincos_wide(pack_of(a, b, c, d), 4, sines, cosines)
#else
static inline pack pack_of(double a, double b)
{
    const pack result = { a, b };
    return result;
}

#define sincos_one(a, sines, cosines) sincos_wide(pack_of(a, a), 1, sines, cosines)
#define sincos_two(a, b, sines, cosines) sincos_wide(pack_of(a, b), 2, sines, cosines)
#endif
#endif

#ifndef sincos_two
#define sincos_two(a, b, sines, cosines) (sincos_one(a, sines, cosines) | sincos_one(b, (sines) + 1, (cosines) + 1))
#endif
#ifndef sincos_four
#define sincos_four(a, b, c, d, sines, cosines) \
    (sincos_two(a, b, sines, cosines) | sincos_two(c, d, (sines) + 2, (cosines) + 2))
#endif

static inline real sine_of(real a)
{
    real s, c;
    if (any_far(sincos_one(a, &s, &c))) {
        sincos_far(a, &s, &c);
    }
    return s;
}

static inline real cosine_of(real a)
{
    real s, c;
    if (any_far(sincos_one(a, &s, &c))) {
        sincos_far(a, &s, &c);
    }
    return c;
}

#endif
