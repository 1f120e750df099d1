/* Loops around functions of generated code: seconds of one call. A call begins with what the one before has ended with. */
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <string.h>
#include <time.h>
#include "eomgen.h"

static const double LITTLE = 1e-30; /* changes no state, but no call can begin before the last has ended */

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* So many calls, going round rows of n_in inputs; n_out 0: calls may overlap. */
double time_kernel(eomgen_function f, long calls, long rows, long n_in, long n_out, double *x, const double *u,
    const double *c, double *out, double *w)
{
    const double begin = now();
    long row = 0;
    for (long k = 0; k < calls; k++) {
        double *at = x + row * n_in;
        (void)f(0.0, at, u, c, out, w);
        if (n_out > 0) { at[0] += LITTLE * out[n_out - 1]; }
        row = row + 1 == rows ? 0 : row + 1;
    }
    return (now() - begin) / (double)calls;
}

/* A right-hand side in lanes that all begin alike: seconds of one state; room is aligned; -1 without these lanes. */
double time_lanes(const eomgen_model *model, long calls, int n_x, const double *x0, const double *u0, const double *c0,
    double *out, double *room)
{
    const eomgen_lanes *lanes = model->lanes[0];
    int rhs = 0;
    while (strcmp(model->kernels[rhs].name, "rhs") != 0) {
        rhs++;
    }
    if (lanes == NULL || !lanes->usable() || lanes->kernels[rhs] == NULL) {
        return -1.0;
    }
    const int width = lanes->width;
    double *t = room, *u = t + width, *c = u + width * model->n_u, *x = c + width * model->n_const;
    double *y = x + width * n_x, *w = y + width * n_x;
    int status[8];
    for (int k = 0; k < width; k++) {
        t[k] = 0.0;
        for (int i = 0; i < model->n_u; i++) { u[i * width + k] = u0[i]; }
        for (int i = 0; i < model->n_const; i++) { c[i * width + k] = c0[i]; }
        for (int i = 0; i < n_x; i++) { x[i * width + k] = x0[i]; }
    }
    const double begin = now();
    for (long j = 0; j < calls; j++) {
        (void)lanes->kernels[rhs](t, x, u, c, y, w, status);
        for (int k = 0; k < width; k++) { x[k] += LITTLE * y[(n_x - 1) * width + k]; }
    }
    const double spent = now() - begin;
    for (int i = 0; i < n_x; i++) { out[i] = y[i * width + width - 1]; }
    return spent / (double)calls / (double)width;
}

/* The slider-crank of examples/slider_crank.yaml in closed form, by hand; c: r l m_c m_r m_s g; x: theta, theta_dot. */
int slider_crank(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    const double r = c[0], l = c[1], m_c = c[2], m_r = c[3], m_s = c[4], g = c[5], rate = x[1];
    const double sine = sin(x[0]), cosine = cos(x[0]), k = r / l;
    const double s_phi = -k * sine, c_phi = sqrt(1.0 - s_phi * s_phi), i = 1.0 / c_phi;
    const double turn = -k * cosine * i, turn_2 = (k * sine + turn * turn * s_phi) * i; /* phi by theta, twice */
    const double pull = s_phi * turn, pull_2 = c_phi * turn * turn + s_phi * turn_2;
    const double x_1 = -r * sine - 0.5 * l * pull, x_2 = -r * cosine - 0.5 * l * pull_2; /* centre of the rod */
    const double y_1 = 0.5 * r * cosine, y_2 = -0.5 * r * sine;
    const double s_1 = -r * sine - l * pull, s_2 = -r * cosine - l * pull_2; /* slider */
    const double inertia = m_r * l * l / 12.0, gap = r * cosine + l * c_phi - 0.5;
    const double force = -200.0 * (fabs(gap) - 0.1) * (gap > 0.0 ? 1.0 : -1.0);
    const double mass = m_c * r * r / 3.0 + m_r * (x_1 * x_1 + y_1 * y_1) + inertia * turn * turn + m_s * s_1 * s_1;
    const double slope = m_r * (x_1 * x_2 + y_1 * y_2) + inertia * turn * turn_2 + m_s * s_1 * s_2;
    (void)t, (void)w;
    out[0] = rate;
    out[1] = (u[0] - g * (0.5 * m_c * r * cosine + m_r * y_1) + force * s_1 - rate * rate * slope) / mass;
    return 0;
}
