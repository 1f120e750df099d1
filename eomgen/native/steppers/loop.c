/* The loop of a trajectory: steps from corner to corner of the inputs, output at given times, events and resets. */
#include <math.h>
#include <string.h>

#include "eomgen_loop.h"

static void store(const eomgen_run *run, eomgen_trajectory *j, double t, const double *y)
{
    j->times[j->stored] = t;
    memcpy(j->states + j->stored * run->n, y, (size_t)run->n * sizeof(double));
    j->stored++;
}

/* A step, or a state after a reset, where every step is stored or followed. */
static void store_step(const eomgen_run *run, eomgen_trajectory *j)
{
    if (j->n_eval < 0) {
        store(run, j, run->t, run->y);
    } else if (j->trail_room > 0) {
        double *const row = j->trail + j->n_trail++ * (1 + run->n);
        row[0] = run->t;
        memcpy(row + 1, run->y, (size_t)run->n * sizeof(double));
    }
}

/* Begin the part that ends at the next corner. */
static void begin_part(eomgen_run *run, const eomgen_trajectory *j)
{
    run->t_bound = j->nodes[j->node];
    run->hold = run->t + 0.5 * (run->t_bound - run->t);
}

static void begin(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    j->begun = 1;
    run->direction = j->nodes[j->n_nodes - 1] < run->t ? -1.0 : 1.0;
    begin_part(run, j);
    eomgen_start(method, run);
    if (j->events != NULL) {
        j->events->last_reset = (double)NAN;
        eomgen_arm(run, j->events);
    }
    store_step(run, j);
    if (j->n_eval > 0 && j->t_eval[0] == run->t) {
        store(run, j, run->t, run->y);
        j->done++;
    }
}

static void keep_piece(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j, double end)
{
    const int n = run->n;
    double *const row = j->pieces + j->n_pieces++ * (3 + n * (1 + method->rows_F));
    eomgen_between(method, run, run->t, row + 3); /* forms F */
    row[0] = run->t_old, row[1] = run->step, row[2] = end;
    memcpy(row + 3, run->y_old, (size_t)n * sizeof(double));
    memcpy(row + 3 + n, run->F, (size_t)(n * method->rows_F) * sizeof(double));
}

int eomgen_jump(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    eomgen_events *const ev = j->events;
    int changes = 0;
    for (int i = 0; i < ev->n; i++) {
        changes = changes || (ev->fired[i] && ev->action[i] != EOMGEN_PAUSE);
    }
    run->h_abs = 0.0;
    eomgen_start(method, run);
    store_step(run, j);
    if (changes) {
        ev->crowded = fabs(run->t - ev->last_reset) < RUNS_CROWDED * j->span ? ev->crowded + 1 : 0;
        ev->last_reset = run->t;
        j->resets++;
    }
    return (eomgen_after_reset(run, ev) && changes) || ev->crowded >= ev->crowd ? EOMGEN_ZENO : 0;
}

/* New values of states by the model's own kernel, for each of its events that happened here. */
static int apply_resets(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    eomgen_events *const ev = j->events;
    for (int i = 0; i < ev->n_model; i++) {
        if (!ev->fired[i] || ev->action[i] != EOMGEN_RESET) {
            continue;
        }
        if (run->signals != NULL) {
            eomgen_force(run, run->t, run->y);
        }
        for (int k = 0; k < ev->n_resets; k++) {
            ev->values_reset[k] = (double)NAN;
        }
        const int status = EOMGEN_RESETS(ev)(run->t, run->y, run->u, run->c, ev->values_reset, run->w);
        if (status != 0 && status != EOMGEN_NON_FINITE) {
            return EOMGEN_RESET_FAILED;
        }
        for (int k = 0; k < ev->n_resets; k++) {
            if (ev->reset_of[k] == i && !isfinite(ev->values_reset[k])) { /* those of others need not be numbers here */
                return EOMGEN_RESET_FAILED;
            }
        }
        for (int k = 0; k < ev->n_resets; k++) {
            if (ev->reset_of[k] == i) {
                run->y[ev->reset_x[k]] = ev->values_reset[k];
            }
        }
    }
    if (EOMGEN_PROJECTS(ev)) {
        memcpy(ev->y, run->y, (size_t)run->n * sizeof(double));
        if (EOMGEN_PROJECT(ev)(run->t, ev->y, run->u, run->c, run->y, run->w) != 0) {
            return EOMGEN_RESET_FAILED;
        }
    }
    return eomgen_jump(method, run, j);
}

int eomgen_end_step(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    double t = run->t;
    const int stop = j->events != NULL ? eomgen_find_events(method, run, j, &t) : 0;
    if (stop < 0) {
        return stop == -1 ? (int)EOMGEN_STOPPED : (int)EOMGEN_ZENO; /* of two enumerations */
    }
    if (j->pieces_room > 0) {
        keep_piece(method, run, j, t);
    }
    while (j->done < j->n_eval && run->direction * (j->t_eval[j->done] - t) <= 0.0) {
        double *const row = j->states + j->stored * run->n;
        if (j->t_eval[j->done] == run->t && !stop) {
            memcpy(row, run->y, (size_t)run->n * sizeof(double));
        } else {
            eomgen_between(method, run, j->t_eval[j->done], row);
        }
        j->times[j->stored++] = j->t_eval[j->done++];
    }
    if (stop) {
        eomgen_between(method, run, t, j->events->y);
        memcpy(run->y, j->events->y, (size_t)run->n * sizeof(double));
        run->t = t;
        eomgen_before_reset(run, j->events);
    }
    store_step(run, j);
    if (stop == 2) {
        return EOMGEN_TERMINAL;
    }
    for (int i = 0; stop && i < j->events->n; i++) {
        if (j->events->fired[i] && (j->events->action[i] != EOMGEN_RESET || j->events->n_resets == 0)) {
            return EOMGEN_WAITING;
        }
    }
    return stop ? apply_resets(method, run, j) : 0;
}

int eomgen_advance(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    if (!j->begun) {
        begin(method, run, j);
    }
    while (run->direction * (run->t - j->nodes[j->n_nodes - 1]) < 0.0) {
        if ((j->n_eval < 0 && j->stored + 2 > j->room) || (j->pieces_room > 0 && j->n_pieces == j->pieces_room) ||
            (j->trail_room > 0 && j->n_trail + 2 > j->trail_room) ||
            (j->events != NULL && j->n_notes + 2 * j->events->n > j->notes_room)) {
            return EOMGEN_FULL;
        }
        const double h_abs = run->h_abs;
        int status = eomgen_step(method, run);
        status = status != 0 ? status : eomgen_end_step(method, run, j);
        if (status != 0) {
            return status;
        }
        if (run->t == run->t_bound && j->node + 1 < j->n_nodes) { /* x' jumps here, or its slope */
            j->node++;
            begin_part(run, j);
            run->h_abs = h_abs > run->h_abs ? h_abs : run->h_abs;
            eomgen_start(method, run);
        }
    }
    if (run->stopped) {
        return EOMGEN_STOPPED;
    }
    return EOMGEN_END;
}
