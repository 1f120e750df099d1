/* One trajectory after the other from a queue that threads share. */
#include <math.h>
#include <string.h>

#include "eomgen_ensembles.h"

EOMGEN_PIECE extern const eomgen_lane_worker eomgen_lane_worker2, eomgen_lane_worker4, eomgen_lane_worker8;

static const eomgen_lane_worker *const lane_workers[] = {
#if EOMGEN_LANES & 8
    &eomgen_lane_worker8,
#endif
#if EOMGEN_LANES & 4
    &eomgen_lane_worker4,
#endif
#if EOMGEN_LANES & 2
    &eomgen_lane_worker2,
#endif
    NULL
};

/* Who runs this ensemble in lanes; NULL: nobody. */
static const eomgen_lane_worker *find_worker(const eomgen_ensemble *e)
{
    for (int i = 0; e->lane_rhs != NULL && lane_workers[i] != NULL; i++) {
        if (lane_workers[i]->width == e->lane_width) {
            return lane_workers[i];
        }
    }
    return NULL;
}

long eomgen_ensemble_take(eomgen_ensemble *e)
{
    if (__atomic_load_n(&e->stop, __ATOMIC_RELAXED)) {
        return -1;
    }
    const long k = __atomic_fetch_add(&e->next, 1, __ATOMIC_RELAXED);
    return k < e->count ? k : -1;
}

long eomgen_ensemble_memory(const eomgen_ensemble *e)
{
    const eomgen_lane_worker *const worker = find_worker(e);
    if (worker != NULL) {
        return worker->memory(e);
    }
    const long rows = 4 + e->method->rows_K + e->method->rows_F;
    return e->model->n_work + e->model->n_u + e->model->n_const + rows * e->n;
}

/* Store the states at the times asked for that the run has reached. */
static void sample(const eomgen_ensemble *e, eomgen_run *run, long k, long *done)
{
    while (*done < e->n_eval && run->direction * (e->t_eval[*done] - run->t) <= 0.0) {
        double *const row = e->samples + (k * e->n_eval + *done) * e->n;
        if (run->t == e->t_eval[*done]) {
            memcpy(row, run->y, (size_t)e->n * sizeof(double));
        } else {
            eomgen_between(e->method, run, e->t_eval[*done], row);
        }
        ++*done;
    }
}

/* From one node to the next: 0, or how it ended. */
static int run_part(eomgen_ensemble *e, eomgen_run *run, long k, long *done)
{
    while (run->direction * (run->t - run->t_bound) < 0.0) {
        if (e->steps[k] >= e->max_steps) {
            return EOMGEN_TOO_MANY_STEPS;
        }
        if (e->steps[k] % EOMGEN_GLANCE == EOMGEN_GLANCE - 1 && __atomic_load_n(&e->stop, __ATOMIC_RELAXED)) {
            return EOMGEN_NOT_RUN;
        }
        const int status = eomgen_step(e->method, run);
        if (status != 0) {
            return status;
        }
        e->steps[k]++;
        sample(e, run, k, done);
    }
    return 0;
}

static void run_one(eomgen_ensemble *e, eomgen_run *run, double *constants, long k)
{
    const size_t size = (size_t)e->n * sizeof(double);
    long done = 0;
    int status = e->model->precompute(e->p + k * e->p_stride, constants) == 0 ? 0 : EOMGEN_BAD_PARAMETERS;
    run->evaluations = run->rejected = run->failure = 0;
    run->t = run->t_old = e->nodes[0];
    memcpy(run->y, e->x0 + k * e->n, size);
    memcpy(run->u, e->u + k * e->u_stride, (size_t)e->model->n_u * sizeof(double));
    run->direction = e->nodes[e->n_nodes - 1] < e->nodes[0] ? -1.0 : 1.0;
    e->steps[k] = 0;
    sample(e, run, k, &done);
    for (int i = 1; i < e->n_nodes && status == 0; i++) {
        run->t_bound = e->nodes[i];
        run->h_abs = fmin(e->first_step, fabs(e->nodes[i] - e->nodes[i - 1]));
        eomgen_start(e->method, run);
        status = run_part(e, run, k, &done);
    }
    for (long j = done * e->n; j < e->n_eval * e->n; j++) {
        e->samples[k * e->n_eval * e->n + j] = NAN;
    }
    memcpy(e->x + k * e->n, run->y, size);
    e->t[k] = run->t;
    e->status[k] = status;
    e->rejected[k] = run->rejected, e->evaluations[k] = run->evaluations;
    e->failure[k] = run->failure, e->failure_time[k] = run->failure_time;
}

void eomgen_ensemble_work(eomgen_ensemble *e, double *memory)
{
    const eomgen_lane_worker *const worker = find_worker(e);
    if (worker != NULL) {
        worker->work(e, memory);
        return;
    }
    const int n = e->n;
    eomgen_run run;
    memset(&run, 0, sizeof run);
    double *const constants = memory;
    run.rhs = e->rhs, run.c = constants, run.signals = e->signals, run.n_u = e->model->n_u, run.n = n;
    run.rtol = e->rtol, run.atol = e->atol, run.max_step = e->max_step;
    run.w = constants + e->model->n_const;
    run.u = run.w + e->model->n_work;
    run.y = run.u + e->model->n_u;
    run.y_old = run.y + n, run.f = run.y_old + n, run.failure_state = run.f + n;
    run.K = run.failure_state + n;
    run.F = run.K + e->method->rows_K * n;
    for (long k = eomgen_ensemble_take(e); k >= 0; k = eomgen_ensemble_take(e)) {
        run_one(e, &run, constants, k);
        __atomic_fetch_add(&e->done, 1, __ATOMIC_RELAXED);
    }
}
