/* One instance of the model as a functional mock-up unit: what the functions of FMI 2.0 and 3.0 have in common. */
#ifndef EOMGEN_FMU_H
#define EOMGEN_FMU_H

#include "eomgen_steppers.h"
#include "fmu_model.h"

/* Results of functions, as FMI numbers its status. */
enum { FMU_OK, FMU_WARNING, FMU_DISCARD, FMU_ERROR, FMU_FATAL };

/* Phases of an instance: bits, so that a function can name all in which it may be called. */
enum {
    FMU_INSTANTIATED = 1,
    FMU_INITIALIZING = 2,
    FMU_EVENTS = 4,
    FMU_CONTINUOUS = 8,
    FMU_STEPPING = 16,
    FMU_TERMINATED = 32,
    FMU_FAILED = 64,
    FMU_ANY = 127
};

/* All that an instance remembers: numbers only, so that it can be copied and written to a file. */
typedef struct {
    int phase;
    int constants_known, rates_known, assembled;
    double t, t_start, rtol;
    double x[FMU_N_X + 1], u[FMU_N_U + 1], p[FMU_N_P + 1], c[FMU_N_CONST + 1], rates[FMU_N_X + 1];
    int guessed[FMU_N_X + 1]; /* states that others follow, and that were set nevertheless: where the search begins */
    int side[FMU_N_EVENTS + 1]; /* of model exchange: 1 where a value is positive or leaves zero upward, else 0 */
    double seen;                /* of model exchange: when the last step was completed, with values g[0] */
    int begun;                  /* co-simulation has begun: the numbers below hold */
    double h_abs, last_reset;
    int crowded, ended;
    double g[6][FMU_N_EVENTS + 1]; /* values and slopes of events, old and new; sizes; times of the latest */
    long count[FMU_N_EVENTS + 1];
    int leaving[FMU_N_EVENTS + 1];
} fmu_memory;

typedef struct fmu_instance {
    fmu_memory m;
    double w[FMU_N_WORK + 1];
    double trial[FMU_N_TRIAL + 1]; /* states, and what kinematics takes and gives */
    double closed[FMU_N_X + 1], values[FMU_N_VALUES + 1], matrix[FMU_N_MATRIX + 1];
    char *name, text[512];
    double *steps; /* work of the stepper; NULL for model exchange */
    int reports;   /* whether messages are wanted */
    void (*report)(const struct fmu_instance *f, int status, const char *text);
    void *environment;
    void (*logger)(void); /* cast to that of the version of FMI */
    fmu_memory before;    /* the last step */
} fmu_instance;

/* Creation: NULL where memory is short. name is copied. */
fmu_instance *fmu_create(const char *name, int steps);
void fmu_delete(fmu_instance *f);
void fmu_reset(fmu_instance *f);

/* A message, and the status, which is returned. */
int fmu_say(fmu_instance *f, int status, const char *format, ...);
/* FMU_OK if the instance is there and in one of the phases; else the instance has failed. */
int fmu_check(fmu_instance *f, int phases, const char *function);

/* Values by their references, which are those of modelDescription.xml. */
int fmu_get(fmu_instance *f, const unsigned *references, size_t n, double *values);
int fmu_set(fmu_instance *f, const unsigned *references, size_t n, const double *values);
int fmu_directional(fmu_instance *f, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
    const double *seed, double *result);

/* Closes the loops where values were set during initialization. */
int fmu_ready(fmu_instance *f);
/* Evaluation: constants of the parameters; x' at the present time and state. */
int fmu_constants(fmu_instance *f);
int fmu_rates(fmu_instance *f);
int fmu_outputs(fmu_instance *f, double *y);
int fmu_start(fmu_instance *f, double t, int tolerance_given, double tolerance);
/* Initial states from those that were set: the others follow so that loops are closed. */
int fmu_assemble(fmu_instance *f);
int fmu_close(fmu_instance *f); /* the same, also where the start values are the model's own */
int fmu_project(fmu_instance *f, const double *x, double *closed);
/* A status of the model as one of FMI. */
int fmu_judge(fmu_instance *f, int status, const char *what);

/* Clocks of sampled states: their first times that are not past, as runtime/runs/events.py finds them. */
int fmu_set_clocks(fmu_instance *f);

/* Model exchange. */
int fmu_indicators(fmu_instance *f, double *values);
int fmu_arm(fmu_instance *f);
int fmu_completed(fmu_instance *f, int *event);
int fmu_update(fmu_instance *f, int *ended, int *changed);

/* Co-simulation: a step from time t; *ended: a terminal event ends the run there or before. A step that fails leaves
   everything as it was. */
int fmu_step(fmu_instance *f, double t, double step, int *ended);
long fmu_step_room(void);

/* A copy of what the instance remembers, as bytes that another instance of the same model takes. */
typedef struct {
    char digest[16];
    int steps; /* whether it is one of co-simulation */
    fmu_memory m;
} fmu_snapshot;
int fmu_keep(fmu_instance *f, void **kept);
int fmu_restore(fmu_instance *f, const void *kept);
int fmu_unpack(fmu_instance *f, const void *bytes, size_t size, void **kept);

#endif
