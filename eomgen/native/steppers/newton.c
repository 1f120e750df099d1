/* Systems (g - J) x = r of implicit methods. Where J = [0 1; K D], of a state [q; v] with q' = v, only
   (g - D - K / g) v = r_v + K r_q / g is solved, and q = (r_q + v) / g; other large ones by parts (newton_parts.c), or by what
   of J is not 0 (newton_sparse.c), whatever takes the least work. */
#include <math.h>
#include <string.h>

#include "eomgen_steppers.h"

/* Where each number of a run is, after the rows_K rows of n in run->K. */
typedef struct {
    double *J, *real, *re, *im; /* n x n each */
    double *state;              /* NEWTON_STATE numbers */
    int *order, *order_complex; /* n each */
} newton_area;

/* Numbers of the state: how J is made, by how much q drifts by itself, how many numbers sparse factors have; LARGE: states from
   which parts are worth while. */
enum { NEWTON_STATE = 16, HALVED = 0, DRIFT = 8, FILLED = 9 };
enum { WHOLE = 0, HALF = 1, PARTS = 2, SPARSE = 3, LARGE = 24 };

static newton_area newton_areas(const eomgen_run *run, int rows)
{
    const int n = run->n, square = n * n;
    double *const at = run->K + rows * n;
    double *const state = at + 4 * square;
    int *const order = (int *)(state + NEWTON_STATE);
    const newton_area areas = {at, at + square, at + 2 * square, at + 3 * square, state, order, order + n};
    return areas;
}

static int form_of(const newton_area *a)
{
    return (int)a->state[HALVED];
}

/* Whether the first half of J is [0 1]. */
static int is_halved(int n, const double *J)
{
    const int half = n / 2;
    if (n % 2 != 0) {
        return 0;
    }
    for (int i = 0; i < half; i++) {
        for (int k = 0; k < n; k++) {
            if (J[i * n + k] != (k == half + i ? 1.0 : 0.0)) {
                return 0;
            }
        }
    }
    return 1;
}

/* Whether J may be taken by parts. */
static int has_parts(const eomgen_run *run)
{
    const int n = run->n, m = n - run->n_q;
    return n >= LARGE && run->n_q > 0 && 2 * m * m <= n * n;
}

/* How J is made where its zeros are of no use. */
static void newton_look_whole(const eomgen_run *run, const newton_area *a)
{
    const int n = run->n, n_q = run->n_q, m = n - n_q;
    a->state[HALVED] = is_halved(n, a->J) ? HALF : WHOLE;
    if (form_of(a) == WHOLE && has_parts(run)) {
        a->state[HALVED] = PARTS;
        a->state[DRIFT] = parts_products(n, n_q, a->J, a->real + m * m, a->re + m * m, a->im);
    }
}

/* How J is made, which a step that is too long for parts ends, and a pivot that is too small (newton_factor). */
static void newton_look(const eomgen_run *run, const newton_area *a)
{
    const double n = run->n, n_q = run->n_q, m = n - n_q;
    double dense = n * n * n / 3.0;
    if (run->n >= SPARSE_FROM) {
        dense = is_halved(run->n, a->J) ? dense / 8.0 : has_parts(run) ? m * m * m / 3.0 + n_q * m * (n + m) : dense;
        a->state[FILLED] = sparse_look(run->n, a->J, dense, a->real, a->re, a->im);
        if (a->state[FILLED] > 0.0) {
            a->state[HALVED] = SPARSE;
            return;
        }
    }
    newton_look_whole(run, a);
}

/* dx'/dx at (t, y) into J, inputs that are expressions of the state included; 0, or the status of a failure. */
int eomgen_differentiate(eomgen_run *run, double t, const double *y, const double *f, double *J, double *spare)
{
    const int n = run->n;
    int feedback = 0;
    if (run->signals != NULL) {
        eomgen_force(run, t, y);
        for (int i = 0; i < run->n_u; i++) {
            feedback = feedback || run->signals[i].tape != NULL;
        }
    }
    run->differentiations++;
    const int status = run->jacobian(t, y, run->u, run->c, J, run->w);
    if (status != 0) {
        run->failure = status, run->failure_time = t;
        memcpy(run->failure_state, y, (size_t)n * sizeof(double));
        return status;
    }
    double *const moved = spare, *const change = spare + n;
    for (int k = 0; feedback && k < n; k++) { /* x' at inputs of a state moved a little, all else where it is */
        const double step = RUNS_SLOPE * fmax(fabs(y[k]), RUNS_SIZE);
        memcpy(moved, y, (size_t)n * sizeof(double));
        moved[k] += step;
        eomgen_force(run, t, moved);
        run->evaluations++;
        if (run->rhs(t, y, run->u, run->c, change, run->w) != 0) {
            continue;
        }
        for (int i = 0; i < n; i++) {
            J[i * n + k] += (change[i] - f[i]) / (moved[k] - y[k]);
        }
    }
    return 0;
}

/* Factor g - J for a real g and for g = x + i y; 1 if one is singular. */
static int newton_factor(eomgen_run *run, const newton_area *a, double g, double x, double y)
{
    const int n = run->n, n_q = run->n_q;
    const double square = x * x + y * y;
    run->factorizations += 2;
    if (form_of(a) == SPARSE) {
        const int filled = (int)a->state[FILLED];
        double *const room = a->im + filled;
        if (sparse_factor(n, filled, a->J, g, a->real, room) == 0 &&
            sparse_factor_complex(n, filled, a->J, x, y, a->real, a->re, a->im, room) == 0) {
            return 0;
        }
        newton_look_whole(run, a);
    }
    if (form_of(a) == PARTS && a->state[DRIFT] < RUNS_DRIFTING * fmin(fabs(g), sqrt(square))) {
        const int m = n - n_q;
        parts_matrices(n, n_q, a->J, a->real + m * m, a->re + m * m, g, x / square, -y / square, a->real, a->re, a->im);
        return factor_real(m, a->real, a->order) || factor_complex(m, a->re, a->im, a->order_complex);
    }
    a->state[HALVED] = form_of(a) == HALF ? HALF : WHOLE;
    const int halved = form_of(a) == HALF, m = halved ? n / 2 : n;
    for (int i = 0; i < m; i++) {
        const double *const row = a->J + (halved ? m + i : i) * n;
        double *const plain = a->real + i * m, *const re = a->re + i * m, *const im = a->im + i * m;
        for (int k = 0; k < m; k++) {
            const double K = halved ? row[k] : 0.0, D = row[halved ? m + k : k];
            plain[k] = -D - K / g;
            re[k] = -D - K * (x / square);
            im[k] = K * (y / square);
        }
        plain[i] += g, re[i] += x, im[i] += y;
    }
    return factor_real(m, a->real, a->order) || factor_complex(m, a->re, a->im, a->order_complex);
}

static void newton_solve(const eomgen_run *run, const newton_area *a, double g, double *restrict r)
{
    const int n = run->n, m = n / 2;
    if (form_of(a) == SPARSE) {
        sparse_solve(n, (int)a->state[FILLED], a->real, r, a->im + (int)a->state[FILLED]);
        return;
    }
    if (form_of(a) == PARTS) {
        const int n_q = run->n_q, n_v = n - n_q;
        double *const room = a->im + n_v * n_v;
        parts_carry(n, n_q, a->J, g, NULL, r, room);
        add_times(n_v, n_q, a->J + n_q * n, n, r, r + n_q);
        solve_real(n_v, a->real, a->order, r + n_q);
        parts_carry(n, n_q, a->J, g, r + n_q, r, room);
        return;
    }
    if (form_of(a) == WHOLE) {
        solve_real(n, a->real, a->order, r);
        return;
    }
    const double inverse = 1.0 / g;
    for (int i = 0; i < m; i++) {
        double sum = 0.0;
        for (int k = 0; k < m; k++) {
            sum += a->J[(m + i) * n + k] * r[k];
        }
        r[m + i] += sum * inverse;
    }
    solve_real(m, a->real, a->order, r + m);
    for (int i = 0; i < m; i++) {
        r[i] = (r[i] + r[m + i]) * inverse;
    }
}

/* The same for g = x + i y and r + i s. */
static void newton_solve_complex(const eomgen_run *run, const newton_area *a, double x, double y, double *restrict r,
                                 double *restrict s)
{
    const int n = run->n, m = n / 2;
    const double square = x * x + y * y, u = x / square, v = -y / square;
    if (form_of(a) == SPARSE) {
        const int filled = (int)a->state[FILLED];
        sparse_solve_complex(n, filled, a->real, a->re, a->im, r, s, a->im + filled);
        return;
    }
    if (form_of(a) == PARTS) {
        const int n_q = run->n_q, n_v = n - n_q;
        double *const room = a->im + n_v * n_v;
        parts_carry_complex(n, n_q, a->J, u, v, NULL, NULL, r, s, room);
        add_times(n_v, n_q, a->J + n_q * n, n, r, r + n_q);
        add_times(n_v, n_q, a->J + n_q * n, n, s, s + n_q);
        solve_complex(n_v, a->re, a->im, a->order_complex, r + n_q, s + n_q);
        parts_carry_complex(n, n_q, a->J, u, v, r + n_q, s + n_q, r, s, room);
        return;
    }
    if (form_of(a) == WHOLE) {
        solve_complex(n, a->re, a->im, a->order_complex, r, s);
        return;
    }
    for (int i = 0; i < m; i++) {
        double p = 0.0, q = 0.0;
        for (int k = 0; k < m; k++) {
            p += a->J[(m + i) * n + k] * r[k];
            q += a->J[(m + i) * n + k] * s[k];
        }
        r[m + i] += p * u - q * v, s[m + i] += p * v + q * u;
    }
    solve_complex(m, a->re, a->im, a->order_complex, r + m, s + m);
    for (int i = 0; i < m; i++) {
        const double p = r[i] + r[m + i], q = s[i] + s[m + i];
        r[i] = p * u - q * v, s[i] = p * v + q * u;
    }
}
