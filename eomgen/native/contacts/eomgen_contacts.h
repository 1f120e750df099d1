/* Impulses of rigid contacts, and a step of a mechanism with them (eomgen/runtime/impacts/moreau.py says the scheme).

   Of each contact the impulse P = (P_n, P_t) and the velocity y = c + W P, less what the normal one is to be, obey

       0 <= P_n  _|_  y_n >= 0,      P_t in the disc of radius mu P_n, opposite to y_t on its edge where y_t is not 0

   (Signorini and Coulomb). Both are zeros of the natural maps of P. Alart, A. Curnier, A mixed formulation for frictional
   contact problems prone to Newton like solution methods, Comput. Methods Appl. Mech. Eng. 92 (1991), 353-375,

       P_n - max(0, P_n - r y_n),      P_t - (P_t - s y_t) brought into the disc of radius mu max(0, P_n - r y_n),

   which a Newton method with the derivatives of the branch at hand solves (impulses.c). Contacts may be more than there are
   freedoms: each round solves for contacts that are a little softer about the impulses of the round before (the proximal
   point method, R. T. Rockafellar, SIAM J. Control Optim. 14 (1976), 877-898), which leaves the matrix regular and the
   solution as it is. Where Newton leads nowhere, sweeps over single contacts go on (M. Jean, The non-smooth contact dynamics
   method, Comput. Methods Appl. Mech. Eng. 177 (1999), 235-257), and one contact in the plane by its four cases. Before all
   that, many contacts are solved by the edges of their cones (G. de Saxce, Z.-Q. Feng, The bipotential method,
   Math. Comput. Modelling 28 (1998), 225-245; D. Goldfarb, A. Idnani, A numerically stable dual method for solving strictly
   convex quadratic programs, Math. Program. 27 (1983), 1-33; F. Cadoux, Ph.D. thesis, Grenoble, 2009), or in space by
   sweeps. What is left goes to laws that are rounded over a velocity and become sharp (B. Chen, P. T. Harker, A
   non-interior-point continuation method for linear complementarity problems, SIAM J. Matrix Anal. Appl. 14 (1993),
   1168-1190). */
#ifndef EOMGEN_CONTACTS_H
#define EOMGEN_CONTACTS_H

#include "eomgen.h"

/* Loops over rows of numbers pay for what it takes to go through several at a time. */
#if defined(__GNUC__) && !defined(__clang__)
#define DENSE __attribute__((optimize("O3")))
#else
#define DENSE
#endif

/* Whether there is a second text, for processors with AVX2. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(EOMGEN_PORTABLE)
#define EOMGEN_TWO_WIDTHS
#endif

#if defined(__cplusplus) && !defined(restrict)
#define restrict __restrict /* C++ has no such word */
#endif

/* Impulses P (m x d) of m contacts of d directions, the normal first, for the compliance W (m d x m d, symmetric) and the
   velocities c without impulses (m x d). P holds a guess before, what was found after. work has n (n + 8) + 3 m numbers and
   numbers n + m, with n = m d. */
void eomgen_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                           double tolerance, int most, double *work, int *numbers, int *count, double *residual);

/* A function of a model, and the constants that it takes. */
typedef struct {
    eomgen_function call;
    const double *c;
} eomgen_source;

/* What became of a step: one of its halves is too long; a function failed, or an inertia has no factor (`source` is NULL); more
   contacts are near than there is memory for; an input over time has no value; a list has `needed` pairs and no room for them;
   a coefficient of the list is out of range. */
enum { EOMGEN_STEPPED, EOMGEN_TOO_LONG, EOMGEN_FAILED, EOMGEN_MORE_ROOM, EOMGEN_NO_INPUT, EOMGEN_TOO_MANY, EOMGEN_NO_LAW };

typedef struct {
    int n_q, n_v, n_u, n_rows, n_c, n_h; /* all constraint rows, those that are independent, and holonomic among these */
    int n_plain, n_balls, n_lists, n_shapes, n_witnesses, d, m;
    const int *rows, *plain, *balls;     /* independent rows; first places in q and v of coordinates, and of quaternions */
    const int *lists;                    /* numbers and shapes of each list of contacts */
    const signed char *moved;            /* n_shapes x n_v: whether a velocity moves a shape */
    eomgen_source mass, jacobian, drift, closure, near, axes, bias, meeting;
    int (*inputs)(void *forcing, double t, const double *x, double *u); /* NULL: u stays as it is */
    void *forcing;
    double *u, *w;
    double tolerance; /* of the laws, part of the velocities of contacts */
    int most;         /* iterations */
    int begins;       /* nothing was stepped yet */
    int wide;         /* whether the processor takes the second text: eomgen_contacts_wide */
    int room, needed; /* contacts */
    int *numbers;
    double *x, *x_m, *next, *held; /* states [q; v] before, in the middle and after; of eomgen_rigid_fixed */
    double *many;                  /* of eomgen_rigid_further */
    int known;                     /* contacts whose impulses are known from the last step: */
    int *keys;                     /* their shapes and places */
    double *last;                  /* their impulses (3) */
    double *acting;                /* contacts of the step: both shapes, normal, first direction across, point, impulses (3) */
    double residual, depth;
    int missed, iterations, contacts;
    const eomgen_source *source; /* what failed: the function, its status, and where */
    const double *where;
    double when, law[2];         /* coefficients of friction and restitution */
    int status, list;
} eomgen_rigid;

int eomgen_contacts_wide(void);

/* How many numbers a step works on whatever the contacts, and how many more for as many as there is room for. */
long eomgen_rigid_fixed(const eomgen_rigid *s);
long eomgen_rigid_further(const eomgen_rigid *s);

/* A step from x at t over a time h, to next. `known` and what follows are of the last step that was done. */
int eomgen_rigid_step(eomgen_rigid *s, double t, double h);

/* Both texts. */
#define EOMGEN_CONTACT_TEXT(width) \
    void eomgen_##width##_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P, \
                                         double tolerance, int most, double *work, int *numbers, int *count, double *residual); \
    int eomgen_##width##_rigid_step(eomgen_rigid *s, double t, double h); \
    long eomgen_##width##_rigid_fixed(const eomgen_rigid *s); \
    long eomgen_##width##_rigid_further(const eomgen_rigid *s);
EOMGEN_CONTACT_TEXT(plain)
EOMGEN_CONTACT_TEXT(wide)

#endif
