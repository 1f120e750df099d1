/* Taylor's method for one state: see taylor_terms.c. The work of the series follows the rows in run->K. */
static double *taylor_work(const eomgen_run *run)
{
    return run->K + 2 * (TAYLOR_MOST + 1) * run->n;
}

/* The series' work is finite: it multiplies by zero what it does not mean. */
static void taylor_clear(eomgen_run *run)
{
    memset(taylor_work(run), 0, (size_t)run->series->n_work * sizeof(double));
}

static void taylor_begin(eomgen_run *run)
{
    run->order = taylor_order(run->rtol, run->series->most);
    run->side = run->expanded = 0;
    taylor_clear(run);
}

/* Coefficients at (t, y) into rows; the status, or EOMGEN_STOPPED. */
static int taylor_expand(eomgen_run *run, double t, const double *y, double *rows)
{
    if ((--run->until_callback == 0 || run->stopped || run->signals != NULL) && !eomgen_ready(run, t, y, rows)) {
        return EOMGEN_STOPPED;
    }
    int status = run->series->expand(t, y, run->u, run->c, run->order, rows, taylor_work(run));
    double sum = 0.0;
    for (int i = 0; i < run->n; i++) {
        sum += 0.0 * rows[run->n + i];
    }
    run->evaluations++;
    status = status == 0 && sum != 0.0 ? EOMGEN_NON_FINITE : status;
    if (status != 0) {
        eomgen_note(run, status, t, y);
    }
    return status;
}

static int taylor_step(eomgen_run *run)
{
    const int n = run->n, p = run->order, half = (TAYLOR_MOST + 1) * n;
    double *const rows = run->K + run->side * half, *const after = run->K + (1 - run->side) * half;
    if (run->most_steps > 0 && run->steps >= run->most_steps) {
        return EOMGEN_TOO_MANY_STEPS;
    }
    if (!run->expanded) {
        const int status = taylor_expand(run, run->t, run->y, rows);
        if (status != 0) {
            return status == EOMGEN_STOPPED ? EOMGEN_STOPPED : EOMGEN_STEP_TOO_SMALL;
        }
        run->expanded = 1;
    }
    double before, last;
    taylor_sizes(run, rows, p, &before, &last);
    double h_abs = taylor_reach(before, last, p);
    if (isnan(h_abs)) {
        taylor_clear(run);
        h_abs = taylor_straight(run, rows, h_abs);
    }
    h_abs = run->h_abs > 0.0 && run->h_abs < h_abs ? run->h_abs : h_abs;
    h_abs = h_abs > run->max_step ? run->max_step : h_abs >= 0.0 && too_small(run, h_abs) ? least_step(run) : h_abs;
    double *const spare = run->y_old;
    run->y_old = run->y, run->y = spare;
    for (;;) {
        if (run->stopped || too_small(run, h_abs)) { /* also where it is NaN */
            run->y = run->y_old, run->y_old = spare;
            return run->stopped ? EOMGEN_STOPPED : EOMGEN_STEP_TOO_SMALL;
        }
        const double t_new = end_of_step(run, h_abs, 0.0), h = t_new - run->t;
        taylor_sum(run, rows, h, run->y, run->f);
        if (taylor_expand(run, t_new, run->y, after) == 0 && taylor_defect(run, h, run->f, after + n) <= 1.0) {
            run->t_old = run->t, run->t = t_new, run->step = h;
            break;
        }
        h_abs = 0.5 * fabs(h);
        run->rejected++;
        taylor_clear(run); /* coefficients may have overflown */
    }
    memcpy(run->f, after + n, (size_t)n * sizeof(double));
    run->side = 1 - run->side;
    run->h_abs = 0.0; /* given for the first step alone */
    run->interpolates = 0;
    run->steps++;
    return 0;
}

const eomgen_method eomgen_taylor = {"Taylor", 2 * (TAYLOR_MOST + 1), TAYLOR_MOST, 0, NULL, NULL, taylor_prepare,
                                     taylor_interpolate, 0, 0, 1, taylor_begin, taylor_step};
