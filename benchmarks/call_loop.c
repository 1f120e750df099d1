/* Nanoseconds of one call of a kernel whose address is given: what a call from Python is held against. */
#include <time.h>

typedef int (*kernel)(double, const double *, const double *, const double *, double *, double *);

double measure(kernel f, long calls, const double *x, const double *u, const double *c, double *out, double *w)
{
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (long k = 0; k < calls; k++) {
        f(0.0, x, u, c, out, w);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    return ((double)(end.tv_sec - start.tv_sec) * 1e9 + (double)(end.tv_nsec - start.tv_nsec)) / (double)calls;
}
