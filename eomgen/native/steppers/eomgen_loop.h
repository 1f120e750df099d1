/* Whole trajectories in C: no Python, no memory of its own, one eomgen_run and one eomgen_trajectory for each, so that many
   can run at the same time. The caller owns every array. */
#ifndef EOMGEN_LOOP_H
#define EOMGEN_LOOP_H

#include "eomgen_steppers.h"

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
