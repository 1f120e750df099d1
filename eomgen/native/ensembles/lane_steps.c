/* Trajectories side by side, each lane with steps of its own: a lane whose step is rejected tries again while the others go
   on, and one that has ended takes the next trajectory of the queue. Included by a file for each width. Every lane does the
   same operations in the same order, so that a trajectory's results do not depend on which lane it is in. */
#include <math.h>
#include <string.h>

#include "eomgen_ensembles.h"
#include "eomgen_real.h"

enum { W = EOMGEN_WIDTH };

/* The right-hand side in lanes, which may contract: returns the lanes that fail or are left to the function of one state. */
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
    real *closed, *next; /* in w and beside: as in eomgen_run, or NULL */
    const eomgen_ensemble *all;
    double *single; /* room of the function of one state: x, x', u, c, w */
    int calls;
    flag active, begins, awake, again; /* has a trajectory; needs x' and a first step; evaluations count; was rejected */
    real size, size_before, t_new, t_bound; /* size_before: as it was before the last step */
    flag steps, rejected, evaluations;
    int failure[W];
    double failure_time[W];
    ptrdiff_t index[W], done[W]; /* trajectory; samples stored */
    int node[W];
    struct lane_single *singles; /* what is done for each lane single, or NULL */
    int plays;                  /* whether inputs are expressions */
} lane_run;

static EOMGEN_APART void play_lanes(lane_run *run, real t, const real *y);

typedef struct {
    const char *name;
    int rows_K, rows_F, error_order;
    void (*attempt)(lane_run *run, real h);
    real (*error)(const lane_run *run, real h);
    void (*prepare)(lane_run *run);
    void (*interpolate)(const lane_run *run, real t, real *y);
} lane_method;

/* Numbers of one lane, and back. */
static inline void take_lane(int n, const real *from, int l, double *to)
{
    for (int i = 0; i < n; i++) {
        to[i] = from[i][l];
    }
}

static inline void put_lane(int n, const double *from, int l, real *to)
{
    for (int i = 0; i < n; i++) {
        to[i][l] = from[i];
    }
}

/* x' of one lane by the function of one state, into k; its status. */
static int evaluate_single(lane_run *run, int l, real t, const real *y, real *k)
{
    const eomgen_model *const model = run->all->model;
    double *const x = run->single, *const out = x + run->n, *const u = out + run->n, *const c = u + run->n_u, *const w = c + model->n_const;
    take_lane(run->n, y, l, x);
    take_lane(run->n_u, run->u, l, u);
    take_lane(model->n_const, run->c, l, c);
    const int status = run->all->rhs(t[l], x, u, c, out, w);
    put_lane(run->n, out, l, k);
    if (run->closed != NULL) {
        put_lane(run->n, w + model->closed_at, l, run->closed);
    }
    return status;
}

/* Mark what failed in lanes that count, and keep those lanes from going on; codes: of lanes that failed, NULL: singular. */
static EOMGEN_APART void note_failures(lane_run *run, real t, const real *y, real *k, flag failed, flag bad, const int *codes)
{
    for (int l = 0; l < W; l++) {
        int finite = 1;
        for (int i = 0; i < run->n && bad[l]; i++) {
            finite = finite && isfinite(y[i][l]);
            k[i][l] = (double)NAN;
        }
        if (bad[l] && run->awake[l] && (finite || run->failure[l] == 0)) {
            const int code = codes != NULL ? codes[l] : EOMGEN_SINGULAR_MASS_MATRIX;
            run->failure[l] = failed[l] ? code : EOMGEN_NON_FINITE, run->failure_time[l] = t[l];
        }
    }
}

/* Evaluate lanes that count and were not done side by side; returns those that fail, with their codes. */
static EOMGEN_APART flag complete_lanes(lane_run *run, real t, const real *y, real *k, flag left, int *codes)
{
    flag failed = { 0 };
    for (int l = 0; l < W; l++) {
        codes[l] = left[l] ? evaluate_single(run, l, t, y, k) : 0;
        failed[l] = codes[l] != 0 ? -1 : 0;
    }
    return failed;
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
    if (run->plays) {
        play_lanes(run, t, y);
    } else if (run->signals != NULL) {
        read_tables(run, t);
    }
    run->calls++;
    int codes[W];
    flag failed = run->rhs(t, y, run->u, run->c, k, run->w) & run->awake;
    if (any_of(failed)) {
        failed = complete_lanes(run, t, y, k, failed, codes);
    }
    real sum = same(0.0); /* NaN where a result is not finite */
    for (int i = 0; i < run->n; i++) {
        sum += k[i] * 0.0;
    }
    const flag bad = failed | (sum != 0.0);
    if (any_of(bad & run->awake)) {
        note_failures(run, t, y, k, failed, bad, codes);
    }
}

/* Where the next steps of these lanes start: the states just evaluated, on the constraints. */
static inline void keep_closed_lanes(lane_run *run, flag chosen)
{
    for (int i = 0; i < run->n && run->closed != NULL; i++) {
        run->next[i] = choose(chosen, run->closed[i], run->next[i]);
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
    keep_closed_lanes(run, begins);
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
