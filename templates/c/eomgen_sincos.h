/* sin and cos of several angles together, without branches, within 2 units in the last place for |angle| <= EOMGEN_NEAR;
   farther angles, infinities and NaN are left to libm, or NaN where EOMGEN_OWN_ANGLES is defined. Plain functions take packs of angles, lanes one angle each.

   Reduction by multiples of pi/2 in four parts (W. J. Cody, W. Waite, Software Manual for the Elementary Functions,
   1980), of 33 bits each, so that their products with up to 2^20 are exact; then polynomials on [-pi/4, pi/4], made by
   interpolation at Chebyshev nodes in 60 digits, with errors of 2^-56 and 2^-60. */
#ifndef EOMGEN_SINCOS_H
#define EOMGEN_SINCOS_H

#include "eomgen_real.h"

#define EOMGEN_NEAR 1.0e6

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

#ifdef EOMGEN_CONTRACTED
/* Where a*b + c is rounded once: three parts of all bits, the first subtraction is exact. NaN needs no help of libm. */
static inline bits sincos_pack(pack a, pack *restrict sine, pack *restrict cosine)
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
static inline bits sincos_pack(pack x, pack *restrict sine, pack *restrict cosine)
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

#include "eomgen_angles.h"
#endif
