/* Calls every function of one generated library as its headers allow: c_code.py writes the numbers and reads the report.

   Every array has exactly the length the headers ask for, so that a sanitizer sees each access beyond; the work array is
   not initialised, which valgrind watches. What must not depend on something is computed twice and compared bit by bit:
   the rubbish in the work array, the alignment of arrays (8 bytes suffice outside lanes), lanes, and 8 threads at once. */
#define _POSIX_C_SOURCE 200112L
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "eomgen_ensembles.h"

enum { THREADS = 8, WIDEST = 8 };

static const eomgen_model *model;
static int n_states;
static long calls, lane_calls, faults;
static double *p, *u, *c, **given; /* given[k]: n_states rows of the kernel's input */
static double *times;

static void complain(const char *what, const char *name, int which)
{
    faults++;
    printf("fault: %s: %s, %d\n", name, what, which);
}

/* Doubles that begin at a multiple of 8*width bytes and, in plain calls, at no multiple of 16. */
static double *room(size_t n, int width)
{
    void *memory = NULL;
    const size_t bytes = n * (size_t)width * sizeof(double), align = sizeof(double) * (size_t)(width < 2 ? 2 : width);
    if (posix_memalign(&memory, align, bytes > 0 ? bytes : 1) != 0) {
        abort();
    }
    return (double *)memory;
}

static double *odd_room(size_t n, void **owner)
{
    *owner = malloc((n + 1) * sizeof(double));
    if (*owner == NULL) {
        abort();
    }
    return (double *)*owner + 1; /* malloc gives a multiple of 16 */
}

static void read_into(double *target, size_t n, FILE *file)
{
    if (fread(target, sizeof(double), n, file) != n) {
        abort();
    }
}

static int same_bits(const double *a, const double *b, size_t n)
{
    return n == 0 || memcmp(a, b, n * sizeof(double)) == 0;
}

/* One plain call; out is what it gives, arrays of the caller stay as they are. */
static int call(int k, int j, double *out, double *w)
{
    const eomgen_kernel *const kernel = model->kernels + k;
    return kernel->call(times[j], given[k] + (size_t)j * (size_t)kernel->n_in, u, c, out, w);
}

static void try_plain(int k)
{
    const eomgen_kernel *const kernel = model->kernels + k;
    const size_t n = (size_t)kernel->n_out, n_in = (size_t)kernel->n_in, n_work = (size_t)model->n_work;
    for (int j = 0; j < n_states; j++) {
        double *const out = room(n, 1), *const w = room(n_work, 1); /* uninitialised */
        void *owners[3];
        double *const odd_x = odd_room(n_in, owners), *const odd = odd_room(n, owners + 1);
        double *const dirty = odd_room(n_work, owners + 2);
        if (call(k, j, NULL, w) != 0) {
            complain("fails where no result is wanted", kernel->name, j);
        }
        const int status = call(k, j, out, w);
        memcpy(odd_x, given[k] + (size_t)j * n_in, n_in * sizeof(double));
        memset(dirty, j % 2 ? 0xff : 0x7f, n_work * sizeof(double)); /* NaN, or 1.4e306 */
        const int again = kernel->call(times[j], odd_x, u, c, odd, dirty);
        if (status != again || (status == 0 && !same_bits(out, odd, n))) {
            complain("depends on alignment or on what was in the work array", kernel->name, j);
        }
        if (!same_bits(odd_x, given[k] + (size_t)j * n_in, n_in)) {
            complain("changes its input", kernel->name, j);
        }
        free(out), free(w), free(owners[0]), free(owners[1]), free(owners[2]);
        calls += 3;
    }
}

/* Batches of 1 to 2*width + 1 states, the last group filled with its last state, as the layer does. */
static void try_lanes(const eomgen_lanes *lanes, int k)
{
    const eomgen_kernel *const kernel = model->kernels + k;
    const int W = lanes->width;
    const size_t n_in = (size_t)kernel->n_in, n = (size_t)kernel->n_out, n_c = (size_t)model->n_const;
    const size_t n_u = (size_t)model->n_u;
    for (int count = 1; count <= 2 * W + 1; count += count < 3 ? 1 : W - 1) {
        for (int first = 0; first < count; first += W) {
            double *const t = room(1, W), *const x = room(n_in, W), *const lane_u = room(n_u, W);
            double *const lane_c = room(n_c, W), *const out = room(n, W), *const w = room((size_t)model->n_work, W);
            double *const plain = room(n, 1), *const plain_w = room((size_t)model->n_work, 1);
            int status[WIDEST], worst = 0;
            for (int l = 0; l < W; l++) {
                const int j = (first + l < count ? first + l : count - 1) % n_states;
                t[l] = times[j];
                for (size_t i = 0; i < n_in; i++) {
                    x[i * (size_t)W + (size_t)l] = given[k][(size_t)j * n_in + i];
                }
                for (size_t i = 0; i < n_u; i++) {
                    lane_u[i * (size_t)W + (size_t)l] = u[i];
                }
                for (size_t i = 0; i < n_c; i++) {
                    lane_c[i * (size_t)W + (size_t)l] = c[i];
                }
            }
            const int result = lanes->kernels[k](t, x, lane_u, lane_c, out, w, status);
            for (int l = 0; l < W; l++) {
                const int j = (first + l < count ? first + l : count - 1) % n_states, one = call(k, j, plain, plain_w);
                worst |= status[l];
                if (status[l] == EOMGEN_LEFT_ALONE) { /* the function of one state is to be called for it */
                    continue;
                }
                if (one != status[l]) {
                    complain("a lane has another status", kernel->name, j);
                }
                for (size_t i = 0; one == 0 && i < n; i++) {
                    if (!same_bits(plain + i, out + i * (size_t)W + (size_t)l, 1)) {
                        complain("a lane has other bits", kernel->name, j);
                        break;
                    }
                }
            }
            if ((worst != 0) != (result != 0)) {
                complain("returns another status than its lanes", kernel->name, W);
            }
            free(t), free(x), free(lane_u), free(lane_c), free(out), free(w), free(plain), free(plain_w);
            lane_calls++;
        }
    }
}

static void try_series(const double *x)
{
    const eomgen_series *const series = model->series;
    int n = 0;
    for (int k = 0; k < model->n_kernels; k++) {
        n = strcmp(model->kernels[k].name, "rhs") == 0 ? model->kernels[k].n_in : n;
    }
    double *const w = (double *)calloc((size_t)series->n_work + 1, sizeof(double));
    for (int order = 0; order <= series->most; order++) {
        double *const out = room((size_t)((order + 1) * n), 1);
        (void)series->expand(times[0], x, u, c, order, out, w);
        free(out);
        calls++;
    }
    free(w);
}

typedef struct {
    double *out;
    int *status;
} record;

static void *all_again(void *target)
{
    const record *const mine = (const record *)target;
    double *const w = room((size_t)model->n_work, 1);
    size_t at = 0;
    for (int k = 0, row = 0; k < model->n_kernels; k++) {
        for (int j = 0; j < n_states; j++, row++) {
            mine->status[row] = call(k, j, mine->out + at, w);
            at += (size_t)model->kernels[k].n_out;
        }
    }
    free(w);
    return NULL;
}

static void try_threads(void)
{
    size_t n = 0, rows = (size_t)(model->n_kernels * n_states);
    record records[THREADS + 1];
    pthread_t threads[THREADS];
    for (int k = 0; k < model->n_kernels; k++) {
        n += (size_t)(n_states * model->kernels[k].n_out);
    }
    for (int i = 0; i <= THREADS; i++) {
        records[i].out = (double *)calloc(n + 1, sizeof(double));
        records[i].status = (int *)calloc(rows, sizeof(int));
    }
    all_again(records);
    for (int i = 0; i < THREADS; i++) {
        if (pthread_create(threads + i, NULL, all_again, records + i + 1) != 0) {
            abort();
        }
    }
    for (int i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
    }
    for (int i = 1; i <= THREADS; i++) {
        if (memcmp(records[i].status, records[0].status, rows * sizeof(int)) != 0) {
            complain("another status in a thread", "all", i);
        }
        size_t at = 0;
        for (int k = 0, row = 0; k < model->n_kernels; k++) {
            const size_t size = (size_t)model->kernels[k].n_out;
            for (int j = 0; j < n_states; j++, row++, at += size) {
                if (records[0].status[row] == 0 && !same_bits(records[0].out + at, records[i].out + at, size)) {
                    complain("other bits in a thread", model->kernels[k].name, i);
                }
            }
        }
    }
    for (int i = 0; i <= THREADS; i++) {
        free(records[i].out), free(records[i].status);
    }
}

static void *join_in(void *ensemble)
{
    eomgen_ensemble *const e = (eomgen_ensemble *)ensemble;
    eomgen_thread own;
    memset(&own, 0, sizeof own);
    own.memory = room((size_t)eomgen_ensemble_memory(e, &own), 1);
    memset(own.memory, 0, (size_t)eomgen_ensemble_memory(e, &own) * sizeof(double));
    eomgen_ensemble_work(e, &own);
    free(own.memory);
    return NULL;
}

/* A run of `count` states by one method, with lanes if there are any, by so many threads; the last states into x. */
static void run_ensemble(const eomgen_method *method, const eomgen_lanes *lanes, int rhs, int jacobian, int count,
    int threads, double *x, int *status)
{
    const int n = model->kernels[rhs].n_in;
    const double nodes[2] = {0.0, 0.02}, t_eval[2] = {0.01, 0.02};
    eomgen_ensemble e;
    memset(&e, 0, sizeof e);
    double *const atol = room((size_t)n, 1), *const x0 = room((size_t)(n * count), 1);
    double *const samples = room((size_t)(n * count * 2), 1), *const t = room((size_t)count, 1);
    double *const late = room((size_t)count, 1);
    int *const failure = (int *)calloc((size_t)count, sizeof(int));
    int64_t *const numbers = (int64_t *)calloc((size_t)(4 * count), sizeof(int64_t));
    for (int i = 0; i < n; i++) {
        atol[i] = 1e-9;
    }
    for (int k = 0; k < count; k++) {
        memcpy(x0 + k * n, given[rhs] + (k % n_states) * n, (size_t)n * sizeof(double));
        late[k] = 0.0;
    }
    e.method = eomgen_suited(method, n), e.model = model, e.rhs = model->kernels[rhs].call, e.series = model->series;
    e.jacobian = jacobian < 0 ? NULL : model->kernels[jacobian].call;
    if (lanes != NULL) {
        e.lane_rhs = lanes->contracted, e.lane_series = lanes->expand, e.lane_width = lanes->width;
    }
    e.n = n, e.count = count, e.x0 = x0, e.p = p, e.u = u, e.nodes = nodes, e.n_nodes = 2, e.rtol = 1e-6;
    e.max_step = 0.01, e.atol = atol, e.max_steps = 200, e.t_eval = t_eval, e.n_eval = 2, e.samples = samples, e.x = x;
    e.t = t, e.status = status, e.steps = numbers, e.rejected = numbers + count, e.evaluations = numbers + 2 * count;
    e.noted = numbers + 3 * count, e.failure = failure, e.failure_time = late;
    pthread_t others[THREADS];
    for (int i = 1; i < threads; i++) {
        if (pthread_create(others + i, NULL, join_in, &e) != 0) {
            abort();
        }
    }
    join_in(&e);
    for (int i = 1; i < threads; i++) {
        pthread_join(others[i], NULL);
    }
    free(atol), free(x0), free(samples), free(t), free(late), free(failure), free(numbers);
}

static void try_ensembles(int rhs, int jacobian)
{
    const eomgen_method *const methods[] = {
        &eomgen_dop853, &eomgen_rk45, &eomgen_rk23, &eomgen_rk4, &eomgen_radau, &eomgen_taylor};
    const int count = 2 * WIDEST + 1;
    const size_t n = (size_t)(model->kernels[rhs].n_in * count);
    for (int m = 0; m < 6; m++) {
        if ((methods[m]->squares > 0 && jacobian < 0) || (methods[m]->expands && model->series == NULL)) {
            continue;
        }
        for (int l = -1; l < 0 || (model->lanes != NULL && model->lanes[l] != NULL); l++) {
            const eomgen_lanes *const lanes = l < 0 ? NULL : model->lanes[l];
            if (lanes != NULL && !lanes->usable()) {
                continue;
            }
            double *const x = (double *)calloc(n, sizeof(double)), *const again = (double *)calloc(n, sizeof(double));
            int status[2 * WIDEST + 1], other[2 * WIDEST + 1];
            run_ensemble(methods[m], lanes, rhs, jacobian, count, 1, x, status);
            run_ensemble(methods[m], lanes, rhs, jacobian, count, THREADS, again, other);
            for (int k = 0; k < count; k++) {
                const size_t size = n / (size_t)count, at = (size_t)k * size;
                if (status[k] != other[k] || (status[k] == 0 && !same_bits(x + at, again + at, size))) {
                    complain("an ensemble depends on its threads", methods[m]->name, k);
                }
            }
            free(x), free(again);
            calls += count;
        }
    }
}

int main(int argc, char **argv)
{
    FILE *const file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    double head[1];
    int rhs = -1, jacobian = -1, widths = 0;
    if (file == NULL) {
        return 2;
    }
    model = eomgen_model_table();
    read_into(head, 1, file);
    n_states = (int)head[0];
    p = room((size_t)model->n_p, 1), u = room((size_t)model->n_u, 1), c = room((size_t)model->n_const, 1);
    times = room((size_t)n_states, 1);
    read_into(p, (size_t)model->n_p, file);
    read_into(u, (size_t)model->n_u, file);
    read_into(times, (size_t)n_states, file);
    given = (double **)calloc((size_t)model->n_kernels, sizeof(double *));
    for (int k = 0; k < model->n_kernels; k++) {
        given[k] = room((size_t)(n_states * model->kernels[k].n_in), 1);
        read_into(given[k], (size_t)(n_states * model->kernels[k].n_in), file);
        rhs = strcmp(model->kernels[k].name, "rhs") == 0 ? k : rhs;
        jacobian = strcmp(model->kernels[k].name, "jacobian") == 0 ? k : jacobian;
    }
    fclose(file);
    if (model->precompute(p, NULL) != 0 || model->precompute(p, c) != 0) {
        complain("constants cannot be computed", "precompute", 0);
    }
    for (int k = 0; k < model->n_kernels; k++) {
        try_plain(k);
        for (int l = 0; model->lanes != NULL && model->lanes[l] != NULL; l++) {
            if (model->lanes[l]->usable() && model->lanes[l]->kernels[k] != NULL) {
                try_lanes(model->lanes[l], k);
                widths |= model->lanes[l]->width;
            }
        }
    }
    if (model->series != NULL && rhs >= 0) {
        try_series(given[rhs]);
    }
    try_threads();
    if (rhs >= 0) {
        try_ensembles(rhs, jacobian);
    }
    for (int k = 0; k < model->n_kernels; k++) {
        free(given[k]);
    }
    free(given), free(p), free(u), free(c), free(times);
    printf("calls %ld lanes %ld widths %d kernels %d faults %ld\n", calls, lane_calls, widths, model->n_kernels, faults);
    return faults == 0 ? 0 : 1;
}
