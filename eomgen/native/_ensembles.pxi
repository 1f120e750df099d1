# Ensembles: many trajectories of the model from one queue, worked on by any number of threads.

cdef extern from "eomgen_ensembles.h" nogil:
    ctypedef struct eomgen_ensemble:
        const eomgen_method *method
        const eomgen_model *model
        eomgen_function rhs, jacobian, meeting
        const eomgen_series *series
        void (*lane_rhs)() noexcept
        void (*lane_series)() noexcept
        int lane_width, n, n_q, n_nodes, stop
        ptrdiff_t count, p_stride, u_stride, n_eval, n_notes, done
        const_reals x0, p, u, nodes, atol, t_eval
        double rtol, max_step, first_step
        int64_t max_steps
        reals samples, x, t, notes, failure_time
        ints status, failure
        int64_t *steps
        int64_t *rejected
        int64_t *evaluations
        int64_t *noted
    ctypedef struct eomgen_thread:
        const eomgen_signal *signals
        eomgen_events *events
        reals notes, memory
        ptrdiff_t notes_room
    ptrdiff_t eomgen_ensemble_memory(const eomgen_ensemble *, const eomgen_thread *) noexcept
    void eomgen_ensemble_work(eomgen_ensemble *, const eomgen_thread *) noexcept


cdef const double *reading(cnp.ndarray array) noexcept:
    return <const double *>cnp.PyArray_DATA(array)


cdef class Ensemble:
    """Trajectories to run and what became of them.

    Parameters
    ----------
    model : Model
    method : str
        One of ``methods``.
    nodes : (m,) array
        Start, corners of the signals, end.
    x0 : (k, n_x) array
        A row for each trajectory.
    p, u : (n_p,), (n_u,) or (k, n_p), (k, n_u) arrays
        The same for all, or a row for each.
    rtol : float
    atol : (n_x,) array
    max_step, first_step : float
        A first step of 0 is chosen.
    max_steps : int
        A trajectory that takes more is given up.
    t_eval : (m,) array, optional
        Times at which to keep the states.
    signals : list
        Inputs over time, as for a Stepper.
    events : dict or None
        As in the plan of a Run; none may wait for Python.
    keep : int
        Events kept of each trajectory.

    Attributes
    ----------
    x, t : (k, n_x), (k,) arrays
        The last state of each and its time.
    samples : (k, m, n_x) array or None
    notes : (k, keep, 2 + n_x) array or None
        Event, time and state of the first events of each; NaN where there were fewer.
    noted : (k,) array
        How many events there were.
    status, failure, failure_time, steps, rejected, evaluations : (k,) arrays
        0 where the end was reached, 1 at an event that ended the run; the status of the last evaluation that failed and its time.
    """

    cdef eomgen_ensemble all
    cdef list held
    cdef object signals, watched
    cdef Context context
    cdef readonly cnp.ndarray x, t, status, steps, rejected, evaluations, failure, failure_time, noted
    cdef readonly object samples, notes

    def __cinit__(self, Model model not None, str method, nodes, x0, p, u, double rtol, atol, double max_step, double first_step,
                  int64_t max_steps, t_eval=None, signals=(), events=None, ptrdiff_t keep=0):
        cdef const eomgen_kernel *rhs = model.kernel("rhs")
        cdef int n = rhs.n_in
        cdef eomgen_ensemble *all = &self.all
        cdef const eomgen_lanes *lanes
        model.take_lanes()
        lanes = seen_lanes(model.lanes)
        self.signals, self.watched, self.context = tuple(signals), events, Context(model)
        x0, p, u = (np.ascontiguousarray(value, dtype=float) for value in (x0, p, u))
        count = len(x0)
        for label, value, size in (("x0", x0, n), ("p", p, model.table.n_p), ("u", u, model.table.n_u)):
            if value.shape != (count, size) and (label == "x0" or value.shape != (size,)):
                raise ValueError(f"{label} must have shape ({count}, {size}), not {value.shape}")
        nodes, atol = np.array(nodes, dtype=float), np.array(vector(atol, n, "atol", ValueError))
        asked = np.ascontiguousarray(() if t_eval is None else t_eval, dtype=float)
        self.held = [x0, p, u, nodes, atol, asked]
        all.method, all.model = model.method(method), model.table
        all.series = seen_series(model.series)
        all.rhs, all.n, all.count = rhs.call, n, count
        if all.method.squares > 0:
            all.jacobian = model.kernel("jacobian").call
        if "meeting_time" in model.places:
            all.meeting = model.kernel("meeting_time").call
        all.n_q = model.n_q
        if lanes != NULL:
            all.lane_rhs, all.lane_series, all.lane_width = lanes.contracted, lanes.expand, lanes.width
        all.x0, all.p, all.u = reading(x0), reading(p), reading(u)
        all.p_stride, all.u_stride = model.table.n_p * (p.ndim - 1), model.table.n_u * (u.ndim - 1)
        all.nodes, all.n_nodes = reading(nodes), len(nodes)
        all.rtol, all.atol, all.max_step, all.first_step = rtol, reading(atol), max_step, first_step
        all.max_steps, all.t_eval, all.n_eval = max_steps, reading(asked), len(asked)
        self.x, self.t = np.full((count, n), np.nan), np.full(count, nodes[0])
        self.status = np.full(count, -101, dtype=np.intc)  # stopped
        self.failure, self.failure_time = np.zeros(count, dtype=np.intc), np.zeros(count)
        self.steps, self.rejected, self.evaluations = (np.zeros(count, dtype=np.int64) for _ in range(3))
        self.samples = None if t_eval is None else np.full((count, len(asked), n), np.nan)
        all.x, all.t = <double *>cnp.PyArray_DATA(self.x), <double *>cnp.PyArray_DATA(self.t)
        all.samples = NULL if t_eval is None else <double *>cnp.PyArray_DATA(<cnp.ndarray>self.samples)
        all.status, all.failure = <int *>cnp.PyArray_DATA(self.status), <int *>cnp.PyArray_DATA(self.failure)
        self.notes = np.full((count, keep, 2 + n), np.nan) if events else None
        self.noted = np.zeros(count, dtype=np.int64)
        all.n_notes, all.noted = keep, <int64_t *>cnp.PyArray_DATA(self.noted)
        all.notes = <double *>cnp.PyArray_DATA(<cnp.ndarray>self.notes) if events else NULL
        all.failure_time = <double *>cnp.PyArray_DATA(self.failure_time)
        all.steps, all.rejected = <int64_t *>cnp.PyArray_DATA(self.steps), <int64_t *>cnp.PyArray_DATA(self.rejected)
        all.evaluations = <int64_t *>cnp.PyArray_DATA(self.evaluations)

    def work(self):
        """Run trajectories until none is left, without the GIL; called by every thread."""
        cdef eomgen_thread own
        cdef Run trajectory
        held = []
        own.signals, own.events, own.notes, own.notes_room = make_signals(self.signals, self.all.model.n_u, held), NULL, NULL, 0
        if self.watched:
            plan = {"nodes": [0.0], "t_eval": [0.0], "dense": False, "watch": None, "events": self.watched}
            atol = np.ones(self.all.n)
            trajectory = Run(self.all.method.name.decode(), self.context, 0.0, atol, 0.0, 1.0, atol, 1.0, plan=plan)
            own.events, own.notes, own.notes_room = &trajectory.events, trajectory.trajectory.notes, trajectory.trajectory.notes_room
        memory = np.zeros(eomgen_ensemble_memory(&self.all, &own))
        own.memory = <double *>cnp.PyArray_DATA(<cnp.ndarray>memory)
        with nogil:
            eomgen_ensemble_work(&self.all, &own)
        tell_raised()

    def stop(self):
        """Begin no further trajectory and end those under way."""
        self.all.stop = 1

    @property
    def done(self):
        """How many trajectories have ended."""
        return self.all.done

