/* One trajectory after the other from a queue that threads share. */
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
        return worker->memory(e, own);
    }
    return memory_of_one(e);
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
    double *const times = lay_out_one(&run, e, own);
    run.callback = callback_stop, run.callback_data = e;
    for (ptrdiff_t k = eomgen_ensemble_take(e); k >= 0; k = eomgen_ensemble_take(e)) {
        run_one(e, &run, own, own->memory, times, k);
        __atomic_fetch_add(&e->done, 1, __ATOMIC_RELAXED);
    }
}
