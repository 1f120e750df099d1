/* Loops around a right-hand side, with inputs that change a little from call to call: nanoseconds a state. */
#define _POSIX_C_SOURCE 199309L
#include <time.h>

#ifdef PEER
void accelerations(const double *q, const double *v, const double *tau, double *out);
#else
#include <stddef.h>
#include "eomgen.h"
#endif

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

#ifdef PEER
double time_peer(long calls, int n, const double *start, const double *u, double *out)
{
    double x[256];
    for (int i = 0; i < 2 * n; i++) {
        x[i] = start[i];
    }
    const double begin = now();
    for (long k = 0; k < calls; k++) {
        accelerations(x, x + n, u, out);
        x[k % n] += 1e-9 * out[k % n];
    }
    return (now() - begin) / (double)calls;
}
#else
double time_plain(long calls, int n, const double *start, const double *u, const double *c, double *out, double *w)
{
    const eomgen_function rhs = eomgen_model_table()->kernels[0].call;
    double x[256];
    for (int i = 0; i < 2 * n; i++) {
        x[i] = start[i];
    }
    const double begin = now();
    for (long k = 0; k < calls; k++) {
        (void)rhs(0.0, x, u, c, out, w);
        x[k % n] += 1e-9 * out[n + k % n];
    }
    return (now() - begin) / (double)calls;
}

/* All lanes begin alike; room is aligned; -1 where the processor or the library lacks this width. */
double time_lanes(long calls, int width, int n, const double *start, const double *u0, const double *c0, double *out,
    double *room)
{
    const eomgen_model *model = eomgen_model_table();
    const eomgen_lanes *const *lanes = model->lanes;
    while (*lanes != NULL && (*lanes)->width != width) {
        lanes++;
    }
    if (*lanes == NULL || !(*lanes)->usable() || (*lanes)->kernels[0] == NULL) {
        return -1.0;
    }
    double *t = room, *u = t + width, *c = u + width * model->n_u, *x = c + width * model->n_const;
    double *y = x + width * 2 * n, *w = y + width * 2 * n;
    int status[8];
    for (int k = 0; k < width; k++) {
        t[k] = 0.0;
        for (int i = 0; i < model->n_u; i++) { u[i * width + k] = u0[i]; }
        for (int i = 0; i < model->n_const; i++) { c[i * width + k] = c0[i]; }
        for (int i = 0; i < 2 * n; i++) { x[i * width + k] = start[i]; }
    }
    const double begin = now();
    for (long j = 0; j < calls; j++) {
        (void)(*lanes)->kernels[0](t, x, u, c, y, w, status);
        for (int k = 0; k < width; k++) {
            x[(j % n) * width + k] += 1e-9 * y[(n + j % n) * width + k];
        }
    }
    const double spent = now() - begin;
    for (int i = 0; i < 2 * n; i++) {
        out[i] = y[i * width + width - 1];
    }
    return spent / (double)calls / (double)width;
}
#endif
