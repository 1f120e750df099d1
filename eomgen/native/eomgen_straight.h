/* The right-hand side of closed loops by straight-line functions: Newton steps onto the constraints, then velocities
   and accelerations at once. Included by the solvers, and by a model whose constant table MODEL names, so that it is
   compiled with fixed sizes there. */
#ifndef EOMGEN_STRAIGHT_H
#define EOMGEN_STRAIGHT_H

#include "eomgen_solvers.h"

#ifndef MODEL
#define MODEL (at->m)
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

#include "eomgen_coordinates.h"

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
static double step_fraction(const eom_at *at, const double *restrict q)
{
    const double *const closing = AT(CLOSING), *const s = AT(SCALES);
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
static int step_directly(const eom_at *at, const double *restrict q)
{
    double *const closing = AT(CLOSING);
    const int shorter = MODEL->regular_closing != NULL;
    if (shorter) {
        if (EVALUATE(regular_closing, q, closing) == 0) {
            if (closing[2] <= CONSTRAINTS_NEARBY) {
                return 1;
            }
            (void)EVALUATE(closing, q, closing);
            return 0;
        }
    } else if (EVALUATE(closing, q, closing) == 0) {
        return 0;
    }
    for (int k = 0; k < 3 + N; k++) {
        closing[k] = 0.0; /* only rounding is left of the constraints */
    }
    return shorter;
}

/* Velocities and accelerations at the closed position y to the area of `dynamics`. regular: whether the shorter form
   may hold. */
static int accelerate_directly(const eom_at *at, const double *restrict y, int regular)
{
    double *const dynamics = AT(DYNAMICS);
    regular = regular && MODEL->regular_dynamics != NULL;
    if (regular && EVALUATE(regular_dynamics, y, dynamics) == 0 && dynamics[2 * N] != 0.0) {
        return 0;
    }
    return EVALUATE(dynamics, y, dynamics);
}

/* The nearest q with C(q) = 0, in place; nonzero where that takes many steps. *regular: whether the shorter form held
   last. */
static int close_directly(const eom_at *at, double *restrict q, int *restrict regular)
{
    double *const closing = AT(CLOSING);
    *regular = 0;
    for (int step = 0, all = 0; step < 6 && all < 25; all++) {
        *regular = step_directly(at, q);
        const double left = closing[1], length = closing[2];
        if (!(length <= 0.25)) { /* or not a number */
            const double part = step_fraction(at, q);
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
    int regular;
    for (int k = 0; k < NQ + N; k++) {
        y[k] = x[k];
    }
    if (close_directly(at, y, &regular) != 0 || accelerate_directly(at, y, regular) != 0 || dynamics[2 * N] == 0.0) {
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
#endif
