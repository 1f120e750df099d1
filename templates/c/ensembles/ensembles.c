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
static const eomgen_lane_worker *find_worker(const eomgen_ensemble *e, const eomgen_thread *own)
{
    for (int i = 0; e->lane_rhs != NULL && lane_workers[i] != NULL; i++) {
        if (lane_workers[i]->width == e->lane_width && lane_workers[i]->takes(e, own)) {
            return lane_workers[i];
        }
    }
    return NULL;
}

ptrdiff_t eomgen_ensemble_take(eomgen_ensemble *e)
{
    if (__atomic_load_n(&e->stop, __ATOMIC_RELAXED)) {
        return -1;
    }
    const ptrdiff_t k = __atomic_fetch_add(&e->next, 1, __ATOMIC_RELAXED);
    return k < e->count ? k : -1;
}

ptrdiff_t eomgen_ensemble_memory(const eomgen_ensemble *e, const eomgen_thread *own)
{
    const eomgen_lane_worker *const worker = find_worker(e, own);
    if (worker != NULL) {
        return worker->memory(e);
    }
    const ptrdiff_t rows = 5 + e->method->rows_K + e->method->rows_F;
    const ptrdiff_t further = eomgen_further(e->method, e->n, e->series);
    return e->model->n_work + e->model->n_u + e->model->n_const + rows * e->n + further + e->n_eval;
}

static long callback_stop(void *callback_data, const double *t)
{
    (void)t;
    return __atomic_load_n(&((const eomgen_ensemble *)callback_data)->stop, __ATOMIC_RELAXED) ? 0 : EOMGEN_CALLBACK_STRIDE;
}

/* Keep the events noted by now, as many as there is room for. */
static void keep_notes(eomgen_ensemble *e, eomgen_journey *journey, ptrdiff_t k)
{
    const ptrdiff_t width = 2 + e->n;
    for (ptrdiff_t i = 0; i < journey->n_notes; i++, e->noted[k]++) {
        if (e->noted[k] < e->n_notes) {
            memcpy(e->notes + (k * e->n_notes + e->noted[k]) * width, journey->notes + i * width,
                   (size_t)width * sizeof(double));
        }
    }
    journey->n_notes = 0;
}

static int travel(eomgen_ensemble *e, eomgen_run *run, eomgen_journey *journey, ptrdiff_t k)
{
    int status = EOMGEN_FULL;
    while (status == EOMGEN_FULL) {
        status = eomgen_travel(e->method, run, journey);
        if (journey->events != NULL) {
            keep_notes(e, journey, k);
        }
    }
    return status;
}

static void run_one(eomgen_ensemble *e, eomgen_run *run, const eomgen_thread *own, double *constants, double *times, ptrdiff_t k)
{
    const size_t size = (size_t)e->n * sizeof(double);
    eomgen_journey journey;
    memset(&journey, 0, sizeof journey);
    journey.nodes = e->nodes + 1, journey.n_nodes = e->n_nodes - 1;
    journey.t_eval = e->t_eval, journey.n_eval = e->n_eval;
    journey.span = fabs(e->nodes[e->n_nodes - 1] - e->nodes[0]);
    journey.room = e->n_eval, journey.times = times;
    journey.states = e->n_eval > 0 ? e->samples + k * e->n_eval * e->n : NULL;
    journey.events = own->events, journey.notes = own->notes, journey.notes_room = own->notes_room;
    if (own->events != NULL) {
        memset(own->events->count, 0, (size_t)own->events->n * sizeof(long));
        own->events->crowded = 0;
    }
    run->evaluations = run->rejected = run->steps = run->failure = run->stopped = 0;
    run->failure_time = 0.0;
    run->until_callback = EOMGEN_CALLBACK_STRIDE;
    run->t = run->t_old = e->nodes[0];
    run->h_abs = e->first_step;
    memcpy(run->y, e->x0 + k * e->n, size);
    memcpy(run->u, e->u + k * e->u_stride, (size_t)e->model->n_u * sizeof(double));
    int status = EOMGEN_BAD_PARAMETERS;
    if (e->model->precompute(e->p + k * e->p_stride, constants) == 0) {
        status = travel(e, run, &journey, k);
    }
    for (ptrdiff_t j = journey.stored * e->n; j < e->n_eval * e->n; j++) {
        journey.states[j] = (double)NAN;
    }
    memcpy(e->x + k * e->n, run->y, size);
    e->t[k] = run->t;
    e->status[k] = status == EOMGEN_END ? 0 : status == EOMGEN_TERMINAL ? 1 : status;
    e->steps[k] = run->steps, e->rejected[k] = run->rejected, e->evaluations[k] = run->evaluations;
    e->failure[k] = run->failure, e->failure_time[k] = run->failure_time;
}

void eomgen_ensemble_work(eomgen_ensemble *e, const eomgen_thread *own)
{
    const eomgen_lane_worker *const worker = find_worker(e, own);
    if (worker != NULL) {
        worker->work(e, own);
        return;
    }
    const int n = e->n;
    eomgen_run run;
    memset(&run, 0, sizeof run);
    double *const constants = own->memory;
    run.rhs = e->rhs, run.jacobian = e->jacobian, run.series = e->series;
    run.c = constants, run.signals = own->signals, run.n_u = e->model->n_u, run.n = n;
    run.rtol = e->rtol, run.atol = e->atol, run.max_step = e->max_step, run.most_steps = e->max_steps;
    run.callback = callback_stop, run.callback_data = e;
    run.w = constants + e->model->n_const;
    run.u = run.w + e->model->n_work;
    run.y = run.u + e->model->n_u;
    run.y_old = run.y + n, run.f = run.y_old + n, run.failure_state = run.f + n;
    run.next = run.failure_state + n;
    run.closed = e->model->closed_at ? run.w + e->model->closed_at : NULL;
    run.K = run.next + n;
    run.F = run.K + e->method->rows_K * n + eomgen_further(e->method, e->n, e->series);
    double *const times = run.F + e->method->rows_F * n;
    for (ptrdiff_t k = eomgen_ensemble_take(e); k >= 0; k = eomgen_ensemble_take(e)) {
        run_one(e, &run, own, constants, times, k);
        __atomic_fetch_add(&e->done, 1, __ATOMIC_RELAXED);
    }
}
