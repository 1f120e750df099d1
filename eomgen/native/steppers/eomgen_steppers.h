/* Steppers over a model's right-hand side, with SciPy's step control, without memory of their own. eomgen_run is one
   integration, eomgen_method how it steps; eomgen_trajectory is a whole one with inputs over time, events and output at
   given times. The caller owns every array. */
#ifndef EOMGEN_STEPPERS_H
#define EOMGEN_STEPPERS_H

#include <math.h>

#include "eomgen.h"

#if defined(__cplusplus) && !defined(restrict)
#define restrict __restrict /* C++ has no such word */
#endif

/* Expressions given at run time: instructions in order, each with a result of its own; see control.c for the operations. */
typedef struct {
    int n, n_out;          /* instructions, values handed out */
    const int *code;       /* rows of 4: operation, and its operands: earlier instructions, or an index for leaves */
    const double *numbers; /* of the operation `number` */
    const int *out;        /* n_out: the instructions handed out */
    double *results;       /* n, work */
} eomgen_tape;

/* One input over time: u = value of a table at t, or constant where n is 0. Outside the table its end values hold. */
typedef struct {
    int n;                /* points; 1 for a tape */
    int order;            /* 0 holds the last value, 1 linear, 3 cubic; 2 as 0, but read at t even inside a part;
                             4 cubic pieces that may jump where they meet */
    const double *times;  /* n, increasing */
    const double *values; /* n values; for order 3 and 4, 4 coefficients a point: value, slope, curvature / 2, third / 6 */
    const eomgen_tape *tape; /* an expression of t, x and parameters instead of a table, or NULL */
} eomgen_signal;

/* One integration; y, f, K, F change. */
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
    long evaluations, rejected, steps;
    long most_steps;              /* more are refused; 0: any number */
    int failure;                  /* status of the last evaluation that failed */
    double failure_time;
    double *failure_state;        /* n */
    double hold;                  /* inside the present part: where tables of order 0 and 4 have their piece; NAN: at t */
    long until_callback;          /* evaluations until callback is called; below 0 never */
    long (*callback)(void *callback_data, const double *t); /* the next until_callback, or 0 to stop the run */
    void *callback_data;
    eomgen_function jacobian;     /* of implicit methods */
    eomgen_function meeting;      /* of (q, v, a): a time in which no shapes meet, and 4 numbers, or NULL; n_q: coordinates */
    int n_q, n_beside;            /* states behind those of the model, as derivatives by parameters */
    /* Of a method that steps by functions of the caller: the inputs into u, or x' into f, the other is NULL; not 0: stop. */
    int (*ask)(void *callback_data, double t, const double *y, double *u, double *f);
    long differentiations, factorizations;
    const eomgen_series *series;  /* of Taylor's method */
    int order;                    /* of its next step */
    int side, expanded;           /* which half of K has the coefficients at y, and whether it has */
    int stopped;                  /* the callback said so: results of evaluations are NaN from then on, and no step is taken */
} eomgen_run;

/* A method; attempt forms y after a step and all stages, with x' there in the last; error is what the norm must keep
   under 1; prepare forms F; interpolate reads t_old, step, y_old and F alone. */
typedef struct {
    const char *name;
    int rows_K, rows_F;
    int error_order;
    void (*attempt)(eomgen_run *run, double h);
    double (*error)(const eomgen_run *run, double h);
    void (*prepare)(eomgen_run *run);
    void (*interpolate)(const eomgen_run *run, double t, double *y);
    int fixed; /* steps are all max_step long, but for the last */
    int squares; /* of implicit methods: n x n matrices after the rows in run->K, then 16 + n numbers */
    int expands; /* takes the model's series, whose work follows the rows in run->K */
    void (*begin)(eomgen_run *run);
    int (*step)(eomgen_run *run); /* in place of attempt and error */
} eomgen_method;

/* Doubles that a method needs in run->K after its rows. */
static inline long eomgen_further(const eomgen_method *method, long n, const eomgen_series *series)
{
    return (method->squares > 0 ? method->squares * n * n + 16 + n : 0) + (method->expands ? series->n_work : 0);
}

/* Doubles that the rows of a run take; a run gets its rows there, and returns what lies behind. */
static inline long eomgen_rows(const eomgen_method *method, long n, const eomgen_series *series)
{
    return n * (5 + method->rows_K + method->rows_F) + eomgen_further(method, n, series);
}

static inline double *eomgen_lay_out(eomgen_run *run, const eomgen_method *method, double *memory)
{
    const int n = run->n;
    double *const end = memory + eomgen_rows(method, n, run->series);
    run->y = memory, run->y_old = memory + n, run->f = memory + 2 * n, run->failure_state = memory + 3 * n;
    run->next = memory + 4 * n, run->K = memory + 5 * n, run->F = end - method->rows_F * n;
    return end;
}

extern const eomgen_method eomgen_dop853, eomgen_rk45, eomgen_rk4, eomgen_radau, eomgen_taylor;
/* The same method for this processor and so many states, to the same bits. */
const eomgen_method *eomgen_suited(const eomgen_method *method, int n);

enum { EOMGEN_STEP_TOO_SMALL = -100, EOMGEN_STOPPED = -101, EOMGEN_TOO_MANY_STEPS = -104 };

/* The value of a table at time t. */
double eomgen_table_value(const eomgen_signal *s, double t, double hold); /* hold: as in eomgen_run */

/* error to the power of -1 / (order + 1): what the next step is to be multiplied with, but for safety. */
static inline double eomgen_stretch(double error, int order)
{
    return order == 7 ? 1.0 / sqrt(sqrt(sqrt(error))) : pow(error, -1.0 / (order + 1));
}

/* The inputs at (t, y) into run->u, and the values of a tape into out. */
void eomgen_force(eomgen_run *run, double t, const double *y);
extern const char *const eomgen_operations[]; /* names of the codes, then NULL */
void eomgen_play(const eomgen_tape *tape, double t, const double *y, const double *u, const double *p, double *out);

/* What an evaluation may have to do besides: call back, form the inputs; 0 where the run has stopped, with NaN in k. */
int eomgen_ready(eomgen_run *run, double t, const double *y, double *k);
/* Remember a failure at (t, y); and NaN into k. */
void eomgen_note(eomgen_run *run, int status, double t, const double *y);
void eomgen_failed(eomgen_run *run, int status, double t, const double *y, double *k);

/* What a run calls by a pointer; on a device, whose stack has to be known beforehand, by its name. There nobody is called
   back either, and no expressions come at run time: EOMGEN_DEVICE. */
#ifndef EOMGEN_RHS
#define EOMGEN_RHS(run) (run)->rhs
#endif
#ifndef EOMGEN_METHOD
#define EOMGEN_METHOD(method, function) (method)->function
#define EOMGEN_TABLED(function) function
#endif

/* x' at (t, y) into k; NaN where the right-hand side fails, which is remembered. */
static inline void eomgen_evaluate(eomgen_run *run, double t, const double *y, double *k)
{
    if ((--run->until_callback == 0 || run->stopped || run->signals != NULL) && !eomgen_ready(run, t, y, k)) {
        return;
    }
    const int status = EOMGEN_RHS(run)(t, y, run->u, run->c, k, run->w);
    run->evaluations++;
    if (status != 0) {
        eomgen_failed(run, status, t, y, k);
    }
}

/* dx'/dx at (t, y), where x' is f, into J; spare: 2 n doubles. 0, or the status of a failure, which is remembered. */
int eomgen_differentiate(eomgen_run *run, double t, const double *y, const double *f, double *J, double *spare);

/* How long the next step may be: max_step, or less where shapes may meet; K changes. */
double eomgen_longest(eomgen_run *run);

/* First evaluation, and h_abs unless it is positive already. */
void eomgen_start(const eomgen_method *method, eomgen_run *run);

/* One accepted step: 0, or one of the above, which leave t and y as they were. */
int eomgen_step(const eomgen_method *method, eomgen_run *run);

/* One Runge-Kutta step of size h from x into out, which may be x; k: 5 n doubles. The status of the right-hand side. */
int eomgen_march(eomgen_function rhs, int n, double t, double h, const double *x, const double *u, const double *c,
    double *out, double *w, double *k);

/* The state at time t of the last step. */
void eomgen_between(const eomgen_method *method, eomgen_run *run, double t, double *y);

/* Whole trajectories: one eomgen_run and one eomgen_trajectory for each, so that many can run at the same time. */

#ifndef EOMGEN_EVENTS /* as EOMGEN_RHS */
#define EOMGEN_EVENTS(events) (events)->values
#define EOMGEN_RESETS(events) (events)->resets
#define EOMGEN_PROJECT(events) (events)->project
#define EOMGEN_HAS_EVENTS(events) ((events)->values != NULL)
#define EOMGEN_PROJECTS(events) ((events)->project != NULL)
#endif

/* What happens at an event besides that it is noted. */
enum {
    EOMGEN_GO_ON = 0,
    EOMGEN_RESET = 1, /* the model's kernel `resets` gives new values of some states */
    EOMGEN_WAIT = 2,  /* the run waits for the caller to call eomgen_jump: an impact, after which a value at zero rises */
    EOMGEN_PAUSE = 3  /* it waits too, and may go on as it was */
};

/* Events: zeros of values, first those of the model's kernel `events`, then of a tape, then of the caller. */
typedef struct {
    int n, n_model, n_tape;
    eomgen_function values; /* n_model, or NULL */
    const eomgen_tape *tape; /* n_tape, or NULL */
    int (*outside)(void *asker, double t, const double *y, double *g); /* the rest, or NULL; not 0: stop the run */
    void *asker;
    const int *direction; /* n: 1 rising, -1 falling, 0 both, 2: not watched */
    const long *most;     /* n: the run ends at this one; 0: never */
    const int *action;    /* n */
    eomgen_function resets, project; /* of the model; NULL: none, no constraints */
    int n_resets;
    const int *reset_of, *reset_x; /* n_resets: the event, and the state that gets the value; 0 of them: the caller resets */
    double *values_reset;          /* n_resets, work */
    double *g, *g_new, *slope, *slope_new, *size, *trial, *y; /* n each, work; y: states */
    long *count;                   /* n: how often each happened */
    int *leaving;                  /* n: side of zero to which a reset led, until it is seen there; 0: none */
    double *bracket;               /* 2 n rows of 4, work: ends in time, values there */
    int *whose, *fired;            /* 2 n; n: those at the last stop, 1 rising, -1 falling, 2 neither, 0: the others */
    int *touch;                    /* n: the side from which the value came to zero and back in the last step, or 0 */
    double *latest;                /* n: when each happened last */
    double last_reset;
    int crowded;                   /* resets in a row that followed each other too closely */
    int crowd;                     /* so many are too many */
    int for_slope;                 /* values are for a difference quotient, off the path of the run */
} eomgen_events;

/* The work of n events: 15 n numbers and a state; n; 5 n. */
static inline void eomgen_lay_out_events(eomgen_events *ev, double *numbers, long *count, int *whole)
{
    const int n = ev->n;
    ev->g = numbers, ev->g_new = numbers + n, ev->slope = numbers + 2 * n, ev->slope_new = numbers + 3 * n;
    ev->size = numbers + 4 * n, ev->trial = numbers + 5 * n, ev->latest = numbers + 6 * n;
    ev->bracket = numbers + 7 * n, ev->y = numbers + 15 * n;
    ev->count = count, ev->leaving = whole, ev->fired = whole + n, ev->touch = whole + 2 * n, ev->whose = whole + 3 * n;
}

/* One trajectory: what is asked, and what came of it so far. */
typedef struct {
    const double *nodes; /* n_nodes times in order, where the run must not step over; the last is its end */
    long n_nodes;
    const double *t_eval; /* n_eval times to store in order; n_eval below 0: every step */
    long n_eval;
    eomgen_events *events; /* or NULL */
    double span;           /* length of the whole run */
    long room;             /* rows in times and states: at least 2 beyond those stored, or n_eval */
    double *times, *states;
    long pieces_room;      /* rows in pieces, 0: not wanted. A row: t_old, step, end, y_old (n), F (rows_F n) */
    double *pieces;
    long notes_room;       /* rows in notes, at least 2 n beyond those there. A row: event, t, state (n) */
    double *notes;
    long trail_room;       /* rows in trail, 0: not wanted. A row: t and the state at every step where n_eval times are stored */
    double *trail;
    long node, done, stored, n_pieces, n_notes, n_trail, resets; /* start at 0; the caller may take rows and set back their counts */
    int begun, ended;
} eomgen_trajectory;

enum {
    EOMGEN_FULL = 0,     /* an array is full: take what is there and call again */
    EOMGEN_END = 1,
    EOMGEN_TERMINAL = 2, /* an event ended the run */
    EOMGEN_WAITING = 3,  /* at an event: call eomgen_jump, then go on */
    EOMGEN_ZENO = -102,  /* resets follow each other ever faster, or one leads nowhere */
    EOMGEN_RESET_FAILED = -103
};

/* Go on until something of the above, or a failure of eomgen_step. */
int eomgen_advance(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *trajectory);

/* Go on from the present time at another state: that of run->y, which the caller has changed. 0 or EOMGEN_ZENO. */
int eomgen_jump(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *trajectory);

/* What the last step brought: output, events, resets; 0 to go on, or something of the above. */
int eomgen_end_step(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *trajectory);

/* Events: values at the start; zeros of the last step in order, noted, up to one at which the run stops, at *t. Returns
   whether it stops, 2 if it is to end there, -1 if the caller's own events stopped the run, -2 if resets die away. */
void eomgen_arm(eomgen_run *run, eomgen_events *events);
int eomgen_find_events(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *trajectory, double *t);
/* Right before a reset: how fast values come. */
void eomgen_before_reset(eomgen_run *run, eomgen_events *events);
/* After a reset: which side of zero it led to. Not 0 if it led nowhere. */
int eomgen_after_reset(eomgen_run *run, eomgen_events *events);

#endif
