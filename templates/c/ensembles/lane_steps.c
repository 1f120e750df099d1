/* Trajectories side by side, each lane with steps of its own: a lane whose step is rejected tries again while the others go
   on, and one that has ended takes the next trajectory of the queue. Included by a file for each width. Every lane does the
   same operations in the same order, so that a trajectory's results do not depend on which lane it is in. */
#include <math.h>
#include <string.h>

#include "eomgen_ensembles.h"
#include "eomgen_real.h"

enum { W = EOMGEN_WIDTH };

/* The right-hand side in lanes, which may contract: returns the lanes that fail. */
typedef flag (*lane_function)(real t, const real *x, const real *u, const real *c, real *out, real *w);

/* Taylor coefficients likewise. */
typedef flag (*lane_series)(real t, const real *x, const real *u, const real *c, int order, real *out, real *w);

/* What the lanes are at. */
typedef struct {
    lane_function rhs;
    lane_series expand;
    const eomgen_signal *signals;
    int n_u, n, order; /* order: of a Taylor step */
    double rtol;
    const double *atol;
    real t, t_old, step, hold; /* hold: as in eomgen_run */
    real *c, *u, *w, *y, *y_old, *f, *K, *F, *z; /* constants, inputs, work; states as in eomgen_run; a state between */
    real *after, *series_work; /* of Taylor: coefficients at the ends of the steps, and the series' work */
    int calls;
    flag active, begins, awake, again; /* has a trajectory; needs x' and a first step; evaluations count; was rejected */
    real size, size_before, t_new, t_bound; /* size_before: as it was before the last step */
    flag steps, rejected, evaluations;
    int failure[W];
    double failure_time[W];
    ptrdiff_t index[W], done[W]; /* trajectory; samples stored */
    int node[W];
} lane_run;

typedef struct {
    const char *name;
    int rows_K, rows_F, error_order;
    void (*attempt)(lane_run *run, real h);
    real (*error)(const lane_run *run, real h);
    void (*prepare)(lane_run *run);
    void (*interpolate)(const lane_run *run, real t, real *y);
} lane_method;

/* Mark what failed in lanes that count, and keep those lanes from going on. */
static EOMGEN_APART void note_failures(lane_run *run, real t, const real *y, real *k, flag failed, flag bad)
{
    for (int l = 0; l < W; l++) {
        int finite = 1;
        for (int i = 0; i < run->n && bad[l]; i++) {
            finite = finite && isfinite(y[i][l]);
            k[i][l] = (double)NAN;
        }
        if (bad[l] && run->awake[l] && (finite || run->failure[l] == 0)) {
            run->failure[l] = failed[l] ? EOMGEN_SINGULAR_MASS_MATRIX : EOMGEN_NON_FINITE, run->failure_time[l] = t[l];
        }
    }
}

static EOMGEN_APART void read_tables(lane_run *run, real t)
{
    for (int i = 0; i < run->n_u; i++) {
        for (int l = 0; run->signals[i].n > 0 && l < W; l++) {
            run->u[i][l] = eomgen_table_value(run->signals + i, t[l], run->hold[l]);
        }
    }
}

static inline void evaluate_lanes(lane_run *run, real t, const real *y, real *k)
{
    if (run->signals != NULL) {
        read_tables(run, t);
    }
    run->calls++;
    const flag failed = run->rhs(t, y, run->u, run->c, k, run->w);
    real sum = same(0.0); /* NaN where a result is not finite */
    for (int i = 0; i < run->n; i++) {
        sum += k[i] * 0.0;
    }
    const flag bad = failed | (sum != 0.0);
    if (any_of(bad & run->awake)) {
        note_failures(run, t, y, k, failed, bad);
    }
}

/* One over what each state may err by. */
static inline void measure(const lane_run *run, real *scale)
{
    for (int i = 0; i < run->n; i++) {
        const real a = abs_of(run->y_old[i]), b = abs_of(run->y[i]);
        scale[i] = 1.0 / (run->atol[i] + choose(a >= b, a, b) * run->rtol);
    }
}

EOMGEN_EACH(root, sqrt)
typedef real now;
#define RUN lane_run
#define EVALUATE evaluate_lanes
#define ROW(j) K[(j) * n + i]
#define AT(a) (a)[i]
#define OVER(a) (a) * AT(scale) /* see measure */
#define EACH(...) \
    for (int i = 0; i < n; i++) { \
        __VA_ARGS__; \
    }
#define METHOD(name, title, ...) \
    static const lane_method lane_##name = { title, __VA_ARGS__, name##_attempt, name##_error, name##_prepare, name##_interpolate };
#include "eomgen_methods.h"

static real lane_norm(const lane_run *run, const real *x, const real *y)
{
    real sum = same(0.0);
    for (int i = 0; i < run->n; i++) {
        const real part = (y != NULL ? x[i] - y[i] : x[i]) / (run->atol[i] + abs_of(run->y[i]) * run->rtol);
        sum += part * part;
    }
    return root(sum / (double)run->n);
}

/* x' of the lanes that begin, and their first steps: as eomgen_start has it. */
static EOMGEN_APART void begin_lanes(const eomgen_ensemble *e, const lane_method *method, lane_run *run, double direction)
{
    const int n = run->n;
    real *const y1 = run->K, *const f1 = run->K + n;
    const flag begins = run->begins & run->active;
    run->awake = begins;
    evaluate_lanes(run, run->t, run->y, f1);
    run->evaluations -= begins;
    for (int i = 0; i < n; i++) {
        run->f[i] = choose(begins, f1[i], run->f[i]);
    }
    const real length = abs_of(run->t_bound - run->t);
    const flag given = run->size > 0.0, simple = begins & ~given & (n > 0 ? length == 0.0 : length == length);
    const flag chosen = begins & ~given & ~simple;
    run->size = choose(simple, length, run->size);
    const real d0 = lane_norm(run, run->y, NULL), d1 = lane_norm(run, run->f, NULL);
    real h0 = choose((d0 < RUNS_UNKNOWN) | (d1 < RUNS_UNKNOWN), same(RUNS_FIRST), 0.01 * d0 / d1);
    h0 = choose(chosen, choose(h0 < length, h0, length), same(0.0));
    for (int i = 0; i < n; i++) {
        y1[i] = run->y[i] + h0 * direction * run->f[i];
    }
    run->awake = chosen;
    evaluate_lanes(run, run->t + h0 * direction, y1, f1);
    run->evaluations -= chosen;
    const real d2 = lane_norm(run, f1, run->f) / h0, d = choose(d1 >= d2, d1, d2);
    for (int l = 0; l < W; l++) {
        if (chosen[l]) {
            const double h1 = d1[l] <= RUNS_STRAIGHT && d2[l] <= RUNS_STRAIGHT
                                  ? fmax(RUNS_FIRST, h0[l] * RUNS_GROWTH)
                                  : pow(0.01 / d[l], 1.0 / (method->error_order + 1));
            run->size[l] = fmin(fmin(100.0 * h0[l], h1), fmin(length[l], e->max_step));
        }
    }
    run->begins &= ~begins;
}
