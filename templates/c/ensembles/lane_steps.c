/* Trajectories side by side, each lane with steps of its own: a lane whose step is rejected tries again while the others go
   on, and one that has ended takes the next trajectory of the queue. Included by a file for each width. The arithmetic of a
   lane is that of eomgen_ensemble_work, so that its results have the same bits. */
#include <math.h>
#include <string.h>

#include "eomgen_ensembles.h"
#include "eomgen_real.h"

enum { W = EOMGEN_WIDTH };

typedef struct {
    eomgen_lane_function rhs;
    const eomgen_signal *signals;
    int n_u, n;
    double rtol;
    const double *atol;
    real t, t_old, step, hold; /* hold: as in eomgen_run */
    real *c, *u, *w, *y, *y_old, *f, *K, *F, *z; /* constants, inputs, work; states as in eomgen_run; a state between */
    long calls;
    int awake[W];                                /* lanes whose evaluations count */
    int failure[W];
    double failure_time[W];
} lane_run;

typedef struct {
    const char *name;
    int rows_K, rows_F, error_order;
    void (*attempt)(lane_run *run, real h);
    real (*error)(const lane_run *run, real h);
    void (*prepare)(lane_run *run);
    void (*interpolate)(const lane_run *run, real t, real *y);
} lane_method;

/* What a lane is at; index -1: nothing. */
typedef struct {
    long index, done, calls;
    int node, begins, again; /* begins: needs x' and a first step; again: the last step was rejected */
    double h_abs, t_bound, t_new, h_last; /* h_last: as it was before the last step */
} lane_task;

static void evaluate_lanes(lane_run *run, real t, const real *y, real *k)
{
    int codes[W];
    for (int i = 0; run->signals != NULL && i < run->n_u; i++) {
        for (int l = 0; run->signals[i].n > 0 && l < W; l++) {
            run->u[i][l] = eomgen_table_value(run->signals + i, run->signals[i].order == 0 ? run->hold[l] : t[l]);
        }
    }
    run->calls++;
    if (run->rhs((const double *)&t, (const double *)y, (const double *)run->u, (const double *)run->c, (double *)k,
                 (double *)run->w, codes) == 0) {
        return;
    }
    for (int l = 0; l < W; l++) {
        if (codes[l] == 0) {
            continue;
        }
        int finite = 1;
        for (int i = 0; i < run->n; i++) {
            finite = finite && isfinite(y[i][l]);
            k[i][l] = NAN;
        }
        if (run->awake[l] && (finite || run->failure[l] == 0)) {
            run->failure[l] = codes[l], run->failure_time[l] = t[l];
        }
    }
}

/* What each state may err by. */
static inline void measure(const lane_run *run, real *scale)
{
    for (int i = 0; i < run->n; i++) {
        const real a = abs_of(run->y_old[i]), b = abs_of(run->y[i]);
        scale[i] = run->atol[i] + choose(a >= b, a, b) * run->rtol;
    }
}

EOMGEN_EACH(root, sqrt)
typedef real now;
#define RUN lane_run
#define EVALUATE evaluate_lanes
#define ROW(j) K[(j) * n + i]
#define AT(a) (a)[i]
#define EACH(...) \
    for (int i = 0; i < n; i++) { \
        __VA_ARGS__; \
    }
#define METHOD(name, title, ...) \
    static const lane_method lane_##name = { title, __VA_ARGS__, name##_attempt, name##_error, name##_prepare, name##_interpolate };
#include "eomgen_methods.h"

static double lane_norm(const lane_run *run, const real *x, const real *y, int l)
{
    double sum = 0.0;
    for (int i = 0; i < run->n; i++) {
        const double part = (x[i][l] - (y != NULL ? y[i][l] : 0.0)) / (run->atol[i] + fabs(run->y[i][l]) * run->rtol);
        sum += part * part;
    }
    return sqrt(sum / run->n);
}

/* x' of the lanes that begin, and their first steps. */
static void begin_lanes(const eomgen_ensemble *e, const lane_method *method, lane_run *run, lane_task *tasks,
                        double direction)
{
    const int n = run->n;
    real *const y1 = run->K, *const f1 = run->K + n;
    real h0 = same(0.0);
    double d0[W], d1[W];
    for (int l = 0; l < W; l++) {
        run->awake[l] = tasks[l].index >= 0 && tasks[l].begins;
    }
    evaluate_lanes(run, run->t, run->y, f1);
    for (int l = 0; l < W; l++) {
        if (!run->awake[l]) {
            continue;
        }
        tasks[l].calls++;
        for (int i = 0; i < n; i++) {
            run->f[i][l] = f1[i][l];
        }
        const double length = fabs(tasks[l].t_bound - run->t[l]);
        if (!(tasks[l].h_abs > 0.0) && n > 0 && length > 0.0) {
            d0[l] = lane_norm(run, run->y, NULL, l), d1[l] = lane_norm(run, run->f, NULL, l);
            const double h = d0[l] < 1e-5 || d1[l] < 1e-5 ? 1e-6 : 0.01 * d0[l] / d1[l];
            h0[l] = h < length ? h : length;
        } else if (!(tasks[l].h_abs > 0.0)) {
            tasks[l].h_abs = length, run->awake[l] = 0;
        } else {
            run->awake[l] = 0;
        }
    }
    for (int i = 0; i < n; i++) {
        y1[i] = run->y[i] + h0 * direction * run->f[i];
    }
    evaluate_lanes(run, run->t + h0 * direction, y1, f1);
    for (int l = 0; l < W; l++) {
        if (run->awake[l]) {
            const double length = fabs(tasks[l].t_bound - run->t[l]);
            const double d2 = lane_norm(run, f1, run->f, l) / h0[l], d = d1[l] > d2 ? d1[l] : d2;
            const double h1 = d1[l] <= 1e-15 && d2 <= 1e-15 ? fmax(1e-6, h0[l] * 1e-3)
                                                            : pow(0.01 / d, 1.0 / (method->error_order + 1));
            tasks[l].h_abs = fmin(fmin(100.0 * h0[l], h1), fmin(length, e->max_step));
            tasks[l].calls++;
        }
        tasks[l].begins = 0;
    }
}
