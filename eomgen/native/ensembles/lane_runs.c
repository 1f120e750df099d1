/* The queue of trajectories and the rounds of steps. */
/* Store what is asked for up to now of the lanes that have moved. */
static void sample_lanes(eomgen_ensemble *e, const lane_method *method, lane_run *run, flag moved, double direction)
{
    const int n = run->n;
    int prepared = 0;
    for (;;) {
        flag wanted = { 0 };
        real times = run->t;
        for (int l = 0; l < W; l++) {
            while (moved[l] && run->done[l] < e->n_eval && direction * (e->t_eval[run->done[l]] - run->t[l]) <= 0.0) {
                if (run->t[l] != e->t_eval[run->done[l]]) {
                    times[l] = e->t_eval[run->done[l]];
                    wanted[l] = -1;
                    break;
                }
                for (int i = 0; i < n; i++) {
                    e->samples[(run->index[l] * e->n_eval + run->done[l]) * n + i] = run->y[i][l];
                }
                run->done[l]++;
            }
        }
        if (!any_of(wanted)) {
            return;
        }
        if (!prepared) {
            const int before = run->calls;
            run->awake = moved;
            method->prepare(run);
            run->evaluations += wanted & (run->calls - before);
            prepared = 1;
        }
        method->interpolate(run, times, run->z);
        for (int l = 0; l < W; l++) {
            for (int i = 0; wanted[l] && i < n; i++) {
                e->samples[(run->index[l] * e->n_eval + run->done[l]) * n + i] = run->z[i][l];
            }
            run->done[l] += wanted[l] != 0;
        }
    }
}

static void end_lane(eomgen_ensemble *e, lane_run *run, int l, int status)
{
    const ptrdiff_t k = run->index[l];
    for (ptrdiff_t j = run->done[l] * run->n; j < e->n_eval * run->n; j++) {
        e->samples[k * e->n_eval * run->n + j] = (double)NAN;
    }
    for (int i = 0; i < run->n; i++) {
        e->x[k * run->n + i] = run->y[i][l];
    }
    e->t[k] = run->t[l], e->status[k] = status;
    e->steps[k] = run->steps[l], e->rejected[k] = run->rejected[l], e->evaluations[k] = run->evaluations[l];
    e->failure[k] = run->failure[l], e->failure_time[k] = run->failure_time[l];
    run->active[l] = run->begins[l] = run->awake[l] = 0;
    __atomic_fetch_add(&e->done, 1, __ATOMIC_RELAXED);
}

/* The next node of a lane's trajectory, or the end of it. */
static void next_node(eomgen_ensemble *e, lane_run *run, int l)
{
    if (++run->node[l] >= e->n_nodes) {
        end_lane(e, run, l, 0);
        return;
    }
    run->t_bound[l] = e->nodes[run->node[l]];
    run->size[l] = run->node[l] == 1 ? e->first_step : fmax(run->size_before[l], run->size[l]);
    run->hold[l] = run->t[l] + 0.5 * (run->t_bound[l] - run->t[l]);
    run->begins[l] = -1, run->again[l] = 0;
}

/* The next trajectory of the queue into a lane; those that cannot begin end at once. */
static EOMGEN_APART void fill_lane(eomgen_ensemble *e, lane_run *run, int l, double *constants)
{
    while (!run->active[l]) {
        const ptrdiff_t k = eomgen_ensemble_take(e);
        if (k < 0) {
            return;
        }
        run->index[l] = k, run->done[l] = 0, run->node[l] = 0, run->active[l] = -1;
        run->failure[l] = 0, run->failure_time[l] = 0.0;
        run->steps[l] = run->rejected[l] = run->evaluations[l] = 0;
        run->size_before[l] = 0.0;
        const int status = e->model->precompute(e->p + k * e->p_stride, constants);
        for (int i = 0; i < e->model->n_const; i++) {
            run->c[i][l] = constants[i];
        }
        for (int i = 0; i < e->model->n_u; i++) {
            run->u[i][l] = e->u[k * e->u_stride + i];
        }
        for (int i = 0; i < run->n; i++) {
            run->y[i][l] = e->x0[k * run->n + i];
        }
        run->t[l] = run->t_old[l] = e->nodes[0];
        if (run->singles != NULL) {
            fill_alone(e, run, l, k, constants);
        }
        if (status != 0) {
            end_lane(e, run, l, EOMGEN_BAD_PARAMETERS);
        } else {
            next_node(e, run, l);
        }
    }
}

/* Lead the lanes that have come to a node on to what is next. */
static void advance_nodes(eomgen_ensemble *e, lane_run *run, double direction, double *constants)
{
    const flag there = run->active & ~run->begins & ((run->t - run->t_bound) * direction >= 0.0);
    if (any_of(there)) {
        for (int l = 0; l < W; l++) {
            if (there[l]) {
                next_node(e, run, l);
                fill_lane(e, run, l, constants);
            }
        }
    }
}

/* The step that each lane tries: its size with the sign of the run, 0 for those without a trajectory. */
/* The longest step that a lane may take next, as eomgen_longest has it. */
static EOMGEN_APART double longest_of(const eomgen_ensemble *e, const lane_run *run, int l, double direction, double least)
{
    const eomgen_model *const model = e->model;
    double *const x = run->alone, *const u = x + 2 * run->n, *const c = u + run->n_u, *const w = c + model->n_const;
    double found[5];
    for (int i = 0; i < run->n; i++) {
        x[i] = i < e->n_q ? run->y[i][l] : run->y[i][l] * direction;
    }
    for (int i = e->n_q; i < run->n; i++) {
        x[run->n - e->n_q + i] = run->f[i][l];
    }
    for (int i = 0; i < run->n_u; i++) {
        const int table = run->signals != NULL && run->signals[i].n > 0 && !run->plays;
        u[i] = run->plays ? inputs_alone(run, l)[i] : table ? eomgen_table_value(run->signals + i, run->t[l], run->hold[l]) : run->u[i][l];
    }
    for (int i = 0; i < model->n_const; i++) {
        c[i] = run->c[i][l];
    }
    const int status = e->meeting(run->t[l], x, u, c, found, w);
    return status == 0 && found[0] < e->max_step ? fmin(e->max_step, fmax(found[0], RUNS_UNHURRIED * least)) : e->max_step;
}

static void choose_steps(eomgen_ensemble *e, lane_run *run, double direction, double *constants)
{
    const real t = run->t, spacing = abs_of(t) * 0x1p-52; /* of numbers there, or more */
    const real least = 10.0 * choose(spacing > 0x1p-1022, spacing, same(0x1p-1022));
    run->awake = run->active & ~run->begins;
    run->size_before = choose(run->again, run->size_before, run->size);
    real size = choose(run->size > e->max_step, same(e->max_step), choose(run->size < least, least, run->size));
    for (int l = 0; e->meeting != NULL && l < W; l++) {
        if (run->awake[l] && !run->again[l]) {
            size[l] = fmin(size[l], longest_of(e, run, l, direction, least[l]));
        }
    }
    size = run->size = choose(run->again, run->size, size);
    const flag lost = ~(size >= least), late = ~run->again & (run->steps >= e->max_steps);
    if (any_of(run->awake & (lost | late))) {
        for (int l = 0; l < W; l++) {
            if (run->awake[l] && (lost[l] || late[l])) {
                end_lane(e, run, l, late[l] ? EOMGEN_TOO_MANY_STEPS : EOMGEN_STEP_TOO_SMALL);
                fill_lane(e, run, l, constants); /* tries with the next round */
            }
        }
    }
    const real t_new = t + size * direction;
    run->t_new = choose((t_new - run->t_bound) * direction > 0.0, run->t_bound, t_new);
    run->step = choose(run->awake, run->t_new - t, same(0.0));
    run->size = choose(run->awake, abs_of(run->step), run->size);
}

/* error to the power of -1 / (order + 1), within 1 %: the bits of a number are nearly its logarithm, then one step of
   Newton's method. */
static inline real stretch_of(real error, int order)
{
    const double p = order + 1;
    const numeral shrunk = ((numeral)error >> 32) * (uint64_t)(4294967296.0 / p);
    real z = (real)((uint64_t)(1072640819.0 * (1.0 + 1.0 / p) * 4294967296.0) - shrunk), power = z;
    for (int i = 0; i < order; i++) {
        power *= z;
    }
    return z * ((p + 1.0 - error * power) / p);
}

/* Judge the steps tried: returns the lanes that have moved; sets the size of each one's next. Steps are a ninth shorter than
   SciPy's, so that fewer are rejected: less work and smaller errors, as a rejected step costs lanes as much as another. */
static flag accept_steps(lane_run *run, real error, int order)
{
    const flag moved = run->awake & (error < 1.0), again = run->awake & ~moved;
    const real factor = order > 0 ? 0.8 * stretch_of(error, order) : same(0.5), most = choose(run->again, same(1.0), same(10.0));
    const real more = choose((factor < most) & (error > 0.0), factor, most);
    const real less = choose(factor > 0.2, factor, same(0.2)); /* also where the error is NaN */
    run->size *= choose(moved, more, choose(again, less, same(1.0)));
    run->again = again;
    run->t_old = choose(moved, run->t, run->t_old), run->t = choose(moved, run->t_new, run->t);
    run->steps -= moved, run->rejected -= again;
    for (int i = 0; i < run->n; i++) {
        run->y[i] = choose(moved, run->y[i], run->y_old[i]);
        run->f[i] = choose(moved, run->f[i], run->K[i]);
    }
    return moved;
}

static const lane_method *find_method(const char *name)
{
    static const lane_method *const methods[] = { &lane_dop853, &lane_rk45, &lane_taylor };
    for (int i = 0; i < 3; i++) {
        if (strcmp(methods[i]->name, name) == 0) {
            return methods[i];
        }
    }
    return NULL;
}

static int takes(const eomgen_ensemble *e, const eomgen_thread *own)
{
    const lane_method *const method = find_method(e->method->name);
    return method != NULL && (method != &lane_taylor || !has_alone(e, own));
}

static ptrdiff_t lane_memory(const eomgen_ensemble *e, const eomgen_thread *own)
{
    const lane_method *const method = find_method(e->method->name);
    const ptrdiff_t rows = 5 + method->rows_K + method->rows_F, further = eomgen_further(e->method, e->n, e->series);
    const ptrdiff_t each = e->model->n_work + e->model->n_u + e->model->n_const; /* alone, and in every lane */
    const ptrdiff_t alone = has_alone(e, own) ? alone_shared(e, own->events) + W * alone_each(e, own->events) : 0;
    return e->model->n_const + each + 2 * e->n + W * (1 + each + rows * e->n + further) + alone;
}

static void lay_out(lane_run *run, const eomgen_ensemble *e, const eomgen_thread *own, const lane_method *method, real *memory)
{
    const int n = e->n;
    memset(run, 0, sizeof *run);
    run->rhs = (lane_function)e->lane_rhs, run->signals = own->signals, run->n_u = e->model->n_u, run->n = n;
    run->rtol = e->rtol, run->atol = e->atol;
    run->c = memory;
    run->u = run->c + e->model->n_const;
    run->w = run->u + e->model->n_u;
    run->y = run->w + e->model->n_work;
    run->y_old = run->y + n, run->f = run->y_old + n, run->z = run->f + n, run->next = run->z + n;
    run->K = run->next + n;
    run->closed = e->model->closed_at && method != &lane_taylor ? run->w + e->model->closed_at : NULL;
    run->all = e, run->alone = own->memory + e->model->n_const;
    run->after = run->K + (TAYLOR_MOST + 1) * n, run->series_work = run->K + method->rows_K * n;
    run->F = run->series_work + eomgen_further(e->method, n, e->series);
    run->expand = (lane_series)e->lane_series;
    run->order = method == &lane_taylor ? taylor_order(e->rtol, e->series->most) : 0;
    if (has_alone(e, own)) {
        run->plays = plays_expressions(e, own);
        run->singles = lay_out_alone(e, own, run, (double *)(run->F + method->rows_F * n));
    }
}

/* What comes before a step: lanes that begin, and what each tries. */
static void prepare_round(eomgen_ensemble *e, const lane_method *method, lane_run *run, double direction, double *constants,
                          int has_events)
{
    const size_t size = (size_t)run->n * sizeof(real);
    flag first = { 0 };
    if (any_of(run->active & run->begins)) {
        for (int l = 0; l < W; l++) {
            first[l] = run->node[l] == 1 ? -1 : 0;
        }
        /* a time asked for may be the start */
        sample_lanes(e, method, run, first & run->begins & run->active, direction);
    }
    const int taylor = method == &lane_taylor, begins = any_of(run->active & run->begins);
    const flag starts = run->active & run->begins & first;
    if (taylor) {
        begin_taylor(e, run);
    } else if (begins) {
        begin_lanes(e, method, run, direction);
        for (int l = 0; has_events && l < W; l++) {
            if (starts[l]) {
                arm_lane(run, l);
            }
        }
    }
    if (begins) {
        advance_nodes(e, run, direction, constants); /* a part may have no length */
    }
    choose_steps(e, run, direction, constants);
    memcpy(run->y_old, run->y, size);
    for (int i = 0; i < run->n && run->closed != NULL; i++) { /* E. Eich, as in eomgen_step */
        run->y_old[i] = choose(run->awake, run->next[i], run->y[i]);
    }
    if (!taylor) {
        memcpy(run->K, run->f, size);
    }
    run->calls = 0;
}

static void finish_round(eomgen_ensemble *e, const lane_method *method, lane_run *run, double direction, double *constants,
                         int has_events)
{
    run->evaluations += run->awake & run->calls;
    const flag moved = accept_steps(run, method->error(run, run->step), method->error_order);
    keep_closed_lanes(run, moved);
    if (e->n_eval > 0 && !has_events) {
        sample_lanes(e, method, run, moved, direction);
    }
    for (int l = 0; has_events && l < W; l++) {
        const int status = moved[l] ? settle_lane(e, run, l) : 0;
        if (status != 0) {
            end_lane(e, run, l, status == EOMGEN_TERMINAL ? 1 : status);
            fill_lane(e, run, l, constants);
        }
    }
    advance_nodes(e, run, direction, constants);
}

static void work_in_lanes(eomgen_ensemble *e, const eomgen_thread *own)
{
    const lane_method *const method = find_method(e->method->name);
    const double direction = e->nodes[e->n_nodes - 1] < e->nodes[0] ? -1.0 : 1.0;
    double *const constants = own->memory, *memory = constants + e->model->n_const;
    memory += e->model->n_work + e->model->n_u + e->model->n_const + 2 * e->n; /* of lanes that are evaluated alone */
    memory += (W - ((uintptr_t)memory / sizeof(double)) % W) % W; /* vectors lie at multiples of their size */
    lane_run run;
    lay_out(&run, e, own, method, (real *)memory);
    for (int l = 0; l < W; l++) {
        fill_lane(e, &run, l, constants);
    }
    for (ptrdiff_t round = 0; any_of(run.active); round++) {
        const int stopped = round % (EOMGEN_CALLBACK_STRIDE / 8) == 0 && __atomic_load_n(&e->stop, __ATOMIC_RELAXED);
        for (int l = 0; stopped && l < W; l++) {
            if (run.active[l]) {
                end_lane(e, &run, l, EOMGEN_STOPPED);
            }
        }
        prepare_round(e, method, &run, direction, constants, own->events != NULL);
        method->attempt(&run, run.step);
        finish_round(e, method, &run, direction, constants, own->events != NULL);
    }
}
