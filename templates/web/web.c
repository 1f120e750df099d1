/* A model in a page: its functions by name, a run step by step, and positions that close the loops. One instance; memory
   is taken at the beginning and never given back. */
#include <math.h>
#include <string.h>

#include "eomgen_steppers.h"

#define EXPORT(name) __attribute__((export_name(#name)))

extern unsigned char __heap_base;
extern const eomgen_method WEB_METHOD;

static const eomgen_model *model;
static double *c, *u, *w, *atol, node, *scales;
static eomgen_run run;
static eomgen_trajectory path;
static eomgen_events events;
static eomgen_signal *signals;
static const eomgen_kernel *constraints, *gradient, *rates, *poses;
static int n_q, n_v, n_h, n_c, n_slots;
static const int *slots;

EXPORT(web_room) void *web_room(long bytes)
{
    static unsigned long top;
    const unsigned long begin = ((top != 0 ? top : (unsigned long)&__heap_base) + 15UL) & ~15UL;
    const unsigned long there = 65536UL * __builtin_wasm_memory_size(0);
    top = begin + (unsigned long)bytes;
    if (top > there && __builtin_wasm_memory_grow(0, (top - there + 65535UL) / 65536UL) == ~0UL) {
        __builtin_trap();
    }
    return (void *)begin;
}

static double *numbers(long n)
{
    double *const found = (double *)web_room(8 * (n + 1));
    memset(found, 0, 8 * (unsigned long)(n + 1));
    return found;
}

static const eomgen_kernel *find(const char *name)
{
    for (int k = 0; k < model->n_kernels; k++) {
        if (strcmp(model->kernels[k].name, name) == 0) {
            return model->kernels + k;
        }
    }
    return NULL;
}

static eomgen_function function(const char *name)
{
    const eomgen_kernel *const found = find(name);
    return found != NULL ? found->call : NULL;
}

static int length(const eomgen_kernel *kernel)
{
    return kernel != NULL ? kernel->n_out : 0;
}

/* Functions of the model, and what they are evaluated with. */

EXPORT(web_inputs) double *web_inputs(void)
{
    return u;
}

EXPORT(web_set) int web_set(const double *p)
{
    return model->precompute(p, c);
}

static int call(const eomgen_kernel *kernel, double t, const double *x, double *out)
{
    return kernel->call(t, x, u, c, out, w);
}

EXPORT(web_call) int web_call(int kernel, double t, const double *x, double *out)
{
    return call(model->kernels + kernel, t, x, out);
}

/* The inputs at a time and a state, by the expressions they were given. */
EXPORT(web_force) void web_force(double t, const double *x)
{
    if (run.signals != NULL) {
        eomgen_force(&run, t, x);
    }
}

/* An input over time: an expression of n instructions; its value is constant where n is 0. */
EXPORT(web_signal) void web_signal(int input, int n, const int *code, const double *constants, int last)
{
    memset(signals + input, 0, sizeof *signals);
    if (n > 0) {
        eomgen_tape *const tape = (eomgen_tape *)web_room(sizeof *tape + sizeof last);
        int *const out = (int *)(tape + 1);
        *out = last;
        tape->n = n, tape->n_out = 1, tape->code = code, tape->numbers = constants, tape->out = out;
        tape->results = numbers(n);
        signals[input].n = 1, signals[input].tape = tape;
    }
    run.signals = NULL;
    for (int i = 0; i < model->n_u; i++) {
        run.signals = signals[i].n > 0 ? signals : run.signals;
    }
}

/* Closed loops. */

static void move(const double *q, const double *dz, double *moved)
{
    for (int i = 0, j = 0, k = 0; i < n_q;) {
        if (k < n_slots && slots[2 * k] == i) { /* Euler parameters turn by an angular velocity in turned axes */
            const double x = scales[j] * dz[j], y = scales[j + 1] * dz[j + 1], z = scales[j + 2] * dz[j + 2];
            const double half = 0.5 * sqrt(x * x + y * y + z * z), e0 = q[i], e1 = q[i + 1], e2 = q[i + 2], e3 = q[i + 3];
            const double cosine = cos(half), sine = half > 0.0 ? 0.5 * sin(half) / half : 0.5;
            moved[i] = cosine * e0 - sine * (e1 * x + e2 * y + e3 * z);
            moved[i + 1] = cosine * e1 + sine * (e0 * x - e3 * y + e2 * z);
            moved[i + 2] = cosine * e2 + sine * (e3 * x + e0 * y - e1 * z);
            moved[i + 3] = cosine * e3 + sine * (e1 * y - e2 * x + e0 * z);
            i += 4, j += 3, k++;
        } else {
            moved[i] = q[i] + scales[j] * dz[j];
            i++, j++;
        }
    }
}

static struct {
    double *e, *J, *G, *ridge, *dz, *trial, *poses;
} solver;

/* The largest scaled residual; the residuals into e. */
static double residual(double t, const double *q, double *e)
{
    double most = 0.0;
    if (n_h > 0 && call(constraints, t, q, e) != 0) {
        return HUGE_VAL;
    }
    for (int i = 0; i < n_h; i++) {
        e[i] /= scales[n_v + i];
        most = fmax(most, fabs(e[i]));
    }
    return most;
}

static int slopes(double t, const double *q, const int *held)
{
    if (n_c == 0) {
        return 0;
    }
    const int status = call(gradient, t, q, solver.J);
    for (int i = 0; i < n_c; i++) {
        for (int k = 0; k < n_v; k++) {
            double *const entry = solver.J + i * n_v + k;
            *entry = held[k] ? 0.0 : *entry * scales[k] / scales[n_v + i];
        }
    }
    return status;
}

/* dz of least length with J dz = -e, m rows; ridge: by which each may be left, over its own size. */
static void least_step(int m)
{
    double *const G = solver.G, *const J = solver.J, *const y = solver.e;
    for (int i = 0; i < m; i++) {
        for (int k = 0; k <= i; k++) {
            double sum = 0.0;
            for (int l = 0; l < n_v; l++) {
                sum += J[i * n_v + l] * J[k * n_v + l];
            }
            G[i * m + k] = sum;
        }
        G[i * m + i] += solver.ridge[i];
    }
    for (int i = 0; i < m; i++) { /* Cholesky's factor; a row that says nothing new changes nothing */
        double *const row = G + i * m;
        const double before = row[i];
        for (int k = 0; k <= i; k++) {
            double sum = row[k];
            for (int l = 0; l < k; l++) {
                sum -= row[l] * G[k * m + l];
            }
            row[k] = k < i ? (G[k * m + k] > 0.0 ? sum / G[k * m + k] : 0.0) : sum > 1e-14 * before ? sqrt(sum) : 0.0;
        }
        for (int l = 0; l < i; l++) {
            y[i] -= row[l] * y[l];
        }
        y[i] = row[i] > 0.0 ? y[i] / row[i] : 0.0;
    }
    for (int i = m - 1; i >= 0; i--) {
        for (int l = i + 1; l < m; l++) {
            y[i] -= G[l * m + i] * y[l];
        }
        y[i] = G[i * m + i] > 0.0 ? y[i] / G[i * m + i] : 0.0;
    }
    double longest = 0.0;
    for (int k = 0; k < n_v; k++) {
        double sum = 0.0;
        for (int i = 0; i < m; i++) {
            sum -= J[i * n_v + k] * y[i];
        }
        solver.dz[k] = sum;
        longest = fmax(longest, fabs(sum));
    }
    for (int k = 0; longest > 0.3 && k < n_v; k++) {
        solver.dz[k] *= 0.3 / longest;
    }
}

/* Close the loops near q, where velocities that are held keep their coordinates; the largest scaled residual left. */
EXPORT(web_close) double web_close(double t, double *q, const int *held)
{
    double size = residual(t, q, solver.e), damping = size < 1e-3 ? 0.0 : 1e-3;
    for (int step = 0; step < 80 && size > 1e-15; step++) {
        if (slopes(t, q, held) != 0) {
            return HUGE_VAL;
        }
        for (int i = 0; i < n_h; i++) {
            solver.ridge[i] = damping;
        }
        least_step(n_h);
        move(q, solver.dz, solver.trial);
        const double next = residual(t, solver.trial, solver.e);
        if (next < size) {
            const int settled = size < 1e-12 && next > 0.5 * size;
            memcpy(q, solver.trial, 8 * (unsigned long)n_q);
            size = next, damping = damping > 1e-9 ? fmin(0.1 * damping, size) : 0.0;
            if (settled) {
                break;
            }
        } else {
            damping = fmax(10.0 * damping, 1e-8);
            (void)residual(t, q, solver.e);
            if (damping > 1e4 || size < 1e-12) {
                break;
            }
        }
    }
    return size;
}

/* Velocities of x that fit the constraints, where some are held; the largest scaled residual left. */
EXPORT(web_close_rates) double web_close_rates(double t, double *x, const int *held)
{
    double most = 0.0;
    for (int step = 0; n_c > 0 && step < 3; step++) {
        if (call(rates, t, x, solver.e) != 0 || slopes(t, x, held) != 0) {
            return HUGE_VAL;
        }
        most = 0.0;
        for (int i = 0; i < n_c; i++) {
            solver.e[i] /= scales[n_v + i], solver.ridge[i] = 0.0;
            most = fmax(most, fabs(solver.e[i]));
        }
        double speed = 1.0;
        for (int k = 0; k < n_v; k++) { /* a step is not to be shortened */
            speed = fmax(speed, fabs(x[n_q + k] / scales[k]));
        }
        for (int i = 0; i < n_c; i++) {
            solver.e[i] *= 1e-6 / speed;
        }
        least_step(n_c);
        for (int k = 0; k < n_v; k++) {
            x[n_q + k] += scales[k] * solver.dz[k] * (1e6 * speed);
        }
    }
    return most;
}

static void point_of(const double *all, int body, const double *local, const double *axes, int m, double *seen)
{
    double place[3];
    for (int i = 0; i < 3; i++) {
        const double *const row = all + 16 * body + 4 * i;
        place[i] = row[0] * local[0] + row[1] * local[1] + row[2] * local[2] + row[3];
    }
    for (int i = 0; i < m; i++) {
        seen[i] = axes[3 * i] * place[0] + axes[3 * i + 1] * place[1] + axes[3 * i + 2] * place[2];
    }
}

/* One step of a point of a body towards a target, seen along m axes, as far as the constraints let it. */
EXPORT(web_pull) int web_pull(double t, double *q, const int *held, int body, const double *local, const double *axes,
    int m, const double *target, double size)
{
    double seen[3], moved[3];
    const double h = 1e-6;
    if (residual(t, q, solver.e) == HUGE_VAL || slopes(t, q, held) != 0 || call(poses, t, q, solver.poses) != 0) {
        return 1;
    }
    point_of(solver.poses, body, local, axes, m, seen);
    for (int k = 0; k < n_v; k++) {
        memset(solver.dz, 0, 8 * (unsigned long)n_v);
        solver.dz[k] = h;
        move(q, solver.dz, solver.trial);
        if (held[k] || call(poses, t, solver.trial, solver.poses) != 0) {
            memcpy(moved, seen, sizeof seen);
        } else {
            point_of(solver.poses, body, local, axes, m, moved);
        }
        for (int i = 0; i < m; i++) {
            solver.J[(n_h + i) * n_v + k] = (moved[i] - seen[i]) / (h * size);
        }
    }
    for (int i = 0; i < n_h + m; i++) {
        solver.ridge[i] = i < n_h ? 0.0 : 1e-3;
    }
    for (int i = 0; i < m; i++) {
        solver.e[n_h + i] = (seen[i] - target[i]) / size;
    }
    least_step(n_h + m);
    move(q, solver.dz, solver.trial);
    memcpy(q, solver.trial, 8 * (unsigned long)n_q);
    return 0;
}

/* A run. */

/* Semi-implicit Euler with steps of one size: velocities first, then coordinates by the new ones, then back onto the
   constraints, as <name>_step_semi_implicit of a C library. */
static void semi_implicit_attempt(eomgen_run *r, double h)
{
    double *const rates = r->K + r->n;
    for (int i = 0; i < r->n; i++) {
        r->y[i] = r->y_old[i] + (i >= n_q ? h * r->K[i] : 0.0);
    }
    eomgen_evaluate(r, r->t, r->y, rates);
    for (int i = 0; i < n_q; i++) {
        r->y[i] += h * rates[i];
    }
    if (n_c > 0 && call(find("project"), r->t + h, r->y, rates) == 0) {
        memcpy(r->y, rates, 8 * (unsigned long)r->n);
    }
    eomgen_evaluate(r, r->t + h, r->y, r->f);
}

static eomgen_method semi_implicit; /* the rest is that of RK4 */
static const eomgen_method *const methods[] = {&WEB_METHOD, &eomgen_rk4, &semi_implicit}, *method;

static int larger(int a, int b)
{
    return a > b ? a : b;
}

EXPORT(web_open) void web_open(int coordinates, int count, const int *pairs, int n_events, const int *direction,
    const long *most, const int *action, int n_resets, const int *reset_of, const int *reset_x)
{
    model = eomgen_model_table();
    const int n = find("rhs")->n_in;
    constraints = find("constraints"), gradient = find("constraint_jacobian"), rates = find("velocity_constraints");
    poses = find("poses");
    n_q = coordinates, n_v = n - n_q, n_h = length(constraints), n_c = length(rates), slots = pairs, n_slots = count;
    c = numbers(model->n_const), u = numbers(model->n_u), w = numbers(model->n_work), atol = numbers(n);
    signals = (eomgen_signal *)numbers(model->n_u * (long)sizeof(eomgen_signal) / 8 + 1);
    scales = numbers(n_v + n_c);
    const int m = n_c + 3;
    solver.e = numbers(m), solver.ridge = numbers(m), solver.J = numbers((long)m * n_v), solver.G = numbers((long)m * m);
    solver.dz = numbers(n_v), solver.trial = numbers(n_q), solver.poses = numbers(length(poses));

    semi_implicit = eomgen_rk4, semi_implicit.attempt = semi_implicit_attempt, method = methods[0];
    const int rows_F = larger(method->rows_F, eomgen_rk4.rows_F);
    const long size_K = (long)n * larger(method->rows_K, eomgen_rk4.rows_K) + eomgen_further(method, n, NULL);
    double *const free = numbers(n * (5L + rows_F) + size_K);
    run.rhs = function("rhs"), run.jacobian = function("jacobian"), run.meeting = function("meeting_time");
    run.c = c, run.u = u, run.n_u = model->n_u, run.w = w, run.n = n, run.n_q = n_q, run.atol = atol;
    run.y = free, run.y_old = free + n, run.f = free + 2 * n, run.failure_state = free + 3 * n, run.next = free + 4 * n;
    run.K = free + 5 * n, run.F = run.K + size_K;
    run.closed = model->closed_at != 0 ? w + model->closed_at : NULL;
    path.nodes = &node, path.n_nodes = 1, path.pieces_room = 1, path.pieces = numbers(3 + n * (1L + rows_F));
    if (n_events == 0) {
        return;
    }
    eomgen_events *const ev = &events;
    path.events = ev, path.notes_room = 2 * n_events + 64, path.notes = numbers(path.notes_room * (2L + n));
    ev->n = ev->n_model = n_events, ev->values = function("events"), ev->resets = function("resets");
    ev->project = n_c > 0 ? function("project") : NULL;
    ev->direction = direction, ev->most = most, ev->action = action, ev->crowd = RUNS_CROWD;
    ev->n_resets = n_resets, ev->reset_of = reset_of, ev->reset_x = reset_x, ev->values_reset = numbers(n_resets);
    double *const work = numbers(15L * n_events + n);
    ev->g = work, ev->g_new = work + n_events, ev->slope = work + 2 * n_events, ev->slope_new = work + 3 * n_events;
    ev->size = work + 4 * n_events, ev->trial = work + 5 * n_events, ev->latest = work + 6 * n_events;
    ev->bracket = work + 7 * n_events, ev->y = work + 15 * n_events;
    ev->count = (long *)web_room(n_events * (long)sizeof(long));
    int *const whole = (int *)web_room(5L * n_events * (long)sizeof(int));
    ev->leaving = whole, ev->fired = whole + n_events, ev->touch = whole + 2 * n_events, ev->whose = whole + 3 * n_events;
}

EXPORT(web_scales) double *web_scales(void)
{
    const double at = 0.0;
    (void)call(find("scales"), 0.0, &at, scales);
    return scales;
}

EXPORT(web_begin) void web_begin(double t, const double *x, double rtol, const double *tolerances, double longest,
    double first, double span, int number)
{
    const int n = run.n;
    method = methods[number];
    memcpy(run.y, x, 8 * (unsigned long)n);
    memcpy(atol, tolerances, 8 * (unsigned long)n);
    run.t = run.t_old = t, run.rtol = rtol, run.max_step = longest, run.h_abs = first, run.until_callback = -1;
    run.failure = 0, run.hold = (double)NAN, run.evaluations = run.rejected = run.steps = 0, run.step = 0.0;
    run.t_bound = node = 1e12, run.direction = 1.0;
    path.begun = 0, path.node = path.done = path.stored = path.n_pieces = path.n_notes = path.resets = 0;
    path.span = span;
    for (int i = 0; i < events.n; i++) {
        events.count[i] = 0, events.leaving[i] = events.fired[i] = events.touch[i] = 0;
        events.size[i] = 0.0;
    }
    events.crowded = 0;
}

/* Steps until a time lies within the last of them: 1, or 0 if more are needed; else what ended the run. */
EXPORT(web_advance) int web_advance(double target, int most)
{
    path.n_notes = 0;
    for (int k = 0; k < most && (!path.begun || run.t < target); k++) {
        if (path.events != NULL && path.n_notes + 2 * events.n > path.notes_room) {
            return 0;
        }
        path.n_pieces = 0;
        const int status = eomgen_advance(method, &run, &path);
        if (status != EOMGEN_FULL) {
            return 10 * status; /* told from the above */
        }
    }
    return run.t >= target;
}

/* The state at a time of the last step. */
EXPORT(web_state) void web_state(double t, double *y)
{
    if (path.n_pieces == 0) {
        memcpy(y, run.y, 8 * (unsigned long)run.n);
        return;
    }
    eomgen_run at = run;
    at.t_old = path.pieces[0], at.step = path.pieces[1], at.y_old = path.pieces + 3, at.F = path.pieces + 3 + run.n;
    method->interpolate(&at, t, y);
}

EXPORT(web_time) double web_time(void)
{
    return run.t;
}

EXPORT(web_notes) double *web_notes(void)
{
    return path.notes;
}

EXPORT(web_noted) int web_noted(void)
{
    return (int)path.n_notes;
}

EXPORT(web_failure) int web_failure(void)
{
    return run.failure;
}
