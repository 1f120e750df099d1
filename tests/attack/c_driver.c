/* Calls every function of one exported C library as its headers allow; test_c_code.py writes the numbers.

   Every array has exactly the length the headers ask for, so that a sanitizer sees each access beyond; the work array is
   not initialized. What must not depend on something is computed twice and compared bit by bit: the rubbish in the work
   array, the alignment of arrays (8 bytes suffice outside lanes), lanes, and 8 threads at once. */
#define _POSIX_C_SOURCE 200112L
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "eomgen.h"

enum { THREADS = 8, STATES = 12, NEAR = 6 };

static const eomgen_model *model;
static long calls, lane_calls, faults;
static double *p, *u, *c, *q, **given; /* given[k]: STATES rows of the kernel's input */
static int n_q;

static void complain(const char *what, const char *name, int which)
{
    faults++;
    printf("fault: %s: %s, %d\n", name, what, which);
}

/* Doubles that begin at a multiple of 8*width bytes. */
static double *room(size_t n, int width)
{
    void *memory = NULL;
    const size_t bytes = n * (size_t)width * sizeof(double), align = sizeof(double) * (size_t)(width < 2 ? 2 : width);
    if (posix_memalign(&memory, align, bytes > 0 ? bytes : 1) != 0) {
        abort();
    }
    return (double *)memory;
}

static int same_bits(const double *a, const double *b, size_t n)
{
    return n == 0 || memcmp(a, b, n * sizeof(double)) == 0;
}

static int call(int k, int j, double *out, double *w)
{
    const eomgen_kernel *const kernel = model->kernels + k;
    return kernel->call(0.1 * j, given[k] + (size_t)j * (size_t)kernel->n_in, u, c, out, w);
}

/* States near the reference and away from it; the last have one number that is far, infinite or none. */
static double *states_of(const eomgen_kernel *kernel)
{
    const double odd[STATES - NEAR] = {1e9, INFINITY, NAN, 1e308, 1e-310, -INFINITY};
    double *const x = room((size_t)(STATES * kernel->n_in), 1);
    for (int j = 0; j < STATES; j++) {
        for (int i = 0; i < kernel->n_in; i++) {
            const double noise = 2.0 * rand() / RAND_MAX - 1.0;
            x[j * kernel->n_in + i] = j < NEAR && i < n_q ? q[i] + 0.05 * j * noise : noise;
        }
        if (j >= NEAR && kernel->n_in > 0) {
            x[j * kernel->n_in + j % kernel->n_in] = odd[j - NEAR];
        }
    }
    return x;
}

static void try_plain(int k)
{
    const eomgen_kernel *const kernel = model->kernels + k;
    const size_t n = (size_t)kernel->n_out, n_in = (size_t)kernel->n_in, n_work = (size_t)model->n_work;
    for (int j = 0; j < STATES; j++) {
        const double *const x = given[k] + (size_t)j * n_in;
        double *const out = room(n, 1), *const w = room(n_work, 1); /* uninitialized */
        double *const odd_x = room(n_in + 1, 1), *const odd = room(n + 1, 1), *const dirty = room(n_work + 1, 1);
        if (call(k, j, NULL, w) != 0) {
            complain("fails where no result is wanted", kernel->name, j);
        }
        const int status = call(k, j, out, w);
        memcpy(odd_x + 1, x, n_in * sizeof(double));
        memset(dirty, j % 2 ? 0xff : 0x7f, (n_work + 1) * sizeof(double)); /* NaN, or 1.4e306 */
        const int again = kernel->call(0.1 * j, odd_x + 1, u, c, odd + 1, dirty + 1);
        if (status != again || (status == 0 && !same_bits(out, odd + 1, n))) {
            complain("depends on alignment or on what was in the work array", kernel->name, j);
        }
        if (!same_bits(odd_x + 1, x, n_in)) {
            complain("changes its input", kernel->name, j);
        }
        free(out), free(w), free(odd_x), free(odd), free(dirty);
        calls += 3;
    }
}

static void try_lanes(const eomgen_lanes *lanes, int k)
{
    const eomgen_kernel *const kernel = model->kernels + k;
    const size_t W = (size_t)lanes->width, n_in = (size_t)kernel->n_in, n = (size_t)kernel->n_out;
    const size_t n_c = (size_t)model->n_const, n_u = (size_t)model->n_u, n_work = (size_t)model->n_work;
    for (int first = 0; first < STATES; first += lanes->width) {
        double *const t = room(1, lanes->width), *const x = room(n_in, lanes->width), *const w = room(n_work, lanes->width);
        double *const lane_u = room(n_u, lanes->width), *const lane_c = room(n_c, lanes->width);
        double *const out = room(n, lanes->width), *const plain = room(n, 1), *const plain_w = room(n_work, 1);
        int status[16];
        for (size_t l = 0; l < W; l++) {
            const int j = (first + (int)l) % STATES;
            t[l] = 0.1 * j;
            for (size_t i = 0; i < n_in; i++) {
                x[i * W + l] = given[k][(size_t)j * n_in + i];
            }
            for (size_t i = 0; i < n_u; i++) {
                lane_u[i * W + l] = u[i];
            }
            for (size_t i = 0; i < n_c; i++) {
                lane_c[i * W + l] = c[i];
            }
        }
        lanes->kernels[k](t, x, lane_u, lane_c, out, w, status);
        for (size_t l = 0; l < W; l++) {
            const int j = (first + (int)l) % STATES, one = call(k, j, plain, plain_w);
            int same = status[l] == EOMGEN_LEFT_ALONE || one == status[l];
            for (size_t i = 0; status[l] == 0 && one == 0 && i < n; i++) {
                same = same && same_bits(plain + i, out + i * W + l, 1);
            }
            if (!same) {
                complain("a lane has another status or other bits", kernel->name, j);
            }
        }
        free(t), free(x), free(w), free(lane_u), free(lane_c), free(out), free(plain), free(plain_w);
        lane_calls++;
    }
}

static void *all_again(void *target)
{
    double *const sums = (double *)target, *const w = room((size_t)model->n_work, 1);
    for (int k = 0; k < model->n_kernels; k++) {
        double *const out = room((size_t)model->kernels[k].n_out, 1);
        for (int j = 0; j < STATES; j++) {
            if (call(k, j, out, w) == 0) {
                for (int i = 0; i < model->kernels[k].n_out; i++) {
                    sums[k] += out[i];
                }
            }
        }
        free(out);
    }
    free(w);
    return NULL;
}

static void try_threads(void)
{
    pthread_t threads[THREADS];
    double *sums[THREADS + 1];
    for (int i = 0; i <= THREADS; i++) {
        sums[i] = (double *)calloc((size_t)model->n_kernels, sizeof(double));
    }
    all_again(sums[THREADS]);
    for (int i = 0; i < THREADS; i++) {
        if (pthread_create(threads + i, NULL, all_again, sums[i]) != 0) {
            abort();
        }
    }
    for (int i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
        if (!same_bits(sums[i], sums[THREADS], (size_t)model->n_kernels)) {
            complain("other bits in a thread", "all", i);
        }
        free(sums[i]);
    }
    free(sums[THREADS]);
}

int main(int argc, char **argv)
{
    FILE *const file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    double head = 0.0;
    model = eomgen_model_table();
    if (file == NULL || fread(&head, sizeof head, 1, file) != 1) {
        return 2;
    }
    n_q = (int)head;
    p = room((size_t)model->n_p, 1), u = room((size_t)model->n_u, 1), c = room((size_t)model->n_const, 1), q = room((size_t)n_q, 1);
    const size_t got = fread(p, 8, (size_t)model->n_p, file) + fread(u, 8, (size_t)model->n_u, file) + fread(q, 8, (size_t)n_q, file);
    if (got != (size_t)(model->n_p + model->n_u + n_q) || model->precompute(p, NULL) != 0 || model->precompute(p, c) != 0) {
        complain("constants cannot be computed", "precompute", 0);
    }
    fclose(file);
    given = (double **)calloc((size_t)model->n_kernels, sizeof(double *));
    for (int k = 0; k < model->n_kernels; k++) {
        given[k] = states_of(model->kernels + k);
        try_plain(k);
        for (int l = 0; model->lanes != NULL && model->lanes[l] != NULL; l++) {
            if (model->lanes[l]->usable() && model->lanes[l]->kernels[k] != NULL) {
                try_lanes(model->lanes[l], k);
            }
        }
    }
    try_threads();
    for (int k = 0; k < model->n_kernels; k++) {
        free(given[k]);
    }
    free(given), free(p), free(u), free(c), free(q);
    printf("calls %ld lanes %ld kernels %d faults %ld\n", calls, lane_calls, model->n_kernels, faults);
    return faults == 0 ? 0 : 1;
}
