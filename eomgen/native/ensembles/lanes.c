/* Trajectories side by side, LANES of them, 4 on processors with AVX2 and 8 with AVX512F, each with steps of its own: a lane
   whose step is rejected tries again while the others go on, and one that has ended takes the next trajectory of the queue.
   Every lane does the same operations in the same order, so that a trajectory's results do not depend on which lane it is
   in. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "eomgen_ensembles.h"

#if EOMGEN_LANES & LANES
#define EOMGEN_CONTRACT
#include "eomgen_calls.h"
#if LANES == 4 && defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#elif LANES == 4
#pragma GCC target("avx2,fma")
#elif LANES == 8 && defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx512f,avx512vl,avx512dq,fma"))), apply_to = function)
#elif LANES == 8
#pragma GCC target("avx512f,avx512vl,avx512dq,fma")
#endif
#define EOMGEN_WIDTH LANES
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
#define OVER(a) (a) * AT(scale) /* see measure */
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
    real reach = taylor_reach(before, size, p);
    if (any_of((reach != reach) & (begins | moved))) {
        reach = taylor_straight(run, run->K, reach);
    }
    const flag none = { 0 }, given = (run->steps == 0) & (first > 0.0) & (first < reach);
    run->size = choose(begins | moved, choose(given, first, reach), run->size); /* others try again, or have nothing to do */
    run->begins = none;
}

/* What a lane cannot do beside others is done for it single, by the text of one trajectory: its events with their resets, and
   inputs that are expressions. Nothing of it depends on the other lanes. */
typedef struct lane_single {
    eomgen_run run; /* first, so that a method's functions find the rest */
    eomgen_method method;
    eomgen_trajectory trajectory;
    eomgen_events events;
    const lane_run *lanes;
    int l;
} lane_single;

/* Numbers that a structure takes the place of. */
#define ROOM_OF(type, count) ((ptrdiff_t)((sizeof(type) * (size_t)(count) + sizeof(double) - 1) / sizeof(double)))

static int plays_expressions(const eomgen_ensemble *e, const eomgen_thread *own)
{
    for (int i = 0; own->signals != NULL && i < e->model->n_u; i++) {
        if (own->signals[i].n > 0 && own->signals[i].tape != NULL) {
            return 1;
        }
    }
    return 0;
}

static int has_single(const eomgen_ensemble *e, const eomgen_thread *own)
{
    return own->events != NULL || plays_expressions(e, own);
}

/* Doubles of what each lane keeps, and of work that they share. */
static ptrdiff_t single_each(const eomgen_ensemble *e, const eomgen_events *events)
{
    const ptrdiff_t n = events != NULL ? events->n : 0, rows = eomgen_rows(e->method, e->n, e->series);
    const ptrdiff_t kept = events != NULL ? e->n + 15 * n + events->n_resets + ROOM_OF(long, n) + ROOM_OF(int, 5 * n) : 0;
    return ROOM_OF(lane_single, 1) + rows + e->model->n_const + e->model->n_u + kept;
}

static ptrdiff_t single_shared(const eomgen_ensemble *e)
{
    return e->model->n_work + e->n_eval;
}

/* The stages of the step just made, and the polynomial from them. */
static void prepare_single(eomgen_run *run)
{
    const lane_single *const single = (const lane_single *)run;
    const lane_run *const lanes = single->lanes;
    take_lane(single->method.rows_K * run->n, lanes->K, single->l, run->K);
    single->lanes->all->method->prepare(run);
}

static double *lay_out_events(eomgen_events *events, const eomgen_thread *own, int states, double *memory)
{
    *events = *own->events;
    const int n = events->n;
    double *const count = memory + 15 * n + states, *const whole = count + ROOM_OF(long, n);
    eomgen_lay_out_events(events, memory, (long *)(void *)count, (int *)(void *)whole);
    events->values_reset = whole + ROOM_OF(int, 5 * n);
    return events->values_reset + events->n_resets;
}

/* Set up what is done single, W times, in so many doubles as the two functions above say. */
static lane_single *lay_out_single(const eomgen_ensemble *e, const eomgen_thread *own, const lane_run *lanes, double *memory)
{
    double *const w = memory, *const times = w + e->model->n_work;
    lane_single *const all = (lane_single *)(void *)(memory + single_shared(e));
    double *next = (double *)(void *)all + W * ROOM_OF(lane_single, 1);
    for (int l = 0; l < W; l++) {
        lane_single *const single = (lane_single *)(void *)((double *)(void *)all + l * ROOM_OF(lane_single, 1));
        eomgen_run *const run = &single->run;
        memset(single, 0, sizeof *single);
        single->lanes = lanes, single->l = l, single->method = *e->method, single->method.prepare = prepare_single;
        next = eomgen_set_up(run, e, own, w, next);
        run->direction = e->nodes[e->n_nodes - 1] < e->nodes[0] ? -1.0 : 1.0;
        if (own->events != NULL) {
            next = lay_out_events(&single->events, own, e->n, next);
        }
        single->trajectory.t_eval = e->t_eval, single->trajectory.n_eval = e->n_eval, single->trajectory.times = times;
        single->trajectory.span = fabs(e->nodes[e->n_nodes - 1] - e->nodes[0]);
        single->trajectory.events = own->events != NULL ? &single->events : NULL;
        single->trajectory.notes = own->notes, single->trajectory.notes_room = own->notes_room;
    }
    return all;
}

static lane_single *single_of(const lane_run *run, int l)
{
    return (lane_single *)(void *)((double *)(void *)run->singles + l * ROOM_OF(lane_single, 1));
}

/* A lane takes trajectory k: its constants and inputs, and no event so far. */
static void fill_single(const eomgen_ensemble *e, const lane_run *lanes, int l, ptrdiff_t k, const double *constants)
{
    lane_single *const single = single_of(lanes, l);
    eomgen_run *const run = &single->run;
    memcpy((double *)run->c, constants, (size_t)e->model->n_const * sizeof(double));
    memcpy(run->u, e->u + k * e->u_stride, (size_t)e->model->n_u * sizeof(double));
    run->step = run->t_old = 0.0, run->failure = 0, run->evaluations = 0;
    if (single->trajectory.events != NULL) {
        single->trajectory.states = e->n_eval > 0 ? e->samples + k * e->n_eval * e->n : NULL;
        single->events.crowded = 0, single->events.last_reset = (double)NAN;
        memset(single->events.count, 0, (size_t)single->events.n * sizeof(long));
    }
}

/* The inputs of a lane at a time and state. */
static const double *inputs_single(const lane_run *lanes, int l, double t, const real *y)
{
    eomgen_run *const run = &single_of(lanes, l)->run;
    double *const state = run->failure_state; /* free until something fails */
    take_lane(lanes->n, y, l, state);
    run->hold = lanes->hold[l];
    eomgen_force(run, t, state);
    return run->u;
}

/* The inputs of every lane at its time and state. */
static EOMGEN_APART void play_lanes(lane_run *lanes, real t, const real *y)
{
    for (int l = 0; l < W; l++) {
        if (lanes->awake[l]) {
            put_lane(lanes->n_u, inputs_single(lanes, l, t[l], y), l, lanes->u);
        }
    }
}

/* The lane's part of a run, as it stands after a step or at the start. */
static eomgen_run *take_out(const lane_run *lanes, int l)
{
    eomgen_run *const run = &single_of(lanes, l)->run;
    take_lane(lanes->n, lanes->y, l, run->y), take_lane(lanes->n, lanes->y_old, l, run->y_old);
    take_lane(lanes->n, lanes->f, l, run->f);
    run->t = lanes->t[l], run->t_old = lanes->t_old[l], run->t_bound = lanes->t_bound[l], run->hold = lanes->hold[l];
    run->h_abs = lanes->size[l], run->until_callback = -1, run->interpolates = 0, run->stopped = 0;
    run->evaluations = 0, run->failure = 0;
    return run;
}

/* Back into the lane; whether the state is another. */
static void put_back(lane_run *lanes, int l, const eomgen_run *run, int changed)
{
    lanes->evaluations[l] += run->evaluations;
    if (run->failure != 0) {
        lanes->failure[l] = run->failure, lanes->failure_time[l] = run->failure_time;
    }
    if (changed) {
        put_lane(lanes->n, run->y, l, lanes->y), put_lane(lanes->n, run->f, l, lanes->f);
        if (lanes->closed != NULL) {
            put_lane(lanes->n, run->next, l, lanes->next);
        }
        lanes->t[l] = run->t, lanes->size[l] = run->h_abs;
    }
}

/* Values of the events where a trajectory begins. */
static void arm_lane(lane_run *lanes, int l)
{
    eomgen_run *const run = take_out(lanes, l);
    eomgen_arm(run, &single_of(lanes, l)->events);
    put_back(lanes, l, run, 0);
}

/* What the step of a lane brought: samples, events, resets; as eomgen_advance returns it, 0 to go on. */
static EOMGEN_APART int end_lane_step(eomgen_ensemble *e, lane_run *lanes, int l)
{
    lane_single *const single = single_of(lanes, l);
    eomgen_run *const run = take_out(lanes, l);
    eomgen_trajectory *const trajectory = &single->trajectory;
    const ptrdiff_t k = lanes->index[l];
    run->step = run->t - run->t_old;
    trajectory->done = trajectory->stored = lanes->done[l];
    const double t = run->t;
    const long resets = trajectory->resets;
    const int status = eomgen_end_step(&single->method, run, trajectory);
    eomgen_keep_notes(e, trajectory, k);
    lanes->done[l] = trajectory->done;
    put_back(lanes, l, run, run->t != t || trajectory->resets != resets);
    return status;
}

/* The queue of trajectories and the rounds of steps. Store what is requested up to now of the lanes that have moved. */
static void sample_lanes(eomgen_ensemble *e, const lane_method *method, lane_run *run, flag moved, double direction)
{
    const int n = run->n;
    int prepared = 0;
    for (;;) {
        flag wanted = { 0 };
        real times = run->t;
        for (int l = 0; l < W; l++) {
            while (moved[l] && run->done[l] < e->n_eval && direction * (e->t_eval[run->done[l]] - run->t[l]) <= 0.0) {
                if (run->t[l] != e->t_eval[run->done[l]]) {
                    times[l] = e->t_eval[run->done[l]];
                    wanted[l] = -1;
                    break;
                }
                take_lane(n, run->y, l, e->samples + (run->index[l] * e->n_eval + run->done[l]++) * n);
            }
        }
        if (!any_of(wanted)) {
            return;
        }
        if (!prepared) {
            const int before = run->calls;
            run->awake = moved;
            method->prepare(run);
            run->evaluations += wanted & (run->calls - before);
            prepared = 1;
        }
        method->interpolate(run, times, run->z);
        for (int l = 0; l < W; l++) {
            if (wanted[l]) {
                take_lane(n, run->z, l, e->samples + (run->index[l] * e->n_eval + run->done[l]++) * n);
            }
        }
    }
}

static void end_lane(eomgen_ensemble *e, lane_run *run, int l, int status)
{
    const ptrdiff_t k = run->index[l];
    for (ptrdiff_t j = run->done[l] * run->n; j < e->n_eval * run->n; j++) {
        e->samples[k * e->n_eval * run->n + j] = (double)NAN;
    }
    take_lane(run->n, run->y, l, e->x + k * run->n);
    e->t[k] = run->t[l], e->status[k] = status;
    e->steps[k] = run->steps[l], e->rejected[k] = run->rejected[l], e->evaluations[k] = run->evaluations[l];
    e->failure[k] = run->failure[l], e->failure_time[k] = run->failure_time[l];
    run->active[l] = run->begins[l] = run->awake[l] = 0;
    __atomic_fetch_add(&e->done, 1, __ATOMIC_RELAXED);
}

/* The next node of a lane's trajectory, or the end of it. */
static void next_node(eomgen_ensemble *e, lane_run *run, int l)
{
    if (++run->node[l] >= e->n_nodes) {
        end_lane(e, run, l, 0);
        return;
    }
    run->t_bound[l] = e->nodes[run->node[l]];
    run->size[l] = run->node[l] == 1 ? e->first_step : fmax(run->size_before[l], run->size[l]);
    run->hold[l] = run->t[l] + 0.5 * (run->t_bound[l] - run->t[l]);
    run->begins[l] = -1, run->again[l] = 0;
}

/* The next trajectory of the queue into a lane; those that cannot begin end at once. */
static EOMGEN_APART void fill_lane(eomgen_ensemble *e, lane_run *run, int l, double *constants)
{
    while (!run->active[l]) {
        const ptrdiff_t k = eomgen_ensemble_take(e);
        if (k < 0) {
            return;
        }
        run->index[l] = k, run->done[l] = 0, run->node[l] = 0, run->active[l] = -1;
        run->failure[l] = 0, run->failure_time[l] = 0.0;
        run->steps[l] = run->rejected[l] = run->evaluations[l] = 0;
        run->size_before[l] = 0.0;
        const int status = e->model->precompute(e->p + k * e->p_stride, constants);
        put_lane(e->model->n_const, constants, l, run->c);
        put_lane(e->model->n_u, e->u + k * e->u_stride, l, run->u);
        put_lane(run->n, e->x0 + k * run->n, l, run->y);
        run->t[l] = run->t_old[l] = e->nodes[0];
        if (run->singles != NULL) {
            fill_single(e, run, l, k, constants);
        }
        if (status != 0) {
            end_lane(e, run, l, EOMGEN_BAD_PARAMETERS);
        } else {
            next_node(e, run, l);
        }
    }
}

/* Lead the lanes that have come to a node on to what is next. */
static void advance_nodes(eomgen_ensemble *e, lane_run *run, double direction, double *constants)
{
    const flag there = run->active & ~run->begins & ((run->t - run->t_bound) * direction >= 0.0);
    if (any_of(there)) {
        for (int l = 0; l < W; l++) {
            if (there[l]) {
                next_node(e, run, l);
                fill_lane(e, run, l, constants);
            }
        }
    }
}

/* The longest step that a lane may take next, as eomgen_longest has it. */
static EOMGEN_APART double longest_of(const eomgen_ensemble *e, const lane_run *run, int l, double direction, double least)
{
    const eomgen_model *const model = e->model;
    double *const x = run->single, *const u = x + 2 * run->n, *const c = u + run->n_u, *const w = c + model->n_const;
    double found[5];
    for (int i = 0; i < run->n; i++) {
        x[i] = i < e->n_q ? run->y[i][l] : run->y[i][l] * direction;
    }
    take_lane(run->n - e->n_q, run->f + e->n_q, l, x + run->n);
    for (int i = 0; i < run->n_u; i++) {
        const int table = run->signals != NULL && run->signals[i].n > 0 && !run->plays;
        u[i] = run->plays ? inputs_single(run, l, run->t[l], run->y)[i] : table ? eomgen_table_value(run->signals + i, run->t[l], run->hold[l]) : run->u[i][l];
    }
    take_lane(model->n_const, run->c, l, c);
    const int status = e->meeting(run->t[l], x, u, c, found, w);
    return status == 0 && found[0] < e->max_step ? fmin(e->max_step, fmax(found[0], RUNS_UNHURRIED * least)) : e->max_step;
}

/* The step that each lane tries: its size with the sign of the run, 0 for those without a trajectory. */
static void choose_steps(eomgen_ensemble *e, lane_run *run, double direction, double *constants)
{
    const real t = run->t, spacing = abs_of(t) * 0x1p-52; /* of numbers there, or more */
    const real least = 10.0 * choose(spacing > 0x1p-1022, spacing, same(0x1p-1022));
    run->awake = run->active & ~run->begins;
    run->size_before = choose(run->again, run->size_before, run->size);
    real size = choose(run->size > e->max_step, same(e->max_step), choose(run->size < least, least, run->size));
    for (int l = 0; e->meeting != NULL && l < W; l++) {
        if (run->awake[l] && !run->again[l]) {
            size[l] = fmin(size[l], longest_of(e, run, l, direction, least[l]));
        }
    }
    size = run->size = choose(run->again, run->size, size);
    const flag lost = ~(size >= least), late = ~run->again & (run->steps >= e->max_steps);
    if (any_of(run->awake & (lost | late))) {
        for (int l = 0; l < W; l++) {
            if (run->awake[l] && (lost[l] || late[l])) {
                end_lane(e, run, l, late[l] ? EOMGEN_TOO_MANY_STEPS : EOMGEN_STEP_TOO_SMALL);
                fill_lane(e, run, l, constants); /* tries with the next round */
            }
        }
    }
    const real t_new = t + size * direction;
    run->t_new = choose((t_new - run->t_bound) * direction > 0.0, run->t_bound, t_new);
    run->step = choose(run->awake, run->t_new - t, same(0.0));
    run->size = choose(run->awake, abs_of(run->step), run->size);
}

/* error to the power of -1 / (order + 1), within 1 %: the bits of a number are nearly its logarithm, then one step of
   Newton's method. */
static inline real stretch_of(real error, int order)
{
    const double p = order + 1;
    const numeral shrunk = ((numeral)error >> 32) * (uint64_t)(4294967296.0 / p);
    real z = (real)((uint64_t)(1072640819.0 * (1.0 + 1.0 / p) * 4294967296.0) - shrunk), power = z;
    for (int i = 0; i < order; i++) {
        power *= z;
    }
    return z * ((p + 1.0 - error * power) / p);
}

/* Judge the steps tried: returns the lanes that have moved; sets the size of each one's next. Steps are a ninth shorter than
   SciPy's, so that fewer are rejected: less work and smaller errors, as a rejected step costs lanes as much as another. */
static flag accept_steps(lane_run *run, real error, int order)
{
    const flag moved = run->awake & (error < 1.0), again = run->awake & ~moved;
    const real factor = order > 0 ? 0.8 * stretch_of(error, order) : same(0.5), most = choose(run->again, same(1.0), same(10.0));
    const real more = choose((factor < most) & (error > 0.0), factor, most);
    const real less = choose(factor > 0.2, factor, same(0.2)); /* also where the error is NaN */
    run->size *= choose(moved, more, choose(again, less, same(1.0)));
    run->again = again;
    run->t_old = choose(moved, run->t, run->t_old), run->t = choose(moved, run->t_new, run->t);
    run->steps -= moved, run->rejected -= again;
    for (int i = 0; i < run->n; i++) {
        run->y[i] = choose(moved, run->y[i], run->y_old[i]);
        run->f[i] = choose(moved, run->f[i], run->K[i]);
    }
    return moved;
}

static const lane_method *find_method(const char *name)
{
    static const lane_method *const methods[] = { &lane_dop853, &lane_rk45, &lane_taylor };
    for (int i = 0; i < 3; i++) {
        if (strcmp(methods[i]->name, name) == 0) {
            return methods[i];
        }
    }
    return NULL;
}

static int takes(const eomgen_ensemble *e, const eomgen_thread *own)
{
    const lane_method *const method = find_method(e->method->name);
    return method != NULL && (method != &lane_taylor || !has_single(e, own));
}

static ptrdiff_t lane_memory(const eomgen_ensemble *e, const eomgen_thread *own)
{
    const lane_method *const method = find_method(e->method->name);
    const ptrdiff_t rows = 5 + method->rows_K + method->rows_F, further = eomgen_further(e->method, e->n, e->series);
    const ptrdiff_t each = e->model->n_work + e->model->n_u + e->model->n_const; /* single, and in every lane */
    const ptrdiff_t single = has_single(e, own) ? single_shared(e) + W * single_each(e, own->events) : 0;
    return e->model->n_const + each + 2 * e->n + W * (1 + each + rows * e->n + further) + single;
}

static void lay_out(lane_run *run, const eomgen_ensemble *e, const eomgen_thread *own, const lane_method *method, real *memory)
{
    const int n = e->n;
    memset(run, 0, sizeof *run);
    run->rhs = (lane_function)e->lane_rhs, run->signals = own->signals, run->n_u = e->model->n_u, run->n = n;
    run->rtol = e->rtol, run->atol = e->atol;
    run->c = memory;
    run->u = run->c + e->model->n_const;
    run->w = run->u + e->model->n_u;
    run->y = run->w + e->model->n_work;
    run->y_old = run->y + n, run->f = run->y_old + n, run->z = run->f + n, run->next = run->z + n;
    run->K = run->next + n;
    run->closed = e->model->closed_at && method != &lane_taylor ? run->w + e->model->closed_at : NULL;
    run->all = e, run->single = own->memory + e->model->n_const;
    run->after = run->K + (TAYLOR_MOST + 1) * n, run->series_work = run->K + method->rows_K * n;
    run->F = run->series_work + eomgen_further(e->method, n, e->series);
    run->expand = (lane_series)e->lane_series;
    run->order = method == &lane_taylor ? taylor_order(e->rtol, e->series->most) : 0;
    if (has_single(e, own)) {
        run->plays = plays_expressions(e, own);
        run->singles = lay_out_single(e, own, run, (double *)(run->F + method->rows_F * n));
    }
}

/* What comes before a step: lanes that begin, and what each tries. */
static void prepare_round(eomgen_ensemble *e, const lane_method *method, lane_run *run, double direction, double *constants,
                          int has_events)
{
    const size_t size = (size_t)run->n * sizeof(real);
    flag first = { 0 };
    if (any_of(run->active & run->begins)) {
        for (int l = 0; l < W; l++) {
            first[l] = run->node[l] == 1 ? -1 : 0;
        }
        /* a time requested may be the start */
        sample_lanes(e, method, run, first & run->begins & run->active, direction);
    }
    const int taylor = method == &lane_taylor, begins = any_of(run->active & run->begins);
    const flag starts = run->active & run->begins & first;
    if (taylor) {
        begin_taylor(e, run);
    } else if (begins) {
        begin_lanes(e, method, run, direction);
        for (int l = 0; has_events && l < W; l++) {
            if (starts[l]) {
                arm_lane(run, l);
            }
        }
    }
    if (begins) {
        advance_nodes(e, run, direction, constants); /* a part may have no length */
    }
    choose_steps(e, run, direction, constants);
    memcpy(run->y_old, run->y, size);
    for (int i = 0; i < run->n && run->closed != NULL; i++) { /* E. Eich, as in eomgen_step */
        run->y_old[i] = choose(run->awake, run->next[i], run->y[i]);
    }
    if (!taylor) {
        memcpy(run->K, run->f, size);
    }
    run->calls = 0;
}

static void finish_round(eomgen_ensemble *e, const lane_method *method, lane_run *run, double direction, double *constants,
                         int has_events)
{
    run->evaluations += run->awake & run->calls;
    const flag moved = accept_steps(run, method->error(run, run->step), method->error_order);
    keep_closed_lanes(run, moved);
    if (e->n_eval > 0 && !has_events) {
        sample_lanes(e, method, run, moved, direction);
    }
    for (int l = 0; has_events && l < W; l++) {
        const int status = moved[l] ? end_lane_step(e, run, l) : 0;
        if (status != 0) {
            end_lane(e, run, l, status == EOMGEN_TERMINAL ? 1 : status);
            fill_lane(e, run, l, constants);
        }
    }
    advance_nodes(e, run, direction, constants);
}

static void work_in_lanes(eomgen_ensemble *e, const eomgen_thread *own)
{
    const lane_method *const method = find_method(e->method->name);
    const double direction = e->nodes[e->n_nodes - 1] < e->nodes[0] ? -1.0 : 1.0;
    double *const constants = own->memory, *memory = constants + e->model->n_const;
    memory += e->model->n_work + e->model->n_u + e->model->n_const + 2 * e->n; /* of lanes that are evaluated single */
    memory += (W - ((uintptr_t)memory / sizeof(double)) % W) % W; /* vectors lie at multiples of their size */
    lane_run run;
    lay_out(&run, e, own, method, (real *)memory);
    for (int l = 0; l < W; l++) {
        fill_lane(e, &run, l, constants);
    }
    for (ptrdiff_t round = 0; any_of(run.active); round++) {
        const int stopped = round % (EOMGEN_CALLBACK_STRIDE / 8) == 0 && __atomic_load_n(&e->stop, __ATOMIC_RELAXED);
        for (int l = 0; stopped && l < W; l++) {
            if (run.active[l]) {
                end_lane(e, &run, l, EOMGEN_STOPPED);
            }
        }
        prepare_round(e, method, &run, direction, constants, own->events != NULL);
        method->attempt(&run, run.step);
        finish_round(e, method, &run, direction, constants, own->events != NULL);
    }
}

#define NAME_(width) eomgen_lane_worker##width
#define NAME(width) NAME_(width)
EOMGEN_PIECE extern const eomgen_lane_worker NAME(LANES);
const eomgen_lane_worker NAME(LANES) = { LANES, lane_memory, takes, work_in_lanes };
#if LANES > 2 && defined(__clang__)
#pragma clang attribute pop
#endif
#else
typedef int no_lanes;
#endif
