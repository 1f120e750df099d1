/* Taylor's method in lanes. Its round begins with coefficients, which tell the step: those that the last step ended with,
   or new ones where a lane begins. */
static void expand_lanes(lane_run *run, real t, const real *y, flag wanted)
{
    real *const rows = run->after;
    if (run->signals != NULL) {
        read_tables(run, t);
    }
    const flag failed = run->expand(t, y, run->u, run->c, run->order, rows, run->series_work);
    real sum = same(0.0); /* NaN where a result is not finite */
    for (int i = 0; i < run->n; i++) {
        sum += rows[run->n + i] * 0.0;
    }
    const flag bad = failed | (sum != 0.0);
    if (any_of(bad & wanted)) {
        run->awake = wanted;
        note_failures(run, t, y, rows + run->n, failed, bad, NULL);
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
    return taylor_defect(run, h, run->f, run->after + run->n);
}

static const lane_method lane_taylor = {"Taylor", 2 * (TAYLOR_MOST + 1), TAYLOR_MOST, 0, taylor_attempt, taylor_error,
                                        taylor_prepare, taylor_interpolate}; /* order 0: rejected steps are halved */

/* taylor_log2, taylor_exp2 and taylor_reach of every lane; 2^52 and half as much again make integers of their last bits. */
static inline real log2_of(real a)
{
    const numeral word = (numeral)a;
    const real exponent = (real)((word >> 52 & 2047) | 0x4330000000000000u) - (0x1p52 + 1023.0);
    a = (real)((word & 0xfffffffffffffu) | 0x3ff0000000000000u) - 1.0;
    return exponent + a + a * (1.0 - a) * (0.44245418 + a * (-0.27016007 + a * (0.15202092 - a * 0.04584151)));
}

static inline real exp2_of(real a)
{
    const real nearest = (a + 0x1.8p52) - 0x1.8p52, whole = nearest - choose(nearest > a, same(1.0), same(0.0));
    a -= whole;
    const real power = (real)((numeral)(whole + (0x1.8p52 + 1023.0)) << 52);
    return power * (1.0 + a + a * (a - 1.0) * (0.30691046 + a * (0.06561149 + a * 0.01371135)));
}

static inline real reach_of(real before, real last, int p)
{
    const real first = log2_of(before) * (-1.0 / (p - 1)), second = log2_of(last) * (-1.0 / p);
    const real reach = exp2_of(choose(first < second, first, second) - TAYLOR_SAFETY / (p - 1));
    return choose(before + last < 1e300, reach, same((double)NAN));
}

/* Coefficients at the states of all lanes, and the sizes of the steps to try; NaN where there is none. */
static void begin_taylor(const eomgen_ensemble *e, lane_run *run)
{
    const int p = run->order, last = (p + 1) * run->n;
    const flag begins = run->begins & run->active, moved = run->active & ~begins & ~run->again;
    if (!any_of(run->active & ~moved)) {
        real *const rows = run->K;
        run->K = run->after, run->after = rows;
    } else if (any_of(moved)) {
        for (int i = 0; i < last; i++) {
            run->K[i] = choose(moved, run->after[i], run->K[i]);
        }
    }
    if (any_of(begins)) {
        expand_lanes(run, run->t, run->y, begins);
        run->evaluations -= begins;
        for (int i = 0; i < last; i++) {
            run->K[i] = choose(begins, run->after[i], run->K[i]);
        }
    }
    real before, size;
    taylor_sizes(run, run->K, p, &before, &size);
    const real first = same(e->first_step);
    real reach = reach_of(before, size, p);
    if (any_of((reach != reach) & (begins | moved))) {
        reach = taylor_straight(run, run->K, reach);
    }
    const flag none = { 0 }, given = (run->steps == 0) & (first > 0.0) & (first < reach);
    run->size = choose(begins | moved, choose(given, first, reach), run->size); /* others try again, or have nothing to do */
    run->begins = none;
}
