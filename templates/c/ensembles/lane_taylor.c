/* Taylor's method in lanes. Its round begins with coefficients, which tell the step: those that the last step ended with,
   or new ones where a lane begins. */
static void expand_lanes(lane_run *run, real t, const real *y, flag wanted)
{
    real *const rows = run->K + (TAYLOR_MOST + 1) * run->n;
    if (run->signals != NULL) {
        read_tables(run, t);
    }
    const flag failed = run->expand(t, y, run->u, run->c, run->order, rows, rows + (TAYLOR_MOST + 1) * run->n);
    real sum = same(0.0); /* NaN where a result is not finite */
    for (int i = 0; i < run->n; i++) {
        sum += rows[run->n + i] * 0.0;
    }
    const flag bad = failed | (sum != 0.0);
    if (any_of(bad & wanted)) {
        run->awake = wanted;
        note_failures(run, t, y, rows + run->n, failed, bad);
    }
}

static void taylor_attempt(lane_run *run, real h)
{
    const flag awake = run->awake;
    taylor_sum(run, run->K, h, run->y, run->f);
    run->calls++;
    expand_lanes(run, run->t_new, run->y, awake);
    run->awake = awake;
}

static real taylor_error(const lane_run *run, real h)
{
    return taylor_defect(run, h, run->f, run->K + (TAYLOR_MOST + 2) * run->n);
}

static const lane_method lane_taylor = {"Taylor", 2 * (TAYLOR_MOST + 1), TAYLOR_MOST, 0, taylor_attempt, taylor_error,
                                        taylor_prepare, taylor_interpolate}; /* order 0: rejected steps are halved */

/* Coefficients at the states of all lanes, and the sizes of the steps to try; NaN where there is none. */
static void begin_taylor(const eomgen_ensemble *e, lane_run *run)
{
    const int p = run->order, last = (p + 1) * run->n;
    const real *const after = run->K + (TAYLOR_MOST + 1) * run->n;
    const flag begins = run->begins & run->active, moved = run->active & ~begins & ~run->again;
    for (int i = 0; i < last; i++) {
        run->K[i] = choose(moved, after[i], run->K[i]);
    }
    if (any_of(begins)) {
        expand_lanes(run, run->t, run->y, begins);
        run->evaluations -= begins;
        for (int i = 0; i < last; i++) {
            run->K[i] = choose(begins, after[i], run->K[i]);
        }
    }
    real before, size;
    taylor_sizes(run, run->K, p, &before, &size);
    for (int l = 0; l < W; l++) {
        if (!begins[l] && !moved[l]) {
            continue; /* tries again, or has nothing to do */
        }
        const double reach = taylor_reach(before[l], size[l], p);
        run->size[l] = run->steps[l] == 0 && e->first_step > 0.0 && e->first_step < reach ? e->first_step : reach;
    }
    run->begins = (flag){ 0 };
}
