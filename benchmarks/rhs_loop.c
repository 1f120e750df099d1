/* Nanoseconds of one call of a right-hand side that stands in another file, so that the compiler sees none of it here.
   The state moves a little with every result, so that no call can begin before the one before has ended. */
#include <time.h>

void call(const double *x, const double *u, double *out);

double measure(long calls, int n_q, int n_v, double *x, const double *u, double *out)
{
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (long k = 0; k < calls; k++) {
        call(x, u, out);
        x[n_q + k % n_v] += 1e-14 * out[n_q + k % n_v];
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    return ((double)(end.tv_sec - start.tv_sec) * 1e9 + (double)(end.tv_nsec - start.tv_nsec)) / (double)calls;
}
