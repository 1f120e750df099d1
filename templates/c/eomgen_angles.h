/* sincos_one, _two, _four: of so many angles, into consecutive places; what they return tells any_far whether some are. */

#if defined(EOMGEN_SINGLE)
/* sincos_one has been defined */
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
static inline bits sincos_wide(pack a, int n, double *restrict sines, double *restrict cosines)
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
