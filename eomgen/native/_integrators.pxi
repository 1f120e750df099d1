# Runs whose steps are taken by an object in Python with the calls of SciPy's OdeSolver; all else is done in C.

cdef extern from "eomgen_steppers.h" nogil:
    enum: EOMGEN_END, EOMGEN_STEP_TOO_SMALL
    double eomgen_longest(eomgen_run *) noexcept


cdef int called_ask(void *trajectory, double t, const double *y, double *u, double *f) noexcept with gil:
    return (<CalledRun>trajectory).answer(t, y, u, f)


cdef void called_begin(eomgen_run *run) noexcept with gil:
    (<CalledRun>run.callback_data).begin()


cdef int called_step(eomgen_run *run) noexcept with gil:
    return (<CalledRun>run.callback_data).advance()


cdef void called_prepare(eomgen_run *run) noexcept with gil:
    (<CalledRun>run.callback_data).prepare()


cdef void called_between(const eomgen_run *run, double t, double *y) noexcept with gil:
    (<CalledRun>run.callback_data).look(t, y)


cdef eomgen_method CALLED
memset(&CALLED, 0, sizeof(CALLED))
CALLED.name, CALLED.rows_K = "called", 2
CALLED.begin, CALLED.step, CALLED.prepare, CALLED.interpolate = called_begin, called_step, called_prepare, called_between


cdef class CalledRun(Run):
    """A whole integration by a solver in Python.

    Parameters
    ----------
    method, context, t0, y0, t_bound, rtol, atol, max_step, first_step, signals
        As for Run; "called", and tolerances of no meaning.  States behind those of the model go along.
    plan : dict
        Of a Run, and make(t, y, end): a new solver from there to the next node; rates(t, y): y' beside events;
        inputs(t, y): u, or None where they stay.

    Attributes
    ----------
    message : str
        Of a step that failed.
    """

    cdef object make, rates, inputs, solver, between, parts
    cdef bint begins, slopes
    cdef long done[3]
    cdef readonly str message

    def __cinit__(self, str method, Context context, double t0, y0, double t_bound, double rtol, atol,
                  double max_step, double first_step=0.0, signals=(), plan=None):
        self.make, self.rates, self.inputs, self.message = plan["make"], plan["rates"], plan["inputs"], ""
        self.parts = [] if plan["dense"] else None
        self.slopes = plan["events"] is not None or self.run.meeting != NULL
        self.run.ask, self.run.until_callback, self.run.signals = called_ask, -1, <const eomgen_signal *>&CALLED

    cdef stop(self, error):
        self.raised = error if self.raised is None else self.raised
        self.run.stopped = 1

    cdef int answer(self, double t, const double *y, double *u, double *f) noexcept:
        cdef cnp.ndarray found
        if self.raised is not None or (f == NULL and self.inputs is None):
            return self.raised is not None
        try:
            if f == NULL:
                found = vector(self.inputs(t, copy(y, self.run.n - self.run.n_beside)), self.run.n_u, "u", ValueError)
                memcpy(u, cnp.PyArray_DATA(found), self.run.n_u * sizeof(double))
            else:
                found = vector(self.rates(t, copy(y, self.run.n)), self.run.n, "x", ValueError)
                memcpy(f, cnp.PyArray_DATA(found), self.run.n * sizeof(double))
            return 0
        except BaseException as error:
            self.stop(error)
            return 1

    cdef begin(self):
        """A solver for the next part."""
        cdef eomgen_run *run = &self.run
        if self.raised is not None:
            return
        try:
            self.count(True)
            self.solver = self.make(run.t, copy(run.y, run.n), run.t_bound)
            self.begins = True
            run.h_abs = getattr(self.solver, "h_abs", None) or 0.0
        except BaseException as error:
            self.stop(error)
        if self.slopes:
            self.answer(run.t, run.y, NULL, run.f)

    cdef count(self, bint ended):
        """Take the solver's counts, and keep them where it has ended."""
        cdef int k
        cdef long *counts[3]
        counts[0], counts[1] = &self.run.evaluations, &self.run.differentiations
        counts[2] = &self.run.factorizations
        for k, name in enumerate(("nfev", "njev", "nlu")):
            counts[k][0] = self.done[k] + int(getattr(self.solver, name, 0) or 0)
            if ended:
                self.done[k] = counts[k][0]

    cdef int advance(self) noexcept:
        """A step."""
        cdef eomgen_run *run = &self.run
        cdef cnp.ndarray state
        cdef double longest, end = run.t_bound
        if self.raised is not None:
            return EOMGEN_STOPPED
        try:
            solver = self.solver
            if self.stall_check is not None and not self.begins:
                self.stall_check(run.t, copy(run.y, run.n), 1)
            self.begins = False
            if solver.status != "running":  # it has ended by itself
                return EOMGEN_END
            longest = eomgen_longest(run) if run.meeting != NULL else INFINITY
            if longest < abs(end - run.t):
                bind(solver, run.t + run.direction * longest)
            message = solver.step()
            self.count(False)
            if solver.t_bound != end:
                bind(solver, end)
                if solver.status == "finished" and solver.t != end:
                    solver.status = "running"
            if solver.status == "failed":
                self.message = str(message)
                return EOMGEN_STEP_TOO_SMALL
            state = vector(solver.y, run.n, "y", ValueError)
            memcpy(run.y_old, run.y, run.n * sizeof(double))
            memcpy(run.y, cnp.PyArray_DATA(state), run.n * sizeof(double))
            run.t_old, run.t = solver.t_old, solver.t
            run.step, run.h_abs = run.t - run.t_old, getattr(solver, "h_abs", None) or 0.0
            run.interpolates, run.steps = 0, run.steps + 1
        except BaseException as error:
            self.stop(error)
            return EOMGEN_STOPPED
        if self.slopes:
            self.answer(run.t, run.y, NULL, run.f)
        return 0

    cdef prepare(self):
        if self.raised is not None:
            return
        try:
            self.between = self.solver.dense_output()
            if self.parts is not None:
                self.parts.append(self.between)
        except BaseException as error:
            self.stop(error)

    cdef look(self, double t, double *y):
        """The state at a time of the last step; NaN after an error."""
        cdef cnp.ndarray state
        cdef int i
        try:
            if self.raised is None:
                state = vector(self.between(t), self.run.n, "y", ValueError)
                memcpy(y, cnp.PyArray_DATA(state), self.run.n * sizeof(double))
                return
        except BaseException as error:
            self.stop(error)
        for i in range(self.run.n):
            y[i] = NAN

    def dense(self):
        """The solution between steps, after outcome(): times at which pieces end, and what gives each."""
        return [] if not self.stored[2] else list(zip(np.concatenate(self.stored[2])[:, 2].tolist(), self.parts))


cdef bind(solver, double bound):
    """Set where a solver must not go beyond; LSODA keeps a copy."""
    solver.t_bound = bound
    inner = getattr(getattr(solver, "_lsoda_solver", None), "_integrator", None)
    if inner is not None:
        inner.rwork[0] = bound


# Integrators: a method and its tolerances held ready, for integrations that begin anew again and again.

cdef enum:
    WATCHED_AFTER = 200  # milliseconds after which a call is told of its steps, in case they lead nowhere


cdef class Integrator(Run):
    """Integrations from one state to another, each as if it were the first.

    Parameters
    ----------
    method, context, t0, y0, t_bound, rtol, atol, max_step, first_step
        As for Stepper; times and state mean nothing.
    plan : dict
        Of a Run that stores nothing, with a node whose value means nothing.
    """

    cdef eomgen_function project
    cdef double *end
    cdef double first, begun
    cdef object turn
    cdef public object make_stall_check

    def __cinit__(self, str method, Context context, double t0, y0, double t_bound, double rtol, atol,
                  double max_step, double first_step=0.0, signals=(), plan=None):
        self.end, self.first, self.turn = <double *>self.trajectory.nodes, first_step, allocate_lock()
        if context.model.projects:
            self.project = context.model.kernel("project").call

    def advance(self, double t, x, double h, p=None, u=None, out=None, error=ValueError):
        """From x (n_x,) at time t over a time h, both checked: (state, None), or (state reached, what happened): the
        status, the time, the last failure of an evaluation, and what a signal or the watch raised."""
        cdef eomgen_run *run = &self.run
        cdef eomgen_trajectory *j = &self.trajectory
        cdef int n = run.n, status = 1
        cdef cnp.npy_intp length = n
        cdef Model model = self.context.model
        cdef cnp.ndarray state = vector(x, n, "x", error)
        cdef cnp.ndarray inputs = self.context.u if u is None else vector(u, model.table.n_u, "u", error)
        cdef cnp.ndarray constants = self.context.c
        cdef cnp.ndarray result
        if p is not None:
            constants = model.constants(vector(p, model.table.n_p, "p", error), error)
        result = cnp.PyArray_EMPTY(1, &length, cnp.NPY_DOUBLE, 0) if out is None else target(out, n, error)
        if not self.turn.acquire(False):
            raise fault(error, "EG-USAGE", "it is already working in another thread; make one integrator for each thread")
        try:
            memcpy(run.y, cnp.PyArray_DATA(state), n * sizeof(double))
            memcpy(run.u, cnp.PyArray_DATA(inputs), model.table.n_u * sizeof(double))
            run.c = <const double *>cnp.PyArray_DATA(constants)
            run.t = run.t_old = t
            run.step, run.h_abs = 0.0, self.first
            self.end[0], j.span = t + h, abs(h)
            run.evaluations = run.rejected = run.steps = run.differentiations = run.factorizations = 0
            run.failure, run.stopped, run.until_callback = 0, 0, self.stride
            j.begun, j.node, self.seen, self.stall_check, self.raised = 0, 0, 0, None, None
            self.called_at = self.begun = perf_counter()
            if not self.correct():
                status = EOMGEN_RESET_FAILED
            elif h != 0.0:
                with nogil:
                    status = eomgen_advance(self.method, run, j)
                if status == 1 and not self.correct():
                    status = EOMGEN_RESET_FAILED
            status = self.tell(status)
            if status != 1:
                return copy(run.y, n), (status, run.t, self.failure, self.raised)
            memcpy(cnp.PyArray_DATA(result), run.y, n * sizeof(double))
            return result, None
        finally:
            run.c = <const double *>cnp.PyArray_DATA(self.context.c)
            self.turn.release()

    cdef bint correct(self):
        """Bring the state onto the constraints, if there are any; whether that could be done."""
        cdef eomgen_run *run = &self.run
        if self.project == NULL:
            return True
        memcpy(run.y_old, run.y, run.n * sizeof(double))
        return self.project(run.t, run.y_old, run.u, run.c, run.y, run.w) == 0

    cdef long callback(self, double t):
        if self.stall_check is None and self.called_at - self.begun > 1e-3 * WATCHED_AFTER:
            try:
                self.stall_check = self.make_stall_check(t, self.end[0], copy(self.run.y_old, self.run.n))
                self.seen = self.run.steps
            except BaseException as error:
                self.raised = error
                return 0
        return Run.callback(self, t)
