/* What can be had: 1,000s of double pendulums by a DOP853 loop written by hand for them alone, 4 of them side by side with
   one step size, sines and cosines by polynomials, everything inlined, -ffast-math. Angles from the vertical. */
#include <math.h>
#include <immintrin.h>

typedef double vd __attribute__((vector_size(32)));
#include "pendulum_lanes_tables.h" /* A[12][12], B[12], E3[13], E5[13] of DOP853 */

static inline void sincos4(vd a, vd *s, vd *c)
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
    *s = (vd)_mm256_xor_pd(_mm256_blendv_pd(ps, pc, swap), ss);
    *c = (vd)_mm256_xor_pd(_mm256_blendv_pd(pc, ps, swap), sc);
}

static inline void rhs(const vd *y, vd *f, const double *p)
{
    const double m1 = p[0], m2 = p[1], l1 = p[2], l2 = p[3], g = p[4], m = m1 + m2;
    vd s1, c1, s2, c2;
    sincos4(y[0], &s1, &c1);
    sincos4(y[1], &s2, &c2);
    const vd s = s1 * c2 - c1 * s2, c = c1 * c2 + s1 * s2;
    const vd b1 = -m2 * l2 * y[3] * y[3] * s - m * g * s1, b2 = l1 * y[2] * y[2] * s - g * s2;
    const vd a1 = (b1 - m2 * c * b2) / (l1 * (m - m2 * c * c));
    f[0] = y[2], f[1] = y[3], f[2] = a1, f[3] = (b2 - l1 * c * a1) / l2;
}

static inline double largest(vd a)
{
    const double x = a[0] > a[1] ? a[0] : a[1], y = a[2] > a[3] ? a[2] : a[3];
    return x > y ? x : y;
}

static inline vd size_of(vd a)
{
    return (vd)_mm256_andnot_pd(_mm256_set1_pd(-0.0), (__m256d)a);
}

static long run(double end, vd *y, const double *p, double rtol, double atol)
{
    vd K[13][4], z[4];
    double t = 0.0, h = 1e-2;
    long steps = 0;
    int rejected = 0;
    rhs(y, K[0], p);
    while (t < end) {
        if (t + h > end) {
            h = end - t;
        }
#pragma GCC unroll 12
        for (int s = 1; s < 12; s++) {
            for (int i = 0; i < 4; i++) {
                vd a = { 0 };
                for (int j = 0; j < s; j++) {
                    a += A[s][j] * K[j][i];
                }
                z[i] = y[i] + h * a;
            }
            rhs(z, K[s], p);
        }
        for (int i = 0; i < 4; i++) {
            vd a = { 0 };
            for (int j = 0; j < 12; j++) {
                a += B[j] * K[j][i];
            }
            z[i] = y[i] + h * a;
        }
        rhs(z, K[12], p);
        vd e5 = { 0 }, e3 = { 0 };
        for (int i = 0; i < 4; i++) {
            const vd a0 = size_of(y[i]), b0 = size_of(z[i]);
            const vd scale = atol + rtol * (vd)_mm256_max_pd((__m256d)a0, (__m256d)b0);
            vd a = { 0 }, b = { 0 };
            for (int j = 0; j < 13; j++) {
                a += E5[j] * K[j][i], b += E3[j] * K[j][i];
            }
            a /= scale, b /= scale, e5 += a * a, e3 += b * b;
        }
        const double error = h * sqrt(largest(e5 * e5 / ((e5 + 0.01 * e3) * 4.0 + 1e-300)));
        if (error < 1.0) {
            double factor = error == 0.0 ? 10.0 : fmin(10.0, 0.9 * pow(error, -0.125));
            factor = rejected ? fmin(1.0, factor) : factor;
            t += h;
            for (int i = 0; i < 4; i++) {
                y[i] = z[i], K[0][i] = K[12][i];
            }
            h *= factor, rejected = 0, steps++;
        } else {
            h *= fmax(0.2, 0.9 * pow(error, -0.125)), rejected = 1;
        }
    }
    return steps;
}

/* Rows Y (count, 4) from `first` on, `count` a multiple of 4; steps taken. */
long run_many(long first, long last, double end, double *Y, const double *p, double rtol, double atol)
{
    long steps = 0;
    for (long b = first; b < last; b += 4) {
        vd y[4];
        for (int i = 0; i < 4; i++) {
            for (int l = 0; l < 4; l++) {
                y[i][l] = Y[(b + l) * 4 + i];
            }
        }
        steps += 4 * run(end, y, p, rtol, atol);
        for (int i = 0; i < 4; i++) {
            for (int l = 0; l < 4; l++) {
                Y[(b + l) * 4 + i] = y[i][l];
            }
        }
    }
    return steps;
}
