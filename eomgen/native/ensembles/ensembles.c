/* One trajectory of an ensemble, from its initial values to what is kept of it; on processors and on devices alike. */
#include <math.h>
#include <string.h>

#include "eomgen_ensembles.h"

/* Doubles of memory for one trajectory at a time. */
static ptrdiff_t memory_of_one(const eomgen_ensemble *e)
{
    const eomgen_model *const model = e->model;
    return model->n_work + model->n_u + model->n_const + eomgen_rows(e->method, e->n, e->series) + e->n_eval;
}

double *eomgen_set_up(eomgen_run *run, const eomgen_ensemble *e, const eomgen_thread *own, double *w, double *memory)
{
    memset(run, 0, sizeof *run);
    run->rhs = e->rhs, run->jacobian = e->jacobian, run->series = e->series, run->meeting = e->meeting, run->n_q = e->n_q;
    run->signals = own->signals, run->n_u = e->model->n_u, run->n = e->n;
    run->rtol = e->rtol, run->atol = e->atol, run->max_step = e->max_step, run->most_steps = e->max_steps;
    run->w = w, run->closed = e->model->closed_at ? w + e->model->closed_at : NULL;
    run->c = memory, run->u = memory + e->model->n_const;
    return eomgen_lay_out(run, e->method, run->u + e->model->n_u);
}

void eomgen_keep_notes(eomgen_ensemble *e, eomgen_trajectory *trajectory, ptrdiff_t k)
{
    const ptrdiff_t width = 2 + e->n;
    for (ptrdiff_t i = 0; i < trajectory->n_notes; i++, e->noted[k]++) {
        if (e->noted[k] < e->n_notes) {
            memcpy(e->notes + (k * e->n_notes + e->noted[k]) * width, trajectory->notes + i * width,
                   (size_t)width * sizeof(double));
        }
    }
    trajectory->n_notes = 0;
}

static int advance(eomgen_ensemble *e, eomgen_run *run, eomgen_trajectory *trajectory, ptrdiff_t k)
{
    int status = EOMGEN_FULL;
    while (status == EOMGEN_FULL) {
        status = eomgen_advance(e->method, run, trajectory);
        if (trajectory->events != NULL) {
            eomgen_keep_notes(e, trajectory, k);
        }
    }
    return status;
}

static void run_one(eomgen_ensemble *e, eomgen_run *run, const eomgen_thread *own, double *times, ptrdiff_t k)
{
    const size_t size = (size_t)e->n * sizeof(double);
    eomgen_trajectory trajectory;
    memset(&trajectory, 0, sizeof trajectory);
    trajectory.nodes = e->nodes + 1, trajectory.n_nodes = e->n_nodes - 1;
    trajectory.t_eval = e->t_eval, trajectory.n_eval = e->n_eval;
    trajectory.span = fabs(e->nodes[e->n_nodes - 1] - e->nodes[0]);
    trajectory.room = e->n_eval, trajectory.times = times;
    trajectory.states = e->n_eval > 0 ? e->samples + k * e->n_eval * e->n : NULL;
    trajectory.events = own->events, trajectory.notes = own->notes, trajectory.notes_room = own->notes_room;
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
    if (EOMGEN_PRECOMPUTE(e->model)(e->p + k * e->p_stride, (double *)run->c) == 0) {
        status = advance(e, run, &trajectory, k);
    }
    for (ptrdiff_t j = trajectory.stored * e->n; j < e->n_eval * e->n; j++) {
        trajectory.states[j] = (double)NAN;
    }
    memcpy(e->x + k * e->n, run->y, size);
    e->t[k] = run->t;
    e->status[k] = status == EOMGEN_END ? 0 : status == EOMGEN_TERMINAL ? 1 : status;
    e->steps[k] = run->steps, e->rejected[k] = run->rejected, e->evaluations[k] = run->evaluations;
    e->failure[k] = run->failure, e->failure_time[k] = run->failure_time;
}

/* One trajectory after the other from a queue that threads share. */
#ifndef EOMGEN_DEVICE
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
    return worker != NULL ? worker->memory(e, own) : memory_of_one(e);
}

static long callback_stop(void *callback_data, const double *t)
{
    (void)t;
    return __atomic_load_n(&((const eomgen_ensemble *)callback_data)->stop, __ATOMIC_RELAXED) ? 0 : EOMGEN_CALLBACK_STRIDE;
}

void eomgen_ensemble_work(eomgen_ensemble *e, const eomgen_thread *own)
{
    const eomgen_lane_worker *const worker = find_worker(e, own);
    if (worker != NULL) {
        worker->work(e, own);
        return;
    }
    eomgen_run run;
    double *const times = eomgen_set_up(&run, e, own, own->memory, own->memory + e->model->n_work);
    run.callback = callback_stop, run.callback_data = e;
    for (ptrdiff_t k = eomgen_ensemble_take(e); k >= 0; k = eomgen_ensemble_take(e)) {
        run_one(e, &run, own, times, k);
        __atomic_fetch_add(&e->done, 1, __ATOMIC_RELAXED);
    }
}
#endif
