/* The right-hand side of closed loops by straight-line functions: Newton steps onto the constraints, then velocities
   and accelerations at once. Included by the solvers, by a model whose constant table MODEL names, so that it is
   compiled with fixed sizes there, and by its lanes. */
#ifndef EOMGEN_STRAIGHT_H
#define EOMGEN_STRAIGHT_H

#include "eomgen_solvers.h"

#ifdef EOMGEN_PLAIN
#ifdef MODEL
#define NAMED_STEPS /* so that they become parts of their caller */
#define STEP(function, q, out) function##_block(at->t, q, at->u, at->c, out, at->w)
#ifdef SHORT_FORM
#define SHORTER 1
#else
#define SHORTER 0
#define short_closing_block closing_block
#endif
#else
#define MODEL (at->m)
#define STEP EVALUATE
#define SHORTER (MODEL->short_closing != NULL)
#endif
#define N (MODEL->n_v)
#define NQ (MODEL->n_q)
#define COORDINATE (MODEL->coordinate)
#define QUATERNIONS (MODEL->n_quaternions)
#define QUATERNION (MODEL->quaternion)
#define AT(area) (at->w + MODEL->areas[AREA_##area])
#define AT_V (AT(X) + NQ)
#define AT_ACC (AT_V + N)
#define AT_L (AT_ACC + N)
#define AT_DQ (AT_L + MODEL->n_c)
#define AT_DV (AT_DQ + NQ)
/* A straight-line function of the model, of x; its status. */
#define EVALUATE(function, x, out) (MODEL->function(at->t, x, at->u, at->c, out, at->w))

#endif

/* How coordinates change with velocities: q' = v; or e' = E^T w / 2 for Euler parameters e in q and angular
   velocities w in v (A. A. Shabana, Computational Dynamics, chapter 7), whose length every step keeps and which means
   nothing; or by functions of the model, q' = N(q, t) v + b(q, t). Over `real`: lanes share this
   text, and define N, NQ, COORDINATE, QUATERNIONS and QUATERNION before. */
EOMGEN_EACH(root_of_each, sqrt)
EOMGEN_EACH(sine_of_each, sin)
EOMGEN_EACH(cosine_of_each, cos)

/* Whether every velocity is the rate of the coordinate of its number. */
#define PLAIN_RATES (QUATERNIONS == 0 && NQ == N)

EOMGEN_SHARED void turn(const real *restrict e, const real *restrict w, real factor, real *restrict rates)
{
    const real x = 0.5 * factor * w[0], y = 0.5 * factor * w[1], z = 0.5 * factor * w[2];
    rates[0] -= e[1] * x + e[2] * y + e[3] * z;
    rates[1] += e[0] * x - e[3] * y + e[2] * z;
    rates[2] += e[3] * x + e[0] * y - e[1] * z;
    rates[3] += e[1] * y - e[2] * x + e[0] * z;
}

#ifdef EOMGEN_PLAIN
/* dq += N(q, t) d, with the areas of q and dv in between. */
EOMGEN_SHARED void add_moved(const eom_at *at, const double *q, const double *d, double *dq)
{
    double *const moved = AT(RATES);
    for (int k = 0; k < NQ; k++) {
        AT(X)[k] = q[k];
    }
    for (int k = 0; k < N; k++) {
        AT_DV[k] = d[k];
    }
    (void)EVALUATE(moved, AT(X), moved);
    for (int k = 0; k < NQ; k++) {
        dq[k] += moved[k];
    }
}
#endif

/* q moved by d, which is as velocities are. */
EOMGEN_SHARED void move(const eom_at *at, real *restrict q, const real *restrict d)
{
    (void)at;
#ifdef EOMGEN_PLAIN
    if (MODEL->rates != NULL) {
        add_moved(at, q, d, q);
        return;
    }
#endif
    if (PLAIN_RATES) {
        for (int k = 0; k < N; k++) {
            q[k] += d[k];
        }
        return;
    }
    for (int k = 0; k < N; k++) {
        if (COORDINATE[k] >= 0) {
            q[COORDINATE[k]] += d[k];
        }
    }
    for (int b = 0; b < QUATERNIONS; b++) {
        real *const e = q + QUATERNION[b][0];
        const real *const w = d + QUATERNION[b][1], old[4] = {e[0], e[1], e[2], e[3]};
        const real half = 0.5 * root_of_each(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        const real shrunk = cosine_of_each(half), ratio = sine_of_each(half) / half;
        for (int i = 0; i < 4; i++) {
            e[i] = shrunk * old[i];
        }
        turn(old, w, choose(half > 0.0, ratio, same(1.0)), e);
    }
}

/* q' of [q; v]. */
EOMGEN_SHARED void form_rates(const eom_at *at, const real *restrict q, const real *restrict v, real *restrict rates)
{
    (void)at, (void)q;
#ifdef EOMGEN_PLAIN
    if (MODEL->rates != NULL) {
        (void)EVALUATE(rates, q, rates);
        return;
    }
#endif
    if (PLAIN_RATES) {
        for (int k = 0; k < N; k++) {
            rates[k] = v[k];
        }
        return;
    }
    for (int k = 0; k < NQ; k++) {
        rates[k] = same(0.0);
    }
    for (int k = 0; k < N; k++) {
        if (COORDINATE[k] >= 0) {
            rates[COORDINATE[k]] = v[k];
        }
    }
    for (int b = 0; b < QUATERNIONS; b++) {
        turn(q + QUATERNION[b][0], v + QUATERNION[b][1], same(1.0), rates + QUATERNION[b][0]);
    }
}

#ifdef EOMGEN_PLAIN
/* A full step of this scaled length that leaves so much of the residual, by linear theory, is the last one needed. */
static inline int arrives(double longest, double left)
{
    return longest <= CONSTRAINTS_SHORT && left <= CONSTRAINTS_EXACT;
}

static inline double longest_of(const double *restrict step, int length)
{
    double longest = 0.0;
    for (int k = 0; k < length; k++) {
        longest = fabs(step[k]) > longest ? fabs(step[k]) : longest;
    }
    return longest;
}

/* Limits the largest entry of a scaled Newton step to 0.5. */
static inline double damping(const double *restrict step, int length)
{
    const double longest = longest_of(step, length);
    return longest > 0.5 ? 0.5 / longest : 1.0;
}

/* The part of a long step that close_position takes, so that far states come to the same place; 0 where only rounding
   is left of the constraints, whose weak rows need a term that is not known here. */
static double step_fraction(const eom_at *at, const double *restrict q, const double *restrict closing)
{
    const double *const s = AT(SCALES);
    double *const dz = AT(STEP);
    if (!(closing[0] > CONSTRAINTS_GENTLE) || !isfinite(closing[2])) {
        return 0.0;
    }
    (void)EVALUATE(scales, q, AT(SCALES));
    for (int k = 0; k < N; k++) {
        dz[k] = closing[3 + k] / s[k];
    }
    return damping(dz, N);
}

/* A Newton step onto the constraints to the area of `closing`. Returns whether the shorter form holds: near the
   constraints, away from singular positions. */
static int step_directly(const eom_at *at, const double *restrict q, double *restrict closing)
{
    if (SHORTER) {
        if (STEP(short_closing, q, closing) == 0) {
            if (closing[2] <= CONSTRAINTS_NEARBY) {
                return 1;
            }
            (void)STEP(closing, q, closing);
            return 0;
        }
    } else if (STEP(closing, q, closing) == 0) {
        return 0;
    }
    for (int k = 0; k < 3 + N; k++) {
        closing[k] = 0.0; /* only rounding is left of the constraints */
    }
    return SHORTER;
}

/* Velocities and accelerations at the closed position y to the area of `dynamics`. shorter: whether the shorter form
   may hold. */
static int accelerate_directly(const eom_at *at, const double *restrict y, int shorter)
{
    double *const dynamics = AT(DYNAMICS);
    shorter = shorter && MODEL->short_dynamics != NULL;
    if (shorter && EVALUATE(short_dynamics, y, dynamics) == 0 && dynamics[2 * N] != 0.0) {
        return 0;
    }
    return EVALUATE(dynamics, y, dynamics);
}

/* The nearest q with C(q) = 0, in place; nonzero where that takes many steps. *shorter: whether the shorter form held
   last. w: that of `at`, an argument so that both forms share their sines: compilers see that it holds no q. */
static int close_directly(const eom_at *at, double *restrict q, double *restrict w, int *restrict shorter)
{
    double *const closing = w + MODEL->areas[AREA_CLOSING];
#ifndef NAMED_STEPS
    if (MODEL->close != NULL) {
        return MODEL->close(at, q, w, shorter);
    }
#endif
    *shorter = 0;
    for (int step = 0, all = 0; step < 6 && all < 25; all++) {
        *shorter = step_directly(at, q, closing);
        const double left = closing[1], length = closing[2];
        if (!(length <= 0.25)) { /* or not a number */
            const double part = step_fraction(at, q, closing);
            if (part == 0.0) {
                break;
            }
            for (int k = 0; k < N; k++) {
                closing[3 + k] *= part;
            }
            move(at, q, closing + 3);
            continue;
        }
        for (int k = 0; length == 0.0 && k < N; k++) {
            closing[3 + k] = -0.0; /* adding -0 changes nothing, not even the sign of a zero */
        }
        step += !(closing[0] > CONSTRAINTS_GENTLE); /* before, close_position makes the same steps, however many */
        move(at, q, closing + 3);
        if (arrives(length, left)) {
            return 0;
        }
    }
    return EOMGEN_PROJECTION_FAILED;
}

/* x'; whether it is sound. Leaves the state on the constraints in AT(X). *far: whether no singular position is near. */
static int rhs_directly(const eom_at *at, const double *restrict x, double *restrict out, int *restrict far)
{
    double *const y = AT(X);
    const double *const dynamics = AT(DYNAMICS);
    int shorter;
    for (int k = 0; k < NQ + N; k++) {
        y[k] = x[k];
    }
    if (close_directly(at, y, at->w, &shorter) != 0 || accelerate_directly(at, y, shorter) != 0 || dynamics[2 * N] == 0.0) {
        return 0;
    }
    form_rates(at, y, dynamics, out);
    for (int k = 0; k < N; k++) {
        y[NQ + k] = dynamics[k];
        out[NQ + k] = dynamics[N + k];
    }
    *far = dynamics[2 * N + 1] != 0.0;
    return 1;
}

/* The same, by the solvers where that is not enough. */
EOMGEN_SHARED int rhs_or_solved(const eom_at *at, const double *restrict x, double *restrict out)
{
    int far = 0;
    const int sound = rhs_directly(at, x, out, &far);
    return sound && far ? EOMGEN_SUCCESS : eom_finish_rhs(at, x, out, sound);
}
#else
/* Of states side by side, whose closing_block and dynamics_block and, where SHORT_FORM is defined, the shorter forms of
   both stand above; AT_X, AT_CLOSING, AT_DYNAMICS: their areas of w. */

/* A Newton step onto the constraints; whether the shorter form holds. The long code runs where a lane needs it, and
   counts for these lanes alone. */
static flag step_directly(real t, const real *restrict q, const real *restrict u, const real *restrict c,
    real *restrict closing, real *restrict w)
{
#ifdef SHORT_FORM
    (void)short_closing_block(t, q, u, c, closing, w);
    const flag shorter = closing[2] <= CONSTRAINTS_NEARBY;
    if (any_of(~shorter)) {
        real other[N + 3];
        (void)closing_block(t, q, u, c, other, w);
        for (int k = 0; k < N + 3; k++) {
            closing[k] = choose(shorter, closing[k], other[k]);
        }
    }
    return shorter;
#else
    const flag none = { 0 };
    (void)closing_block(t, q, u, c, closing, w);
    return none;
#endif
}

static flag accelerate_directly(real t, const real *restrict y, const real *restrict u, const real *restrict c,
    flag shorter, real *restrict dynamics, real *restrict w)
{
#ifdef SHORT_FORM
    shorter &= ~short_dynamics_block(t, y, u, c, dynamics, w) & (dynamics[2 * N] != 0.0);
    const flag none = { 0 };
    flag failed = none;
    if (any_of(~shorter)) {
        real other[2 * N + 2];
        failed = ~shorter & dynamics_block(t, y, u, c, other, w);
        for (int k = 0; k < 2 * N + 2; k++) {
            dynamics[k] = choose(shorter, dynamics[k], other[k]);
        }
    }
    return failed;
#else
    (void)shorter;
    return dynamics_block(t, y, u, c, dynamics, w);
#endif
}

/* x' of states side by side, each with Newton steps of its own, so that every lane has the bits of one state. Returns
   the lanes that are left to the function of one state: far from the constraints, next to a singular position, or
   where the straight-line accelerations are not sound. Leaves the states on the constraints in w + AT_X. */
static flag rhs_driver(EOMGEN_ARGUMENTS)
{
    const flag none = { 0 };
    real *const y = w + AT_X, *const closing = w + AT_CLOSING, *const dynamics = w + AT_DYNAMICS;
    real step[N];
    flag open = ~none, left = none, shorter = none;
    for (int k = 0; k < NQ + N; k++) {
        y[k] = x[k];
    }
    for (int i = 0; i < 6 && any_of(open); i++) {
        const flag holds = step_directly(t, y, u, c, closing, w);
        shorter = (shorter & ~open) | (holds & open);
        left |= open & ~(closing[2] <= 0.25); /* or not a number */
        open &= ~left;
        for (int k = 0; k < N; k++) {
            step[k] = choose(open & (closing[2] != 0.0), closing[3 + k], same(-0.0)); /* adding -0 changes nothing */
        }
        move(NULL, y, step);
        open &= ~((closing[2] <= CONSTRAINTS_SHORT) & (closing[1] <= CONSTRAINTS_EXACT));
    }
    left |= open | accelerate_directly(t, y, u, c, shorter, dynamics, w);
    left |= (dynamics[2 * N] == 0.0) | (dynamics[2 * N + 1] == 0.0);
    form_rates(NULL, y, dynamics, out);
    for (int k = 0; k < N; k++) {
        y[NQ + k] = dynamics[k];
        out[NQ + k] = dynamics[N + k];
    }
    return left;
}
#endif
#endif
