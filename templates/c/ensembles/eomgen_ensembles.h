/* Many runs of one model: trajectories taken from a queue by any number of threads. */
#ifndef EOMGEN_ENSEMBLES_H
#define EOMGEN_ENSEMBLES_H

#include "eomgen_steppers.h"

/* How a trajectory ended; 0 at the end of its span. */
enum {
    EOMGEN_NOT_RUN = 1,
    EOMGEN_TOO_MANY_STEPS = -101,
    EOMGEN_BAD_PARAMETERS = -102
};

enum { EOMGEN_GLANCE = 64 }; /* steps between looks at `stop` */

/* The trajectories of one batch and what became of them. The caller owns every array; rows belong to trajectories. Results do
   not depend on which thread or lane takes which trajectory. */
typedef struct {
    const eomgen_method *method;
    const eomgen_model *model;
    eomgen_function rhs;
    eomgen_lane_function lane_rhs; /* NULL: one trajectory at a time */
    int lane_width;
    int n;                        /* states */
    long count;                   /* trajectories */
    const double *x0;             /* count rows of n */
    const double *p, *u;          /* rows of n_p and n_u, the same row for all where the stride is 0 */
    long p_stride, u_stride;
    const eomgen_signal *signals; /* n_u of them, the same for all, or NULL */
    const double *nodes;          /* n_nodes times: start, corners of the signals, end */
    int n_nodes;
    double rtol, max_step, first_step; /* first_step 0: chosen */
    const double *atol;           /* n */
    long max_steps;
    const double *t_eval;         /* n_eval times in the direction of the run */
    long n_eval;
    double *samples;              /* count blocks of n_eval rows of n, NaN where a trajectory did not get to */
    double *x, *t;                /* count rows of n: last state; its time */
    int *status;
    long *steps, *rejected, *evaluations;
    int *failure;                 /* status of the last evaluation that failed, 0 if none did */
    double *failure_time;
    long next, done;              /* queue; shared between threads */
    int stop;                     /* set by anyone: no further trajectory is begun, those under way end as not run */
} eomgen_ensemble;

/* How trajectories are run side by side; one for each width that was compiled. */
typedef struct {
    int width;
    long (*memory)(const eomgen_ensemble *e);
    void (*work)(eomgen_ensemble *e, double *memory);
} eomgen_lane_worker;

/* The next trajectory of the queue, or -1. */
long eomgen_ensemble_take(eomgen_ensemble *e);

/* Doubles of memory that one thread needs. */
long eomgen_ensemble_memory(const eomgen_ensemble *e);

/* Take trajectories until there are none; called by every thread with memory of its own. */
void eomgen_ensemble_work(eomgen_ensemble *e, double *memory);

#endif
