/* A plain DOP853 loop, as one would write it for one problem: N and the coefficients A_, B_, C_, E3_, E5_ come before. */
#include <math.h>
#include <string.h>

typedef int (*function)(double t, const double *x, const double *u, const double *c, double *out, double *w);

long integrate(function rhs, const double *u, const double *c, double *w, double t, double t1, double *y, double rtol,
    double atol)
{
    double K[13][N], z[N];
    long steps = 0;
    int rejected = 0;
    double d0 = 0.0, d1 = 0.0, d2 = 0.0;
    rhs(t, y, u, c, K[0], w);
    for (int i = 0; i < N; i++) {
        const double scale = atol + rtol * fabs(y[i]);
        d0 += y[i] / scale * (y[i] / scale), d1 += K[0][i] / scale * (K[0][i] / scale);
    }
    d0 = sqrt(d0 / N), d1 = sqrt(d1 / N);
    double h = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    for (int i = 0; i < N; i++) {
        z[i] = y[i] + h * K[0][i];
    }
    rhs(t + h, z, u, c, K[1], w);
    for (int i = 0; i < N; i++) {
        const double e = (K[1][i] - K[0][i]) / (atol + rtol * fabs(y[i]));
        d2 += e * e;
    }
    d2 = sqrt(d2 / N) / h;
    const double h1 = d1 <= 1e-15 && d2 <= 1e-15 ? fmax(1e-6, h * 1e-3) : pow(0.01 / fmax(d1, d2), 1.0 / 8);
    h = fmin(100.0 * h, h1);
    while (t < t1) {
        h = t + h > t1 ? t1 - t : h;
        for (int s = 1; s < 12; s++) {
            for (int i = 0; i < N; i++) {
                double a = 0.0;
                for (int j = 0; j < s; j++) {
                    a += A_[s][j] * K[j][i];
                }
                z[i] = y[i] + h * a;
            }
            rhs(t + C_[s] * h, z, u, c, K[s], w);
        }
        for (int i = 0; i < N; i++) {
            double a = 0.0;
            for (int j = 0; j < 12; j++) {
                a += B_[j] * K[j][i];
            }
            z[i] = y[i] + h * a;
        }
        rhs(t + h, z, u, c, K[12], w);
        double e5 = 0.0, e3 = 0.0;
        for (int i = 0; i < N; i++) {
            const double scale = atol + rtol * fmax(fabs(y[i]), fabs(z[i]));
            double five = 0.0, three = 0.0;
            for (int j = 0; j < 13; j++) {
                five += E5_[j] * K[j][i], three += E3_[j] * K[j][i];
            }
            e5 += five / scale * (five / scale), e3 += three / scale * (three / scale);
        }
        const double error = e5 > 0.0 || e3 > 0.0 ? fabs(h) * e5 / sqrt((e5 + 0.01 * e3) * N) : 0.0;
        if (error < 1.0) {
            const double factor = error == 0.0 ? 10.0 : fmin(10.0, 0.9 * pow(error, -1.0 / 8));
            t += h, h *= rejected ? fmin(1.0, factor) : factor;
            memcpy(y, z, sizeof z);
            memcpy(K[0], K[12], sizeof z);
            rejected = 0, steps++;
        } else {
            h *= fmax(0.2, 0.9 * pow(error, -1.0 / 8));
            rejected = 1;
        }
    }
    return steps;
}

/* The same right-hand side as numbalsoda calls one. */
static function soda_function;
static const double *soda_u, *soda_c;
static double *soda_w;

void soda_prepare(function rhs, const double *u, const double *c, double *w)
{
    soda_function = rhs, soda_u = u, soda_c = c, soda_w = w;
}

void soda_rhs(double t, double *x, double *dx, double *data)
{
    (void)data;
    soda_function(t, x, soda_u, soda_c, dx, soda_w);
}
