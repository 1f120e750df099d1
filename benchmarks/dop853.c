/* Loops of DOP853 as one would write them for one problem: N and the coefficients A_, B_, C_, E3_, E5_ come before.
   Over any right-hand side; with LANES for the double pendulum alone, four runs side by side with one step size, sines
   and cosines by polynomials, everything inlined, angles from the vertical. */
#include <math.h>
#include <string.h>

#ifdef LANES
#include <immintrin.h>

typedef double real __attribute__((vector_size(32)));
#define GIVEN const double *p
#define RHS(t, x, out) pendulum(x, out, p)

static inline void sincos4(real a, real *s, real *c)
{
    const __m256d x = (__m256d)a;
    const __m256d j = _mm256_round_pd(x * 0.63661977236758134308, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
    __m256d r = x - j * 1.57079632673412561417e+00;
    r = r - j * 6.07710050630396597660e-11;
    r = r - j * 2.02226624879595063154e-21;
    const __m256d z = r * r;
    const __m256d ps = ((((((z * 1.58962301576546568060e-10 + -2.50507477628578072866e-8) * z + 2.75573136213857245213e-6)
        * z + -1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z + -1.66666666666666307295e-1) * z) * r + r;
    const __m256d pc = ((((((z * -1.13585365213876817300e-11 + 2.08757008419747316778e-9) * z
        + -2.75573141792967388112e-7) * z + 2.48015872888517045348e-5) * z + -1.38888888888730564116e-3) * z
        + 4.16666666666665929218e-2) * z * z) - 0.5 * z + 1.0;
    const __m256i q = _mm256_cvtepi32_epi64(_mm256_cvtpd_epi32(j));
    const __m256d swap = _mm256_castsi256_pd(_mm256_slli_epi64(q, 63));
    const __m256d ss = _mm256_castsi256_pd(_mm256_slli_epi64(_mm256_srli_epi64(q, 1), 63));
    const __m256d sc = _mm256_castsi256_pd(
        _mm256_slli_epi64(_mm256_srli_epi64(_mm256_add_epi64(q, _mm256_set1_epi64x(1)), 1), 63));
    *s = (real)_mm256_xor_pd(_mm256_blendv_pd(ps, pc, swap), ss);
    *c = (real)_mm256_xor_pd(_mm256_blendv_pd(pc, ps, swap), sc);
}

static inline void pendulum(const real *y, real *f, const double *p)
{
    const double m1 = p[0], m2 = p[1], l1 = p[2], l2 = p[3], g = p[4], m = m1 + m2;
    real s1, c1, s2, c2;
    sincos4(y[0], &s1, &c1);
    sincos4(y[1], &s2, &c2);
    const real s = s1 * c2 - c1 * s2, c = c1 * c2 + s1 * s2;
    const real b1 = -m2 * l2 * y[3] * y[3] * s - m * g * s1, b2 = l1 * y[2] * y[2] * s - g * s2;
    const real a1 = (b1 - m2 * c * b2) / (l1 * (m - m2 * c * c));
    f[0] = y[2], f[1] = y[3], f[2] = a1, f[3] = (b2 - l1 * c * a1) / l2;
}

static inline double largest(real a)
{
    return fmax(fmax(a[0], a[1]), fmax(a[2], a[3]));
}

static inline real larger_size(real a, real b)
{
    const __m256d sign = _mm256_set1_pd(-0.0);
    return (real)_mm256_max_pd(_mm256_andnot_pd(sign, (__m256d)a), _mm256_andnot_pd(sign, (__m256d)b));
}
#else
typedef double real;
typedef int (*function)(double t, const double *x, const double *u, const double *c, double *out, double *w);
#define GIVEN function rhs, const double *u, const double *c, double *w
#define RHS(t, x, out) rhs(t, x, u, c, out, w)

static inline double largest(double a)
{
    return a;
}

static inline double larger_size(double a, double b)
{
    return fmax(fabs(a), fabs(b));
}
#endif

/* From t to end with a first step h; K[0] holds the slope. */
static inline long march(GIVEN, double t, double end, double h, real *y, real (*K)[N], double rtol, double atol)
{
    real z[N];
    long steps = 0;
    int rejected = 0;
    while (t < end) {
        h = t + h > end ? end - t : h;
#pragma GCC unroll 12
        for (int s = 1; s < 12; s++) {
            for (int i = 0; i < N; i++) {
                real a = { 0 };
                for (int j = 0; j < s; j++) { a += A_[s][j] * K[j][i]; }
                z[i] = y[i] + h * a;
            }
            RHS(t + C_[s] * h, z, K[s]);
        }
        for (int i = 0; i < N; i++) {
            real a = { 0 };
            for (int j = 0; j < 12; j++) { a += B_[j] * K[j][i]; }
            z[i] = y[i] + h * a;
        }
        RHS(t + h, z, K[12]);
        real e5 = { 0 }, e3 = { 0 };
        for (int i = 0; i < N; i++) {
            const real scale = atol + rtol * larger_size(y[i], z[i]);
            real five = { 0 }, three = { 0 };
            for (int j = 0; j < 13; j++) { five += E5_[j] * K[j][i], three += E3_[j] * K[j][i]; }
            five /= scale, three /= scale, e5 += five * five, e3 += three * three;
        }
        const double error = h * sqrt(largest(e5 * e5 / ((e5 + 0.01 * e3) * N + 1e-300)));
        if (error < 1.0) {
            const double factor = error == 0.0 ? 10.0 : fmin(10.0, 0.9 * pow(error, -0.125));
            t += h, h *= rejected ? fmin(1.0, factor) : factor;
            memcpy(y, z, sizeof z);
            memcpy(K[0], K[12], sizeof z);
            rejected = 0, steps++;
        } else {
            h *= fmax(0.2, 0.9 * pow(error, -0.125)), rejected = 1;
        }
    }
    return steps;
}

#ifdef LANES
/* Rows Y (count, 4) from `first` on, `count` a multiple of 4; steps taken. */
long run_many(long first, long last, double end, double *Y, const double *p, double rtol, double atol)
{
    long steps = 0;
    for (long b = first; b < last; b += 4) {
        real y[N], K[13][N];
        for (int i = 0; i < 16; i++) { y[i % 4][i / 4] = Y[b * 4 + i]; }
        pendulum(y, K[0], p);
        steps += 4 * march(p, 0.0, end, 1e-2, y, K, rtol, atol);
        for (int i = 0; i < 16; i++) { Y[b * 4 + i] = y[i % 4][i / 4]; }
    }
    return steps;
}
#else
long integrate(GIVEN, double t, double end, double *y, double rtol, double atol)
{
    double K[13][N], z[N], d0 = 0.0, d1 = 0.0, d2 = 0.0;
    RHS(t, y, K[0]);
    for (int i = 0; i < N; i++) {
        const double scale = atol + rtol * fabs(y[i]);
        d0 += y[i] / scale * (y[i] / scale), d1 += K[0][i] / scale * (K[0][i] / scale);
    }
    d0 = sqrt(d0 / N), d1 = sqrt(d1 / N);
    const double h = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    for (int i = 0; i < N; i++) { z[i] = y[i] + h * K[0][i]; }
    RHS(t + h, z, K[1]);
    for (int i = 0; i < N; i++) {
        const double e = (K[1][i] - K[0][i]) / (atol + rtol * fabs(y[i]));
        d2 += e * e;
    }
    d2 = sqrt(d2 / N) / h;
    const double h1 = d1 <= 1e-15 && d2 <= 1e-15 ? fmax(1e-6, h * 1e-3) : pow(0.01 / fmax(d1, d2), 0.125);
    return march(rhs, u, c, w, t, end, fmin(100.0 * h, h1), y, K, rtol, atol);
}

/* The same right-hand side as numbalsoda calls one. */
static function soda_function;
static const double *soda_u, *soda_c;
static double *soda_w;

void soda_prepare(GIVEN)
{
    soda_function = rhs, soda_u = u, soda_c = c, soda_w = w;
}

void soda_rhs(double t, double *x, double *dx, double *data)
{
    (void)data;
    soda_function(t, x, soda_u, soda_c, dx, soda_w);
}
#endif
