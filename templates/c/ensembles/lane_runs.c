/* The queue of trajectories and the rounds of steps. */
/* Store what is asked for up to now of the lanes that have moved. */
static void sample_lanes(eomgen_ensemble *e, const lane_method *method, lane_run *run, lane_task *tasks,
                         const int *moved, double direction)
{
    int prepared = 0;
    for (;;) {
        int wanted[W], any = 0;
        real times = run->t;
        for (int l = 0; l < W; l++) {
            lane_task *const task = tasks + l;
            wanted[l] = 0;
            while (moved[l] && task->done < e->n_eval && direction * (e->t_eval[task->done] - run->t[l]) <= 0.0) {
                if (run->t[l] != e->t_eval[task->done]) {
                    times[l] = e->t_eval[task->done];
                    wanted[l] = any = 1;
                    break;
                }
                for (int i = 0; i < run->n; i++) {
                    e->samples[(task->index * e->n_eval + task->done) * run->n + i] = run->y[i][l];
                }
                task->done++;
            }
        }
        if (!any) {
            return;
        }
        if (!prepared) {
            const long before = run->calls;
            method->prepare(run);
            for (int l = 0; l < W; l++) {
                tasks[l].calls += wanted[l] ? run->calls - before : 0;
            }
            prepared = 1;
        }
        method->interpolate(run, times, run->z);
        for (int l = 0; l < W; l++) {
            for (int i = 0; wanted[l] && i < run->n; i++) {
                e->samples[(tasks[l].index * e->n_eval + tasks[l].done) * run->n + i] = run->z[i][l];
            }
            tasks[l].done += wanted[l];
        }
    }
}

static void end_lane(eomgen_ensemble *e, lane_run *run, lane_task *task, int l, int status)
{
    const long k = task->index;
    for (long j = task->done * run->n; j < e->n_eval * run->n; j++) {
        e->samples[k * e->n_eval * run->n + j] = NAN;
    }
    for (int i = 0; i < run->n; i++) {
        e->x[k * run->n + i] = run->y[i][l];
    }
    e->t[k] = run->t[l], e->status[k] = status, e->evaluations[k] = task->calls;
    e->failure[k] = run->failure[l], e->failure_time[k] = run->failure_time[l];
    task->index = -1;
    __atomic_fetch_add(&e->done, 1, __ATOMIC_RELAXED);
}

/* The next node of a lane's trajectory, or the end of it. */
static void next_node(eomgen_ensemble *e, lane_run *run, lane_task *task, int l)
{
    if (++task->node >= e->n_nodes) {
        end_lane(e, run, task, l, 0);
        return;
    }
    task->t_bound = e->nodes[task->node];
    task->h_abs = task->node == 1 ? e->first_step : fmax(task->h_last, task->h_abs);
    run->hold[l] = run->t[l] + 0.5 * (task->t_bound - run->t[l]);
    task->begins = 1, task->again = 0;
}

/* The next trajectory of the queue into a lane; those that cannot begin end at once. */
static void fill_lane(eomgen_ensemble *e, lane_run *run, lane_task *task, int l, double *constants)
{
    while (task->index < 0) {
        const long k = eomgen_ensemble_take(e);
        if (k < 0) {
            return;
        }
        memset(task, 0, sizeof *task);
        task->index = k;
        run->failure[l] = 0, run->failure_time[l] = 0.0;
        e->steps[k] = e->rejected[k] = 0;
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
        if (status != 0) {
            end_lane(e, run, task, l, EOMGEN_BAD_PARAMETERS);
        } else {
            next_node(e, run, task, l);
        }
    }
}

/* Lead the lanes that have come to a node on to what is next; whether any has a trajectory. */
static int advance_nodes(eomgen_ensemble *e, lane_run *run, lane_task *tasks, double direction, double *constants)
{
    int busy = 0;
    for (int l = 0; l < W; l++) {
        if (tasks[l].index >= 0 && !tasks[l].begins && direction * (run->t[l] - tasks[l].t_bound) >= 0.0) {
            next_node(e, run, tasks + l, l);
            fill_lane(e, run, tasks + l, l, constants);
        }
        busy = busy || tasks[l].index >= 0;
    }
    return busy;
}

/* The step that each lane tries: its size with the sign of the run, 0 for those without a trajectory. */
static real choose_steps(eomgen_ensemble *e, lane_run *run, lane_task *tasks, double direction, double *constants)
{
    real h = same(0.0);
    for (int l = 0; l < W; l++) {
        lane_task *const task = tasks + l;
        run->awake[l] = 0;
        if (task->index < 0 || task->begins) {
            continue;
        }
        const double t = run->t[l], least = 10.0 * fabs(nextafter(t, direction * INFINITY) - t);
        if (!task->again) {
            task->h_last = task->h_abs;
            task->h_abs = task->h_abs > e->max_step ? e->max_step : task->h_abs < least ? least : task->h_abs;
        }
        const int lost = !(task->h_abs >= least), late = !task->again && e->steps[task->index] >= e->max_steps;
        if (lost || late) {
            end_lane(e, run, task, l, late ? EOMGEN_TOO_MANY_STEPS : EOMGEN_STEP_TOO_SMALL);
            fill_lane(e, run, task, l, constants);
            continue; /* tries with the next round */
        }
        double t_new = t + task->h_abs * direction;
        if (direction * (t_new - task->t_bound) > 0.0) {
            t_new = task->t_bound;
        }
        task->t_new = t_new;
        h[l] = t_new - t;
        task->h_abs = fabs(h[l]);
        run->awake[l] = 1;
    }
    return h;
}

/* Judge the steps tried: which lanes have moved, and the size of each one's next. */
static void judge_steps(eomgen_ensemble *e, lane_run *run, lane_task *tasks, real error, int order, int *moved)
{
    flag accepted = { 0 };
    real stretch = 1.0 / root(root(root(error))); /* as eomgen_stretch has it for order 7 */
    for (int l = 0; order != 7 && l < W; l++) {
        stretch[l] = eomgen_stretch(error[l], order);
    }
    for (int l = 0; l < W; l++) {
        lane_task *const task = tasks + l;
        moved[l] = run->awake[l] && error[l] < 1.0;
        if (moved[l]) {
            double factor = error[l] == 0.0 ? 10.0 : fmin(10.0, 0.9 * stretch[l]);
            factor = task->again && factor > 1.0 ? 1.0 : factor;
            task->h_abs *= factor;
            task->again = 0;
            run->t_old[l] = run->t[l], run->t[l] = task->t_new;
            accepted[l] = -1;
            e->steps[task->index]++;
        } else if (run->awake[l]) {
            const double factor = 0.9 * stretch[l];
            task->h_abs *= factor > 0.2 ? factor : 0.2; /* also where the error is NaN */
            task->again = 1;
            e->rejected[task->index]++;
        }
    }
    for (int i = 0; i < run->n; i++) {
        run->y[i] = choose(accepted, run->y[i], run->y_old[i]);
        run->f[i] = choose(accepted, run->f[i], run->K[i]);
    }
}

static const lane_method *find_method(const char *name)
{
    static const lane_method *const methods[] = { &lane_dop853, &lane_rk45, &lane_rk23 };
    for (int i = 0; i < 3; i++) {
        if (strcmp(methods[i]->name, name) == 0) {
            return methods[i];
        }
    }
    return NULL;
}

static int takes(const eomgen_ensemble *e, const eomgen_thread *own)
{
    const eomgen_signal *const signals = own->signals;
    for (int i = 0; signals != NULL && i < e->model->n_u; i++) {
        if (signals[i].n > 0 && signals[i].tape != NULL) {
            return 0; /* an expression is played for one state */
        }
    }
    return own->events == NULL && find_method(e->method->name) != NULL;
}

static long lane_memory(const eomgen_ensemble *e)
{
    const lane_method *const method = find_method(e->method->name);
    const long rows = 4 + method->rows_K + method->rows_F;
    return e->model->n_const + W * (1 + e->model->n_work + e->model->n_u + e->model->n_const + rows * e->n);
}

static void work_in_lanes(eomgen_ensemble *e, const eomgen_thread *own)
{
    double *memory = own->memory;
    const lane_method *const method = find_method(e->method->name);
    const int n = e->n;
    const double direction = e->nodes[e->n_nodes - 1] < e->nodes[0] ? -1.0 : 1.0;
    lane_run run;
    lane_task tasks[W];
    memset(&run, 0, sizeof run);
    double *const constants = memory;
    memory += e->model->n_const;
    memory += (W - ((uintptr_t)memory / sizeof(double)) % W) % W; /* vectors lie at multiples of their size */
    run.rhs = e->lane_rhs, run.signals = own->signals, run.n_u = e->model->n_u, run.n = n;
    run.rtol = e->rtol, run.atol = e->atol;
    run.c = (real *)memory;
    run.u = run.c + e->model->n_const;
    run.w = run.u + e->model->n_u;
    run.y = run.w + e->model->n_work;
    run.y_old = run.y + n, run.f = run.y_old + n, run.z = run.f + n;
    run.K = run.z + n;
    run.F = run.K + method->rows_K * n;
    int busy = 0;
    for (int l = 0; l < W; l++) {
        tasks[l].index = -1;
        fill_lane(e, &run, tasks + l, l, constants);
        busy = busy || tasks[l].index >= 0;
    }
    for (long round = 0; busy; round++) {
        int begins = 0, moved[W];
        for (int l = 0; l < W; l++) {
            if (round % (EOMGEN_GLANCE / 8) == 0 && tasks[l].index >= 0 && __atomic_load_n(&e->stop, __ATOMIC_RELAXED)) {
                end_lane(e, &run, tasks + l, l, EOMGEN_STOPPED);
            }
            moved[l] = tasks[l].index >= 0 && tasks[l].begins && tasks[l].node == 1;
            begins = begins || (tasks[l].index >= 0 && tasks[l].begins);
        }
        if (begins) {
            sample_lanes(e, method, &run, tasks, moved, direction); /* a time asked for may be the start */
            begin_lanes(e, method, &run, tasks, direction);
            advance_nodes(e, &run, tasks, direction, constants); /* a part may have no length */
        }
        run.step = choose_steps(e, &run, tasks, direction, constants);
        memcpy(run.y_old, run.y, (size_t)n * sizeof(real));
        memcpy(run.K, run.f, (size_t)n * sizeof(real));
        const long before = run.calls;
        method->attempt(&run, run.step);
        for (int l = 0; l < W; l++) {
            tasks[l].calls += run.awake[l] ? run.calls - before : 0;
        }
        judge_steps(e, &run, tasks, method->error(&run, run.step), method->error_order, moved);
        if (e->n_eval > 0) {
            sample_lanes(e, method, &run, tasks, moved, direction);
        }
        busy = advance_nodes(e, &run, tasks, direction, constants);
    }
}
