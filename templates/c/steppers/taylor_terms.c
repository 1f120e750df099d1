/* Taylor's method: A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
   methods, Experimental Mathematics 14, 2005, section 3: the order by the tolerance, the step by the decay of the last two
   terms. The order is higher than theirs, 1 - log(rtol) / 2, which is best where work grows with its square: here, in
   vector registers, it grows little faster than the order. What the last terms do not see, as where odd or far
   singularities make them vanish, the defect does: x' at the end of the step against the rate of the polynomial there;
   a step whose defect is too large is tried again, shorter. Rows of run->K are coefficients, those of the step, then those
   at its end, which serve the next one. */
#ifndef EOMGEN_TAYLOR
#define EOMGEN_TAYLOR
enum { TAYLOR_LEAST = 4, TAYLOR_MOST = 23 };
/* The defect times the step may be so many times the tolerance: it is about the first term left out times its order. */
static const double TAYLOR_DEFECT = 10.0;

static int taylor_order(double rtol, int most)
{
    const int order = (int)ceil(2.0 - 0.65 * log(rtol));
    most = most < TAYLOR_MOST ? most : TAYLOR_MOST;
    return order < TAYLOR_LEAST ? TAYLOR_LEAST : order > most ? most : order;
}

/* log2 of a positive number, within 6e-5, and 2^a, within 1e-5 of it: enough for the size of a step, and quick. */
static inline double taylor_log2(double a)
{
    uint64_t word;
    memcpy(&word, &a, sizeof a);
    const double exponent = (double)(int)((word >> 52) & 2047) - 1023.0;
    word = (word & 0xfffffffffffffu) | 0x3ff0000000000000u;
    memcpy(&a, &word, sizeof a);
    a -= 1.0;
    return exponent + a + a * (1.0 - a) * (0.44245418 + a * (-0.27016007 + a * (0.15202092 - a * 0.04584151)));
}

static inline double taylor_exp2(double a)
{
    const double whole = floor(a);
    a -= whole;
    const uint64_t word = (uint64_t)((int64_t)whole + 1023) << 52;
    double power;
    memcpy(&power, &word, sizeof power);
    return power * (1.0 + a + a * (a - 1.0) * (0.30691046 + a * (0.06561149 + a * 0.01371135)));
}

/* The step in which terms of order p - 1 and p, of these sizes for a step of 1 in parts of the tolerance, both come down to
   it, and some safety; NaN where one is not finite. */
static inline double taylor_reach(double before, double last, int p)
{
    if (!(before + last < 1e300)) {
        return NAN;
    }
    const double first = -taylor_log2(before) / (p - 1), second = -taylor_log2(last) / p;
    return taylor_exp2((first < second ? first : second) - 1.0098865286222744 / (p - 1)); /* 0.7 / log(2) */
}
#endif

/* The coefficients of the step taken last: in plain runs the halves of run->K take turns. */
#ifdef EOMGEN_PLAIN
#define TAYLOR_ROWS(run) ((run)->K + (1 - (run)->side) * (TAYLOR_MOST + 1) * (run)->n)
#else
#define TAYLOR_ROWS(run) ((run)->K)
#endif

/* The largest term of order m over all states, for a step of 1, in parts of the tolerance; NaN if one is not finite. A
   state that is zero is judged by what the last step's length would make of it. */
static real taylor_size(const RUN *run, const real *rows, int m)
{
    const int n = run->n;
    const real before = abs_of(run->t - run->t_old);
    real largest = same(0.0);
    for (int i = 0; i < n; i++) {
        const real size = abs_of(run->y[i]), grown = abs_of(rows[n + i]) * before, term = abs_of(rows[m * n + i]);
        const real scale = run->atol[i] + choose(size >= grown, size, grown) * run->rtol;
        real part = choose(scale > 0.0, term / scale, same(0.0));
        part = choose(part <= 1e280, part, choose(term < 1e300, same(1e280), term - term + NAN));
        largest = choose((part <= largest) | (largest != largest), largest, part);
    }
    return largest;
}

/* The defect at the end of a step of size h from y_old to y, where the polynomial's rate is f and x' is g: at most 1. */
static real taylor_defect(const RUN *run, real h, const real *f, const real *g)
{
    real worst = same(0.0);
    for (int i = 0; i < run->n; i++) {
        const real a = abs_of(run->y_old[i]), b = abs_of(run->y[i]), off = abs_of((f[i] - g[i]) * h);
        const real scale = run->atol[i] + choose(a >= b, a, b) * run->rtol;
        const real part = choose(off == 0.0, same(0.0), off / scale);
        worst = choose((part <= worst) | (worst != worst), worst, part);
    }
    return worst / TAYLOR_DEFECT;
}

/* The polynomial at h from its start, and its rate: even and odd powers apart, as each sum waits for itself. */
static void taylor_sum(const RUN *run, const real *rows, real h, real *restrict y, real *restrict f)
{
    const int n = run->n, odd = (run->order - 1) | 1, even = run->order & ~1;
    const real square = h * h;
    for (int i = 0; i < n; i++) {
        real a = rows[even * n + i], b = rows[odd * n + i], slope_a = same(0.0), slope_b = same(0.0);
        for (int m = even - 2; m >= 0; m -= 2) {
            slope_a = slope_a * square + a;
            a = a * square + rows[m * n + i];
        }
        for (int m = odd - 2; m > 0; m -= 2) {
            slope_b = slope_b * square + b;
            b = b * square + rows[m * n + i];
        }
        y[i] = a + h * b;
        f[i] = b + 2.0 * h * (slope_a + h * slope_b);
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
