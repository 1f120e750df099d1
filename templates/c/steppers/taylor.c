/* Taylor's method for one state: see taylor_terms.c. The work of the series follows the rows in run->K. */
static void taylor_begin(eomgen_run *run)
{
    run->order = taylor_order(run->rtol, run->series->most);
}

/* The polynomial at h from its start, and its rate. */
static void taylor_sum_and_rate(const eomgen_run *run, double h, double *restrict y, double *restrict f)
{
    const int n = run->n;
    const double *row = run->K + run->order * n;
    for (int i = 0; i < n; i++) {
        y[i] = row[i], f[i] = 0.0;
    }
    for (int m = run->order; m-- > 0;) {
        row -= n;
        for (int i = 0; i < n; i++) {
            f[i] = f[i] * h + y[i];
            y[i] = y[i] * h + row[i];
        }
    }
}

static int taylor_step(eomgen_run *run)
{
    const int n = run->n, p = run->order;
    const double least = 10.0 * fabs(nextafter(run->t, run->direction * INFINITY) - run->t);
    if (run->most_steps > 0 && run->steps >= run->most_steps) {
        return EOMGEN_TOO_MANY_STEPS;
    }
    if ((--run->look_in == 0 || run->stopped || run->signals != NULL) && !eomgen_ready(run, run->t, run->y, run->f)) {
        return EOMGEN_STOPPED;
    }
    const int status = run->series->expand(run->t, run->y, run->u, run->c, p, run->K, run->K + (TAYLOR_MOST + 1) * n);
    run->evaluations++;
    double h_abs = taylor_reach(taylor_size(run, p - 1), taylor_size(run, p), p);
    h_abs = run->h_abs > 0.0 && run->h_abs < h_abs ? run->h_abs : h_abs; /* NaN stays */
    h_abs = h_abs > run->max_step ? run->max_step : h_abs;
    if (status != 0 || !(h_abs >= least)) {
        if (status != 0 || isnan(h_abs)) {
            eomgen_note(run, status != 0 ? status : EOMGEN_NON_FINITE, run->t, run->y);
        }
        return EOMGEN_STEP_TOO_SMALL;
    }
    double t_new = run->t + h_abs * run->direction;
    if (run->direction * (t_new - run->t_bound) > 0.0) {
        t_new = run->t_bound;
    }
    double *const spare = run->y_old;
    run->y_old = run->y, run->y = spare;
    run->t_old = run->t, run->t = t_new, run->step = t_new - run->t_old;
    taylor_sum_and_rate(run, run->step, run->y, run->f);
    run->h_abs = 0.0; /* given for the first step alone */
    run->interpolates = 0;
    run->steps++;
    return 0;
}

const eomgen_method eomgen_taylor = {.name = "Taylor", .rows_K = TAYLOR_MOST + 1, .rows_F = TAYLOR_MOST, .error_order = 7,
                                     .prepare = taylor_prepare, .interpolate = taylor_interpolate, .begin = taylor_begin,
                                     .step = taylor_step, .expands = 1};
