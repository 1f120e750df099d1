/* sin and cos of several angles together in single precision, within 2 units in the last place for |angle| <=
   EOMGEN_NEAR; farther angles, infinities and NaN are left to libm,
   or NaN where EOMGEN_OWN_ANGLES is defined.

   Reduction by multiples of pi/2 in three parts (W. J. Cody, W. Waite, Software Manual for the Elementary Functions,
   1980), of which the first two have 11 bits, so that their products with up to 2^13 are exact; then polynomials on
   [-pi/4, pi/4], made by interpolation at Chebyshev nodes in 50 digits. */
#ifndef EOMGEN_SINCOS_H
#define EOMGEN_SINCOS_H

#include "eomgen_real.h"

#define EOMGEN_NEAR 1.0e4f

typedef int bits;
#define any_far(far) (far)

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

/* What is far in these angles. */
static inline void sincos_far(real a, real *restrict sine, real *restrict cosine)
{
    if (!(fabsf(a) <= EOMGEN_NEAR)) {
#ifdef EOMGEN_OWN_ANGLES
        *sine = *cosine = NAN;
#else
        *sine = sinf(a);
        *cosine = cosf(a);
#endif
    }
}

#include "eomgen_angles.h"
#endif
