# Integrators: a method and its tolerances held ready, for integrations that begin anew again and again.

cdef enum:
    WATCHED_AFTER = 200  # milliseconds after which a call is told of its steps, in case they lead nowhere


cdef class Integrator(Journey):
    """Integrations from one state to another, each as if it were the first.

    Parameters
    ----------
    method, context, t0, y0, t_bound, rtol, atol, max_step, first_step
        As for Stepper; times and state mean nothing.
    plan : dict
        Of a Journey that stores nothing, with a node whose value means nothing.
    """

    cdef eomgen_function project
    cdef double *end
    cdef double first, begun
    cdef object turn
    cdef public object make_stall_check

    def __cinit__(self, str method, Context context, double t0, y0, double t_bound, double rtol, atol,
                  double max_step, double first_step=0.0, signals=(), plan=None):
        self.end, self.first, self.turn = <double *>self.journey.nodes, first_step, allocate_lock()
        if context.model.projects:
            self.project = context.model.kernel("project").call

    def advance(self, double t, x, double h, p=None, u=None, out=None, error=ValueError):
        """From x (n_x,) at time t over a time h, both checked: (state, None), or (state reached, what happened): the
        status, the time, the last failure of an evaluation, and what a signal or the watch raised."""
        cdef eomgen_run *run = &self.run
        cdef eomgen_journey *j = &self.journey
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
                    status = eomgen_travel(self.method, run, j)
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
        return Journey.callback(self, t)

