/* Impulses of rigid contacts (eomgen/numeric/contact_impulses.py says the laws and the methods), and a step of a mechanism with
   them (eomgen/simulation/rigid_steps.py says the scheme). */
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

/* What became of a step: one of its halves is too long; a function failed, or an inertia has no factor, which the caller looks
   into; more contacts are near than there is room for; an input over time has no value. */
enum { EOMGEN_STEPPED, EOMGEN_TOO_LONG, EOMGEN_LOOK, EOMGEN_MORE_ROOM, EOMGEN_NO_INPUT };

typedef struct {
    int n_q, n_v, n_u, n_rows, n_c, n_h; /* all constraint rows, those that are independent, and holonomic among these */
    int n_plain, n_balls, n_lists, n_shapes, n_spots, d, m;
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
} eomgen_rigid;

int eomgen_contacts_wide(void);

/* How many numbers a step works on whatever the contacts, and how many more for as many as there is room for. */
long eomgen_rigid_fixed(const eomgen_rigid *s);
long eomgen_rigid_further(const eomgen_rigid *s);

/* A step from x at t over a time h, to next. `known` and what follows are of the last step that was done. */
int eomgen_rigid_step(eomgen_rigid *s, double t, double h);

/* Both texts. */
void eomgen_plain_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                                 double tolerance, int most, double *work, int *numbers, int *count, double *residual);
int eomgen_plain_rigid_step(eomgen_rigid *s, double t, double h);
long eomgen_plain_rigid_fixed(const eomgen_rigid *s);
long eomgen_plain_rigid_further(const eomgen_rigid *s);
void eomgen_wide_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                                double tolerance, int most, double *work, int *numbers, int *count, double *residual);
int eomgen_wide_rigid_step(eomgen_rigid *s, double t, double h);
long eomgen_wide_rigid_fixed(const eomgen_rigid *s);
long eomgen_wide_rigid_further(const eomgen_rigid *s);

#endif
