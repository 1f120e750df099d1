/* Taylor's method in lanes. Its round differs: coefficients come first and tell the step, and none is tried in vain. */
/* The polynomial at h from its start. */
static void taylor_sum(const lane_run *run, real h, real *restrict y)
{
    const int n = run->n;
    const real *row = run->K + run->order * n;
    for (int i = 0; i < n; i++) {
        y[i] = row[i];
    }
    for (int m = run->order; m-- > 0;) {
        row -= n;
        for (int i = 0; i < n; i++) {
            y[i] = y[i] * h + row[i];
        }
    }
}

static void taylor_attempt(lane_run *run, real h)
{
    run->calls++;
    taylor_sum(run, h, run->y);
}

static real taylor_error(const lane_run *run, real h)
{
    (void)run, (void)h;
    return same(0.0);
}

static const lane_method lane_taylor = {"Taylor", TAYLOR_MOST + 1, TAYLOR_MOST, 7, taylor_attempt, taylor_error,
                                        taylor_prepare, taylor_interpolate};

/* Coefficients at the states of all lanes, and the sizes of their steps; NaN where there is none to take. */
static void expand_lanes(const eomgen_ensemble *e, lane_run *run)
{
    const int p = run->order;
    if (run->signals != NULL) {
        read_tables(run, run->t);
    }
    const flag failed = run->expand(run->t, run->y, run->u, run->c, p, run->K, run->K + (TAYLOR_MOST + 1) * run->n);
    const real before = taylor_size(run, p - 1), last = taylor_size(run, p);
    for (int l = 0; l < W; l++) {
        const double size = failed[l] ? NAN : taylor_reach(before[l], last[l], p);
        if (run->active[l] && isnan(size)) {
            run->failure[l] = failed[l] ? EOMGEN_SINGULAR_MASS_MATRIX : EOMGEN_NON_FINITE, run->failure_time[l] = run->t[l];
        }
        run->size[l] = run->steps[l] == 0 && e->first_step > 0.0 && e->first_step < size ? e->first_step : size;
    }
}
