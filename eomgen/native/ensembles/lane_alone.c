/* What a lane cannot do beside others is done for it alone, by the text of one trajectory: its events with their resets, and
   inputs that are expressions. Nothing of it depends on the other lanes. */
typedef struct lane_alone {
    eomgen_run run; /* first, so that a method's functions find the rest */
    eomgen_method method;
    eomgen_journey journey;
    eomgen_events events;
    const lane_run *lanes;
    int l;
} lane_alone;

/* Numbers that a structure takes the place of. */
#define ROOM_OF(type, count) ((ptrdiff_t)((sizeof(type) * (size_t)(count) + sizeof(double) - 1) / sizeof(double)))

static int plays_expressions(const eomgen_ensemble *e, const eomgen_thread *own)
{
    for (int i = 0; own->signals != NULL && i < e->model->n_u; i++) {
        if (own->signals[i].n > 0 && own->signals[i].tape != NULL) {
            return 1;
        }
    }
    return 0;
}

static int has_alone(const eomgen_ensemble *e, const eomgen_thread *own)
{
    return own->events != NULL || plays_expressions(e, own);
}

/* Doubles of what each lane keeps, and of work that they share. */
static ptrdiff_t alone_each(const eomgen_ensemble *e, const eomgen_events *events)
{
    const eomgen_method *const method = e->method;
    const ptrdiff_t rows = 5 + method->rows_K + method->rows_F, n = events != NULL ? events->n : 0;
    const ptrdiff_t kept = events != NULL ? e->n + 7 * n + ROOM_OF(long, n) + ROOM_OF(int, 3 * n) : 0;
    return ROOM_OF(lane_alone, 1) + rows * e->n + e->model->n_const + e->model->n_u + kept;
}

static ptrdiff_t alone_shared(const eomgen_ensemble *e, const eomgen_events *events)
{
    const ptrdiff_t n = events != NULL ? events->n : 0;
    return e->model->n_work + e->n_eval + (events != NULL ? events->n_resets + 8 * n + ROOM_OF(int, 2 * n) : 0);
}

/* The stages of the step just made, and the polynomial from them. */
static void prepare_alone(eomgen_run *run)
{
    const lane_alone *const alone = (const lane_alone *)run;
    const lane_run *const lanes = alone->lanes;
    for (int i = 0; i < alone->method.rows_K * run->n; i++) {
        run->K[i] = lanes->K[i][alone->l];
    }
    alone->lanes->all->method->prepare(run);
}

static double *lay_out_events(eomgen_events *events, const eomgen_thread *own, int states, double *memory, double *shared)
{
    *events = *own->events;
    const int n = events->n;
    double **const kept[] = { &events->g, &events->g_new, &events->slope, &events->slope_new, &events->size, &events->trial,
                              &events->latest };
    for (int i = 0; i < 7; i++, memory += n) {
        *kept[i] = memory;
    }
    events->y = memory, memory += states;
    events->count = (long *)(void *)memory, memory += ROOM_OF(long, n);
    events->leaving = (int *)(void *)memory, events->fired = events->leaving + n, events->touch = events->fired + n;
    events->values_reset = shared, events->bracket = shared + events->n_resets;
    events->whose = (int *)(void *)(events->bracket + 8 * n);
    return memory + ROOM_OF(int, 3 * n);
}

/* Set up what is done alone, W times, in so many doubles as the two functions above say. */
static lane_alone *lay_out_alone(const eomgen_ensemble *e, const eomgen_thread *own, const lane_run *lanes, double *memory)
{
    const int n = e->n;
    const eomgen_method *const method = e->method;
    double *const w = memory, *const times = w + e->model->n_work, *const shared = times + e->n_eval;
    lane_alone *const all = (lane_alone *)(void *)(memory + alone_shared(e, own->events));
    double *next = (double *)(void *)all + W * ROOM_OF(lane_alone, 1);
    for (int l = 0; l < W; l++) {
        lane_alone *const alone = (lane_alone *)(void *)((double *)(void *)all + l * ROOM_OF(lane_alone, 1));
        eomgen_run *const run = &alone->run;
        memset(alone, 0, sizeof *alone);
        alone->lanes = lanes, alone->l = l, alone->method = *method, alone->method.prepare = prepare_alone;
        run->rhs = e->rhs, run->meeting = e->meeting, run->n_q = e->n_q;
        run->signals = own->signals, run->n_u = e->model->n_u, run->n = n;
        run->rtol = e->rtol, run->atol = e->atol, run->max_step = e->max_step;
        run->direction = e->nodes[e->n_nodes - 1] < e->nodes[0] ? -1.0 : 1.0;
        run->w = w, run->closed = e->model->closed_at ? w + e->model->closed_at : NULL;
        double **const rows[] = { &run->y, &run->y_old, &run->f, &run->failure_state, &run->next };
        for (int i = 0; i < 5; i++, next += n) {
            *rows[i] = next;
        }
        run->K = next, run->F = run->K + method->rows_K * n, next = run->F + method->rows_F * n;
        run->c = next, run->u = next + e->model->n_const, next = run->u + e->model->n_u;
        if (own->events != NULL) {
            next = lay_out_events(&alone->events, own, n, next, shared);
        }
        alone->journey.t_eval = e->t_eval, alone->journey.n_eval = e->n_eval, alone->journey.times = times;
        alone->journey.span = fabs(e->nodes[e->n_nodes - 1] - e->nodes[0]);
        alone->journey.events = own->events != NULL ? &alone->events : NULL;
        alone->journey.notes = own->notes, alone->journey.notes_room = own->notes_room;
    }
    return all;
}

static lane_alone *alone_of(const lane_run *run, int l)
{
    return (lane_alone *)(void *)((double *)(void *)run->singles + l * ROOM_OF(lane_alone, 1));
}

/* A lane takes trajectory k: its constants and inputs, and no event so far. */
static void fill_alone(const eomgen_ensemble *e, const lane_run *lanes, int l, ptrdiff_t k, const double *constants)
{
    lane_alone *const alone = alone_of(lanes, l);
    eomgen_run *const run = &alone->run;
    memcpy((double *)run->c, constants, (size_t)e->model->n_const * sizeof(double));
    memcpy(run->u, e->u + k * e->u_stride, (size_t)e->model->n_u * sizeof(double));
    run->step = run->t_old = 0.0, run->failure = 0, run->evaluations = 0;
    if (alone->journey.events != NULL) {
        alone->journey.states = e->n_eval > 0 ? e->samples + k * e->n_eval * e->n : NULL;
        alone->events.crowded = 0, alone->events.last_reset = (double)NAN;
        memset(alone->events.count, 0, (size_t)alone->events.n * sizeof(long));
    }
}

/* The inputs of every lane at its time and state. */
static EOMGEN_APART void play_lanes(lane_run *lanes, real t, const real *y)
{
    for (int l = 0; l < W; l++) {
        eomgen_run *const run = &alone_of(lanes, l)->run;
        double *const state = run->failure_state; /* free until something fails */
        if (!lanes->awake[l]) {
            continue;
        }
        for (int i = 0; i < lanes->n; i++) {
            state[i] = y[i][l];
        }
        run->hold = lanes->hold[l];
        eomgen_force(run, t[l], state);
        for (int i = 0; i < lanes->n_u; i++) {
            lanes->u[i][l] = run->u[i];
        }
    }
}

/* The inputs of a lane where it stands. */
static const double *inputs_alone(const lane_run *lanes, int l)
{
    eomgen_run *const run = &alone_of(lanes, l)->run;
    double *const state = run->failure_state;
    for (int i = 0; i < lanes->n; i++) {
        state[i] = lanes->y[i][l];
    }
    run->hold = lanes->hold[l];
    eomgen_force(run, lanes->t[l], state);
    return run->u;
}

/* The lane's part of a run, as it stands after a step or at the start. */
static eomgen_run *take_out(const lane_run *lanes, int l)
{
    eomgen_run *const run = &alone_of(lanes, l)->run;
    for (int i = 0; i < lanes->n; i++) {
        run->y[i] = lanes->y[i][l], run->y_old[i] = lanes->y_old[i][l], run->f[i] = lanes->f[i][l];
    }
    run->t = lanes->t[l], run->t_old = lanes->t_old[l], run->t_bound = lanes->t_bound[l], run->hold = lanes->hold[l];
    run->h_abs = lanes->size[l], run->until_callback = -1, run->interpolates = 0, run->stopped = 0;
    run->evaluations = 0, run->failure = 0;
    return run;
}

/* Back into the lane; whether the state is another. */
static void put_back(lane_run *lanes, int l, const eomgen_run *run, int changed)
{
    lanes->evaluations[l] += run->evaluations;
    if (run->failure != 0) {
        lanes->failure[l] = run->failure, lanes->failure_time[l] = run->failure_time;
    }
    for (int i = 0; changed && i < lanes->n; i++) {
        lanes->y[i][l] = run->y[i], lanes->f[i][l] = run->f[i];
        if (lanes->closed != NULL) {
            lanes->next[i][l] = run->next[i];
        }
    }
    if (changed) {
        lanes->t[l] = run->t, lanes->size[l] = run->h_abs;
    }
}

/* Values of the events where a trajectory begins. */
static void arm_lane(lane_run *lanes, int l)
{
    eomgen_run *const run = take_out(lanes, l);
    eomgen_arm(run, &alone_of(lanes, l)->events);
    put_back(lanes, l, run, 0);
}

/* What the step of a lane brought: samples, events, resets; as eomgen_travel returns it, 0 to go on. */
static EOMGEN_APART int settle_lane(eomgen_ensemble *e, lane_run *lanes, int l)
{
    lane_alone *const alone = alone_of(lanes, l);
    eomgen_run *const run = take_out(lanes, l);
    eomgen_journey *const journey = &alone->journey;
    const ptrdiff_t k = lanes->index[l];
    run->step = run->t - run->t_old;
    journey->done = journey->stored = lanes->done[l];
    const double t = run->t;
    const long resets = journey->resets;
    const int status = eomgen_settle(&alone->method, run, journey);
    eomgen_keep_notes(e, journey, k);
    lanes->done[l] = journey->done;
    put_back(lanes, l, run, run->t != t || journey->resets != resets);
    return status;
}
