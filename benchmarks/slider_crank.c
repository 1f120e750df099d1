/* The slider-crank of examples/slider_crank.yaml in closed form, by hand, beside the generated right-hand side.
   Prints the nanoseconds a call of each, in turns, and the largest difference of their angular accelerations. */
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <time.h>
#include "slider_crank.h"

enum { STATES = 512, ROUNDS = 2, REPEATS = 3000 };

/* p: r l m_c m_r m_s g; x: theta, theta_dot. */
static __attribute__((noinline)) void closed_form(const double *restrict x, const double *restrict p, double tau,
                                                  double *restrict out)
{
    const double r = p[0], l = p[1], m_c = p[2], m_r = p[3], m_s = p[4], g = p[5], w = x[1];
    const double s = sin(x[0]), c = cos(x[0]), k = r / l;
    const double s_phi = -k * s, c_phi = sqrt(1.0 - s_phi * s_phi), i = 1.0 / c_phi;
    const double turn = -k * c * i, turn_2 = (k * s + turn * turn * s_phi) * i; /* phi by theta, twice */
    const double pull = s_phi * turn, pull_2 = c_phi * turn * turn + s_phi * turn_2;
    const double x_1 = -r * s - 0.5 * l * pull, x_2 = -r * c - 0.5 * l * pull_2; /* centre of the rod */
    const double y_1 = 0.5 * r * c, y_2 = -0.5 * r * s;
    const double s_1 = -r * s - l * pull, s_2 = -r * c - l * pull_2; /* slider */
    const double inertia = m_r * l * l / 12.0, gap = r * c + l * c_phi - 0.5;
    const double force = -200.0 * (fabs(gap) - 0.1) * (gap > 0.0 ? 1.0 : -1.0);
    const double mass = m_c * r * r / 3.0 + m_r * (x_1 * x_1 + y_1 * y_1) + inertia * turn * turn + m_s * s_1 * s_1;
    const double rate = m_r * (x_1 * x_2 + y_1 * y_2) + inertia * turn * turn_2 + m_s * s_1 * s_2;
    out[0] = w;
    out[1] = (tau - g * (0.5 * m_c * r * c + m_r * y_1) + force * s_1 - w * w * rate) / mass;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(void)
{
    static double x[STATES][SLIDER_CRANK_N_X], y[STATES][2], c[SLIDER_CRANK_N_CONST], w[SLIDER_CRANK_N_WORK];
    const double p[] = {0.1, 0.35, 1.0, 0.8, 0.5, 9.81}, u[] = {0.7};
    double out[SLIDER_CRANK_N_X], closed[2], worst = 0.0, ours = 1e300, theirs = 1e300;
    volatile double sink = 0.0;
    slider_crank_precompute(p, c);
    for (int k = 0; k < STATES; k++) { /* a state near the loop: one step of Newton brings it there, as in a simulation */
        const double theta = 0.01227184630308513 * k, s_phi = -p[0] * sin(theta) / p[1], w_0 = 10.0 * cos(0.1 * k);
        const double w_phi = -p[0] * cos(theta) * w_0 / (p[1] * sqrt(1.0 - s_phi * s_phi));
        x[k][0] = y[k][0] = theta, y[k][1] = w_0;
        x[k][1] = asin(s_phi) - theta + 1e-10 * sin(k);
        x[k][2] = p[0] * cos(theta) + p[1] * cos(asin(s_phi));
        x[k][3] = w_0, x[k][4] = w_phi - w_0;
        x[k][5] = -p[0] * sin(theta) * w_0 - p[1] * s_phi * w_phi;
        if (slider_crank_rhs(0.0, x[k], u, c, out, w) != 0) {
            return 1;
        }
        closed_form(y[k], p, u[0], closed);
        worst = fmax(worst, fabs(out[3] - closed[1]));
    }
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        double start = now();
        for (int round = 0; round < ROUNDS; round++) {
            for (int k = 0; k < STATES; k++) {
                closed_form(y[k], p, u[0], closed);
                sink += closed[1];
            }
        }
        theirs = fmin(theirs, (now() - start) / (ROUNDS * STATES));
        start = now();
        for (int round = 0; round < ROUNDS; round++) {
            for (int k = 0; k < STATES; k++) {
                slider_crank_rhs(0.0, x[k], u, c, out, w);
                sink += out[3];
            }
        }
        ours = fmin(ours, (now() - start) / (ROUNDS * STATES));
    }
    printf("%.17g %.17g %.17g\n", theirs, ours, worst);
    return 0;
}
