/* Taylor's method: A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
   methods, Experimental Mathematics 14, 2005, section 3: the order by the tolerance, the step by the decay of the last two
   terms. The order is higher than theirs, 1 - log(rtol) / 2, which is best where work grows with its square: here, in
   vector registers, it grows little faster than the order. What the last terms do not see, as where odd or far
   singularities make them vanish, the defect does: x' at the end of the step against the rate of the polynomial there;
   a step whose defect is too large is tried again, shorter. Rows of run->K are coefficients, those of the step, then those
   at its end, which serve the next one. */
#ifndef EOMGEN_WIDE
enum { TAYLOR_LEAST = 4, TAYLOR_MOST = 23 };
/* Steps are shorter by exp(-0.7 / (p - 1)), A. Jorba and M. Zou's safety: 0.7 / log(2). */
#define TAYLOR_SAFETY 1.0098865286222744
/* The defect times the step may be so many times the tolerance: it is about the first term left out times its order. */
static const double TAYLOR_DEFECT = 10.0;

static int taylor_order(double rtol, int most)
{
    const int order = (int)ceil(2.0 - 0.65 * log(rtol));
    most = most < TAYLOR_MOST ? most : TAYLOR_MOST;
    return order < TAYLOR_LEAST ? TAYLOR_LEAST : order > most ? most : order;
}

#ifdef EOMGEN_PLAIN
typedef uint64_t numeral;

static inline numeral bits_of(double a)
{
    numeral word;
    memcpy(&word, &a, sizeof a);
    return word;
}

static inline double of_bits(numeral word)
{
    double a;
    memcpy(&a, &word, sizeof a);
    return a;
}
#else
#define bits_of(a) (numeral)(a)
#define of_bits(word) (real)(word)
#endif

/* log2 of a positive number, within 6e-5, and 2^a, within 1e-5 of it: enough for the size of a step, and quick; 2^52 and half
   as much again make integers of their last bits. */
static inline real taylor_log2(real a)
{
    const numeral word = bits_of(a);
    const real exponent = of_bits((word >> 52 & 2047) | 0x4330000000000000u) - (0x1p52 + 1023.0);
    a = of_bits((word & 0xfffffffffffffu) | 0x3ff0000000000000u) - 1.0;
    return exponent + a + a * (1.0 - a) * (0.44245418 + a * (-0.27016007 + a * (0.15202092 - a * 0.04584151)));
}

static inline real taylor_exp2(real a)
{
    const real nearest = (a + 0x1.8p52) - 0x1.8p52, whole = nearest - choose(nearest > a, same(1.0), same(0.0));
    a -= whole;
    const real power = of_bits(bits_of(whole + (0x1.8p52 + 1023.0)) << 52);
    return power * (1.0 + a + a * (a - 1.0) * (0.30691046 + a * (0.06561149 + a * 0.01371135)));
}

/* The step in which terms of order p - 1 and p, of these sizes for a step of 1 in parts of the tolerance, both come down to
   it, and some safety; NaN where one is not finite. */
static inline real taylor_reach(real before, real last, int p)
{
    const real first = -taylor_log2(before) / (double)(p - 1), second = -taylor_log2(last) / (double)p;
    const real reach = taylor_exp2(choose(first < second, first, second) - TAYLOR_SAFETY / (p - 1));
    return choose(before + last < 1e300, reach, same((double)NAN));
}

/* The coefficients of the step taken last: in plain runs the halves of run->K take turns. */
#ifdef EOMGEN_PLAIN
#define TAYLOR_ROWS(run) ((run)->K + (1 - (run)->side) * (TAYLOR_MOST + 1) * (run)->n)
#else
#define TAYLOR_ROWS(run) ((run)->K)
#endif

/* The largest terms of orders p - 1 and p over all states, for a step of 1, in parts of the tolerance; NaN if one is not
   finite. A state that is zero is judged by what the last step's length would make of it. */
static void taylor_sizes(const RUN *run, const real *rows, int p, real *before, real *last)
{
    const int n = run->n;
    const real passed = abs_of(run->t - run->t_old);
    const real *const first = rows + n, *const lower = rows + (p - 1) * n, *const upper = rows + p * n;
    real most = same(0.0), most_lower = same(0.0), bad = same(0.0);
    for (int i = 0; i < n; i++) { /* comparisons that turn out one way or the other must not become branches */
        const real size = abs_of(run->y[i]), grown = abs_of(first[i]) * passed;
        const real scale = run->atol[i] + choose(size > grown, size, grown) * run->rtol;
        const real inverse = choose(scale > 0.0, 1.0 / scale, same(0.0));
        const real a = abs_of(lower[i]) * inverse, b = abs_of(upper[i]) * inverse;
        bad += 0.0 * lower[i] + 0.0 * upper[i];
        most_lower = choose(a > most_lower, a, most_lower);
        most = choose(b > most, b, most);
    }
    *before = choose(most_lower < 1e280, most_lower, same(1e280)) + bad;
    *last = choose(most < 1e280, most, same(1e280)) + bad;
}

/* Where there is no reach, as coefficients do not exist where a root vanishes: the rate alone, over a step that the defect
   judges, tried at eight times the length of the last. */
static real taylor_straight(const RUN *run, real *rows, real reach)
{
    const real longer = 8.0 * abs_of(run->step);
    for (int i = 2 * run->n; i < (run->order + 1) * run->n; i++) {
        rows[i] = choose(reach == reach, rows[i], same(0.0));
    }
    return choose(reach == reach, reach, choose(longer > RUNS_FIRST, longer, same(RUNS_FIRST)));
}

/* Whether the defect at the end of a step of size h from y_old to y, where the polynomial's rate is f and x' is g, is small
   enough in all states: 0, else 2. */
static real taylor_defect(const RUN *run, real h, const real *f, const real *g)
{
    real found = same(0.0);
    for (int i = 0; i < run->n; i++) {
        const real a = abs_of(run->y_old[i]), b = abs_of(run->y[i]), off = abs_of((f[i] - g[i]) * h);
        const real most = TAYLOR_DEFECT * (run->atol[i] + choose(a >= b, a, b) * run->rtol);
        found = choose(off <= most, found, same(2.0));
    }
    return found;
}

/* The polynomial at h from its start, and its rate, of the states in `kind` at i. Even and odd powers apart, as each sum
   waits for itself. */
#define TAYLOR_SUM(kind) \
    do { \
        const int odd = (run->order - 1) | 1, even = run->order & ~1; \
        const real square = h * h; \
        kind a = *(const kind *)(rows + even * n + i), b = *(const kind *)(rows + odd * n + i); \
        kind slope_a = a - a, slope_b = b - b; \
        for (int m = even - 2; m >= 0; m -= 2) { \
            slope_a = slope_a * square + a; \
            a = a * square + *(const kind *)(rows + m * n + i); \
        } \
        for (int m = odd - 2; m > 0; m -= 2) { \
            slope_b = slope_b * square + b; \
            b = b * square + *(const kind *)(rows + m * n + i); \
        } \
        *(kind *)(y + i) = a + h * b; \
        *(kind *)(f + i) = b + 2.0 * h * (slope_a + h * slope_b); \
    } while (0)

static void taylor_sum(const RUN *run, const real *rows, real h, real *restrict y, real *restrict f)
{
    const int n = run->n;
    int i = 0;
#if defined(EOMGEN_PLAIN) && defined(EOMGEN_VECTORS)
    typedef double pair __attribute__((vector_size(16), aligned(8), may_alias));
    for (; i + 1 < n; i += 2) {
        TAYLOR_SUM(pair);
    }
#endif
    for (; i < n; i++) {
        TAYLOR_SUM(real);
    }
}

/* Terms over the part of the step that has passed. */
static void taylor_prepare(RUN *run)
{
    const int n = run->n;
    const real *const rows = TAYLOR_ROWS(run);
    real power = same(1.0);
    for (int m = 1; m <= TAYLOR_MOST; m++) {
        power = power * run->step;
        for (int i = 0; i < n; i++) {
            run->F[(m - 1) * n + i] = m <= run->order ? power * rows[m * n + i] : same(0.0);
        }
    }
}

static void taylor_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real x = (t - run->t_old) / run->step;
    for (int i = 0; i < n; i++) {
        real sum = same(0.0);
        for (int m = TAYLOR_MOST; m-- > 0;) {
            sum = (sum + run->F[m * n + i]) * x;
        }
        y[i] = sum + run->y_old[i];
    }
}

#ifdef EOMGEN_PLAIN
/* One state at a time. The work of the series follows the rows in run->K. */
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
#endif
#endif
