/* Explicit Runge-Kutta steppers over a model's right-hand side, with SciPy's step control. */
#ifndef EOMGEN_STEPPERS_H
#define EOMGEN_STEPPERS_H

#include "eomgen.h"

/* One input over time: u = value of a table at t, or constant where n is 0. Outside the table its end values hold. */
typedef struct {
    int n;               /* points */
    int order;           /* 0 holds the last value, 1 linear, 3 cubic */
    const double *times; /* n, increasing */
    const double *values; /* n values; for order 3, 4 coefficients a point: value, slope, curvature / 2, third / 6 */
} eomgen_signal;

/* One integration. The caller owns every array; y, f, K, F change. */
typedef struct {
    eomgen_function rhs;
    const double *c;              /* constants of the model */
    double *u;                    /* n_u inputs; those with a signal change */
    const eomgen_signal *signals; /* n_u of them, or NULL */
    int n_u;
    double *w; /* work of rhs */
    int n;     /* states */
    double rtol, max_step, t_bound, direction;
    const double *atol;           /* n */
    double t, t_old, step, h_abs; /* step: the last one taken, with its sign; h_abs: size of the next to try */
    double *y, *y_old, *f;        /* n: state, the one before, x' of the state */
    const double *closed;         /* n in w: the state of the last evaluation on the constraints; NULL: steps start as they are */
    double *next;                 /* n: where the next step starts, if not NULL */
    double *K;                    /* rows_K rows of n: stages */
    double *F;                    /* rows_F rows of n: coefficients between y_old and y */
    int interpolates;             /* F belongs to the last step */
    long evaluations, rejected;
    int failure;                  /* status of the last evaluation that failed */
    double failure_time;
    double *failure_state;        /* n */
} eomgen_run;

/* A method; attempt forms y after a step and all stages, with x' there in the last; error is what the norm must keep
   under 1; prepare forms F. */
typedef struct {
    const char *name;
    int rows_K, rows_F;
    int error_order;
    void (*attempt)(eomgen_run *run, double h);
    double (*error)(const eomgen_run *run, double h);
    void (*prepare)(eomgen_run *run);
    void (*interpolate)(const eomgen_run *run, double t, double *y);
} eomgen_method;

extern const eomgen_method eomgen_dop853, eomgen_rk45, eomgen_rk23;

enum { EOMGEN_STEP_TOO_SMALL = -100 };

/* x' at (t, y) into k; NaN where the right-hand side fails, which is remembered. */
void eomgen_evaluate(eomgen_run *run, double t, const double *y, double *k);

/* First evaluation, and h_abs unless it is positive already. */
void eomgen_start(const eomgen_method *method, eomgen_run *run);

/* One accepted step: 0, or EOMGEN_STEP_TOO_SMALL. */
int eomgen_step(const eomgen_method *method, eomgen_run *run);

/* The state at time t of the last step. */
void eomgen_between(const eomgen_method *method, eomgen_run *run, double t, double *y);

/* Up to `steps` steps. Where n_eval is negative every step's time and state are stored (rows of n), else the states at the
   times t_eval[*done] onwards that were reached. *stored counts rows. 0 while running, 1 at t_bound, else a failure. */
int eomgen_advance(const eomgen_method *method, eomgen_run *run, long steps, const double *t_eval, long n_eval,
                   long *done, double *times, double *states, long *stored);

#endif
