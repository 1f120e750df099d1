/* Many runs of one model: trajectories taken from a queue by any number of threads. */
#ifndef EOMGEN_ENSEMBLES_H
#define EOMGEN_ENSEMBLES_H

#include <stddef.h>
#include <stdint.h>

#include "eomgen_steppers.h"

/* How a trajectory ended: 0 at the end of its span, 1 at an event, or a failure of eomgen_advance or this. */
enum { EOMGEN_BAD_PARAMETERS = -110 };

#ifndef EOMGEN_PRECOMPUTE /* as EOMGEN_RHS */
#define EOMGEN_PRECOMPUTE(model) (model)->precompute
#endif

enum { EOMGEN_CALLBACK_STRIDE = 500 }; /* evaluations between reads of `stop` */

/* The trajectories of one batch and what became of them. The caller owns every array; rows belong to trajectories. Results do
   not depend on which thread or lane takes which trajectory; those in lanes differ from others within the tolerance. */
typedef struct {
    const eomgen_method *method;
    const eomgen_model *model;
    eomgen_function rhs;
    eomgen_function jacobian;      /* of implicit methods */
    eomgen_function meeting;       /* as in eomgen_run */
    int n_q;
    const eomgen_series *series;   /* of Taylor's method */
    void (*lane_rhs)(void);        /* see eomgen_lanes; NULL: one trajectory at a time */
    void (*lane_series)(void);     /* likewise */
    int lane_width;
    int n;                        /* states */
    ptrdiff_t count;              /* trajectories */
    const double *x0;             /* count rows of n */
    const double *p, *u;          /* rows of n_p and n_u, the same row for all where the stride is 0 */
    ptrdiff_t p_stride, u_stride;
    const double *nodes;          /* n_nodes times: start, corners of the signals, end */
    int n_nodes;
    double rtol, max_step, first_step; /* first_step 0: chosen */
    const double *atol;           /* n */
    int64_t max_steps;
    const double *t_eval;         /* n_eval times in the direction of the run */
    ptrdiff_t n_eval;
    double *samples;              /* count blocks of n_eval rows of n, NaN where a trajectory did not get to */
    double *x, *t;                /* count rows of n: last state; its time */
    int *status;
    int64_t *steps, *rejected, *evaluations;
    ptrdiff_t n_notes;            /* rows kept for each trajectory's events; a row: event, t, state (n) */
    double *notes;                /* count blocks of n_notes rows, NaN where there were fewer, or NULL */
    int64_t *noted;               /* how many events there were */
    int *failure;                 /* status of the last evaluation that failed, 0 if none did */
    double *failure_time;
    ptrdiff_t next, done;         /* queue; shared between threads */
    int stop;                     /* set by anyone: no further trajectory is begun, those under way end as stopped */
} eomgen_ensemble;

/* What every thread has of its own. */
typedef struct {
    const eomgen_signal *signals; /* n_u of them, or NULL */
    eomgen_events *events;        /* or NULL; none may wait for the caller */
    double *notes;                /* notes_room rows of 2 + n, where there are events: at least 2 for each */
    long notes_room;
    double *memory;               /* eomgen_ensemble_memory */
} eomgen_thread;

/* How trajectories are run side by side; one for each width that was compiled. */
typedef struct {
    int width;
    ptrdiff_t (*memory)(const eomgen_ensemble *e, const eomgen_thread *own);
    int (*takes)(const eomgen_ensemble *e, const eomgen_thread *own); /* whether this ensemble can be run so */
    void (*work)(eomgen_ensemble *e, const eomgen_thread *own);
} eomgen_lane_worker;

/* The next trajectory of the queue, or -1. */
ptrdiff_t eomgen_ensemble_take(eomgen_ensemble *e);

/* A run with the work w of the functions, its constants, inputs and rows in memory; returns what lies behind them. */
double *eomgen_set_up(eomgen_run *run, const eomgen_ensemble *e, const eomgen_thread *own, double *w, double *memory);

/* Keep the events noted by now for trajectory k, as many as there is room for. */
void eomgen_keep_notes(eomgen_ensemble *e, eomgen_trajectory *trajectory, ptrdiff_t k);

/* Doubles of memory that one thread needs. */
ptrdiff_t eomgen_ensemble_memory(const eomgen_ensemble *e, const eomgen_thread *own);

/* Take trajectories until there are none. */
void eomgen_ensemble_work(eomgen_ensemble *e, const eomgen_thread *own);

#endif
