# Steppers: the explicit Runge-Kutta methods of eomgen_steppers.h over the model's right-hand side.

cdef class Tape:
    """An expression of t, x, u and p given at run time.

    Parameters
    ----------
    code : sequence of (operation, i, j, k)
        Operations by name; operands are earlier instructions, or an index into numbers, x, u or p.
    numbers : sequence of float
    out : sequence of int
        Instructions whose results are wanted.
    """

    cdef eomgen_tape tape
    cdef cnp.ndarray code, numbers, out, results

    def __cinit__(self, code, numbers, out):
        self.code = np.array([(TAPES[row[0]], *row[1:]) for row in code], dtype=np.intc).reshape(-1, 4)
        self.numbers, self.out = np.array(numbers, dtype=float), np.array(out, dtype=np.intc)
        self.results = np.zeros(len(code) + 1)
        self.tape.n, self.tape.n_out = len(code), len(out)
        self.tape.code = <const int *>cnp.PyArray_DATA(self.code)
        self.tape.numbers = <const double *>cnp.PyArray_DATA(self.numbers)
        self.tape.out = <const int *>cnp.PyArray_DATA(self.out)
        self.tape.results = <double *>cnp.PyArray_DATA(self.results)


cdef dict TAPES = {}
cdef int _code = 0
while eomgen_operations[_code] != NULL:
    TAPES[eomgen_operations[_code].decode()] = _code
    _code += 1


cdef cnp.ndarray numbers_of(list given):
    """A list of floats as an array: quicker than NumPy's for the few of a run."""
    cdef cnp.npy_intp n = len(given), i
    cdef cnp.ndarray result = cnp.PyArray_EMPTY(1, &n, cnp.NPY_DOUBLE, 0)
    cdef double *data = <double *>cnp.PyArray_DATA(result)
    for i in range(n):
        data[i] = given[i]
    return result


cdef class Dense:
    """The solution of a run, or within one step: ``f(t)`` for times (k,) gives (n_x, k), for one number (n_x,)."""

    cdef eomgen_run run
    cdef const eomgen_method *method
    cdef readonly cnp.ndarray pieces
    cdef readonly double t_old, t

    @property
    def t_min(self):
        return min(self.t_old, self.t)

    @property
    def t_max(self):
        return max(self.t_old, self.t)

    def __call__(self, t):
        cdef cnp.ndarray at = cnp.PyArray_GETCONTIGUOUS(doubles(t, "t", ValueError))
        sign = 1.0 if self.pieces[0, 1] >= 0.0 else -1.0
        which = np.searchsorted(sign * self.pieces[:, 2], sign * at.ravel())
        cdef cnp.ndarray chosen = np.minimum(which, len(self.pieces) - 1).astype(np.intp)
        cdef cnp.npy_intp k = cnp.PyArray_SIZE(at), i
        cdef int n = self.run.n
        cdef cnp.ndarray result = rows(k, n)
        cdef double *piece
        cdef eomgen_run run = self.run  # of this call: threads may share the object
        for i in range(k):
            piece = <double *>cnp.PyArray_DATA(self.pieces) + (<cnp.npy_intp *>cnp.PyArray_DATA(chosen))[i] * (
                3 + n * (1 + self.method.rows_F))
            run.t_old, run.step, run.y_old, run.F = piece[0], piece[1], piece + 3, piece + 3 + n
            self.method.interpolate(&run, (<double *>cnp.PyArray_DATA(at))[i],
                                    <double *>cnp.PyArray_DATA(result) + i * n)
        return result[0] if cnp.PyArray_NDIM(at) == 0 else np.ascontiguousarray(result.T)


cdef Dense dense_of(const eomgen_method *method, int n, cnp.ndarray pieces):
    """The solution from rows t_old, step, end, y_old (n) and coefficients."""
    cdef Dense dense = Dense.__new__(Dense)
    dense.method, dense.run.n, dense.pieces = method, n, pieces
    dense.t_old, dense.t = pieces[0, 0], pieces[len(pieces) - 1, 2]
    return dense


cdef const eomgen_signal *make_signals(signals, int n_u, list held) except? NULL:
    """The inputs over time as C reads them, in arrays that `held` keeps alive."""
    cdef eomgen_signal *table
    cdef cnp.npy_intp bytes = n_u * sizeof(eomgen_signal)
    if not signals:
        return NULL
    memory = cnp.PyArray_ZEROS(1, &bytes, cnp.NPY_UINT8, 0)
    table = <eomgen_signal *>cnp.PyArray_DATA(<cnp.ndarray>memory)
    held.append(memory)
    for index, *given in signals:
        if len(given) == 1:
            tape = Tape(*given[0])
            held.append(tape)
            table[<int>index].n, table[<int>index].tape = 1, &(<Tape>tape).tape
            continue
        order, times, values = given
        pair = np.array(times, dtype=float), np.array(values, dtype=float, order="C")
        held.extend(pair)
        table[<int>index].n, table[<int>index].order = len(times), order
        table[<int>index].times = <const double *>cnp.PyArray_DATA(<cnp.ndarray>pair[0])
        table[<int>index].values = <const double *>cnp.PyArray_DATA(<cnp.ndarray>pair[1])
    return table


cdef class Stepper:
    """One integration of the right-hand side.

    Parameters
    ----------
    method : str
        One of ``methods``.
    context : Context
        Parameters and inputs.
    t0, t_bound : float
        Start and end.
    y0 : (n_x,) array
    rtol : float
    atol : float or (n_x,) array
    max_step, first_step : float
        A first step of 0 is chosen.
    signals : list of (index, order, times, values) or (index, (code, numbers, out)), optional
        Inputs over time: order 0 holds, 1 is linear; 3 has rows of 4 coefficients in values; or an expression.
    plan : dict, optional
        Of a Run; then the first evaluation is left to it, and each step starts on the constraints.

    Attributes
    ----------
    t, t_old, evaluations, rejected, differentiations, factorizations
        Time, time before the last step, calls of the right-hand side so far, steps tried in vain; of implicit methods,
        calls of the Jacobian and matrices factored.
    """

    cdef eomgen_run run
    cdef const eomgen_method *method
    cdef Context context
    cdef cnp.ndarray memory, atol
    cdef list held

    def __cinit__(self, str method, Context context, double t0, y0, double t_bound, double rtol, atol,
                  double max_step, double first_step=0.0, signals=(), plan=None):
        cdef Model model = context.model
        cdef const eomgen_model *table = model.table
        cdef const eomgen_kernel *rhs = model.kernel("rhs")
        cdef int n = len(y0)
        self.method = &CALLED if method == "called" else model.method(method)
        self.context, self.held = context, []
        if isinstance(atol, float):
            self.atol = numbers_of([atol] * n)
        else:
            self.atol = np.array(vector(atol, n, "atol", ValueError))
        cdef cnp.ndarray start = vector(y0, n, "y0", ValueError)
        cdef cnp.npy_intp length = table.n_work + table.n_u
        if self.method.squares > 0:
            self.run.jacobian = model.kernel("jacobian").call
        if "meeting_time" in model.places:
            self.run.meeting = model.kernel("meeting_time").call
        self.run.n_q, self.run.n_beside = model.n_q, n - rhs.n_in
        if method != "called" and n != rhs.n_in:
            raise ValueError(f"y0 must have shape ({rhs.n_in},)")
        cdef const eomgen_series *series = seen_series(model.series)
        self.run.series = series
        length += eomgen_rows(self.method, n, series)
        self.memory = cnp.PyArray_ZEROS(1, &length, cnp.NPY_DOUBLE, 0)
        cdef eomgen_run *run = &self.run
        run.rhs, run.n, run.n_u = rhs.call, n, table.n_u
        run.c = <const double *>cnp.PyArray_DATA(context.c)
        run.w = <double *>cnp.PyArray_DATA(self.memory)
        run.u = run.w + table.n_work
        run.closed = run.w + table.closed_at if plan is not None and table.closed_at else NULL
        eomgen_lay_out(run, self.method, run.u + table.n_u)
        memcpy(run.y, cnp.PyArray_DATA(start), n * sizeof(double))
        memcpy(run.u, cnp.PyArray_DATA(context.u), table.n_u * sizeof(double))
        run.atol = <const double *>cnp.PyArray_DATA(self.atol)
        run.rtol, run.max_step, run.h_abs = rtol, max_step, first_step
        run.t = run.t_old = t0
        run.t_bound, run.direction, run.hold = t_bound, -1.0 if t_bound < t0 else 1.0, NAN
        run.signals = make_signals(signals, table.n_u, self.held)
        if plan is None:
            eomgen_start(self.method, run)
            tell_raised()

    def step(self):
        """Take one step; False if it would have to be too small."""
        cdef int status = eomgen_step(self.method, &self.run)
        tell_raised()
        return status == 0

    def state(self):
        """A copy of the state (n_x,)."""
        return copy(self.run.y, self.run.n)

    def interpolant(self):
        """The solution within the last step."""
        cdef int n = self.run.n
        cdef cnp.ndarray piece = rows(1, 3 + n * (1 + self.method.rows_F))
        cdef double *data = <double *>cnp.PyArray_DATA(piece)
        eomgen_between(self.method, &self.run, self.run.t, data + 3)  # forms the coefficients
        tell_raised()
        data[0], data[1], data[2] = self.run.t_old, self.run.step, self.run.t
        memcpy(data + 3, self.run.y_old, n * sizeof(double))
        memcpy(data + 3 + n, self.run.F, n * self.method.rows_F * sizeof(double))
        return dense_of(self.method, n, piece)

    @property
    def t(self):
        return self.run.t

    @property
    def t_old(self):
        return self.run.t_old

    @property
    def evaluations(self):
        return self.run.evaluations

    @property
    def rejected(self):
        return self.run.rejected

    @property
    def differentiations(self):
        return self.run.differentiations

    @property
    def factorizations(self):
        return self.run.factorizations

    @property
    def failure(self):
        """(status, t, x) of the last evaluation that failed, or None."""
        if self.run.failure == 0:
            return None
        return self.run.failure, self.run.failure_time, copy(self.run.failure_state, self.run.n)


cdef cnp.ndarray target(out, cnp.npy_intp n, error):
    """The array (n,) that a state is written into."""
    if not (cnp.PyArray_Check(out) and cnp.PyArray_TYPE(<cnp.ndarray>out) == cnp.NPY_DOUBLE
            and cnp.PyArray_ISCARRAY(<cnp.ndarray>out) and cnp.PyArray_NDIM(<cnp.ndarray>out) == 1
            and cnp.PyArray_DIM(<cnp.ndarray>out, 0) == n):
        raise error(f"out must be a contiguous writeable float64 array of shape ({n},)")
    return out


def march(Context context not None, t, h, x, u=None, out=None, error=ValueError):
    """One Runge-Kutta step of size h from state x (n_x,) at time t; ``(status, state)``."""
    cdef const eomgen_model *table = context.model.table
    cdef const eomgen_kernel *rhs = context.model.kernel("rhs")
    cdef int n = rhs.n_in, status
    cdef double begin = finite(t, "t", error), size = finite(h, "h", error)
    cdef cnp.ndarray start = vector(x, n, "x", error), inputs = context.u
    cdef cnp.npy_intp length = n, n_work = table.n_work + 5 * n
    cdef double[STACK] stack
    cdef double *w = stack
    cdef cnp.ndarray result
    if u is not None:
        inputs = vector(u, table.n_u, "u", error)
    result = cnp.PyArray_EMPTY(1, &length, cnp.NPY_DOUBLE, 0) if out is None else target(out, n, error)
    if n_work > STACK:
        heap = cnp.PyArray_EMPTY(1, &n_work, cnp.NPY_DOUBLE, 0)
        w = <double *>cnp.PyArray_DATA(heap)
    status = eomgen_march(rhs.call, n, begin, size, <double *>cnp.PyArray_DATA(start),
                          <double *>cnp.PyArray_DATA(inputs), <double *>cnp.PyArray_DATA(context.c),
                          <double *>cnp.PyArray_DATA(result), w, w + table.n_work)
    tell_raised()
    return status, result


# Runs: whole trajectories by eomgen_steppers.h, with a call of Python every few milliseconds.

from cpython.exc cimport PyErr_CheckSignals
from libc.math cimport INFINITY, isnan

from time import perf_counter

cdef extern from "eomgen_steppers.h" nogil:
    ctypedef struct eomgen_events:
        int n, n_model, n_tape, n_resets, crowd, for_slope
        eomgen_function values, resets, project
        const eomgen_tape *tape
        int (*outside)(void *, double, const double *, double *) noexcept nogil
        void *asker
        const_ints direction, action, reset_of, reset_x
        const long *most
        reals values_reset, size
        ints fired
    ctypedef struct eomgen_trajectory:
        const_reals nodes, t_eval
        eomgen_events *events
        double span
        reals times, states, pieces, notes, trail
        long n_nodes, n_eval, room, pieces_room, notes_room, trail_room
        long node, stored, n_pieces, n_notes, n_trail, resets
        int begun
    void eomgen_lay_out_events(eomgen_events *, double *, long *, int *)
    enum: EOMGEN_FULL, EOMGEN_RESET_FAILED, EOMGEN_STOPPED
    int eomgen_advance(const eomgen_method *, eomgen_run *, eomgen_trajectory *) noexcept
    int eomgen_jump(const eomgen_method *, eomgen_run *, eomgen_trajectory *) noexcept


cdef long call_python(void *callback_data, const double *t) noexcept with gil:
    return (<Run>callback_data).callback(t[0])


cdef int ask_outside(void *asker, double t, const double *y, double *g) noexcept with gil:
    return (<Run>asker).ask(t, y, g)


cdef class Run(Stepper):
    """A whole integration in C.

    Parameters
    ----------
    method, context, t0, y0, t_bound, rtol, atol, max_step, first_step, signals
        As for Stepper.
    plan : dict
        nodes (n,): times not to step over, the end last; t_eval (k,) or None; dense: keep the solution between steps;
        trail: numbers at most of the steps to keep where t_eval is given; watch: told the time now and then, or None;
        stall_check: told time, state and steps since, or None; events: None, or a dict of names (how many of the model's,
        or 0), tape (code, numbers, out) or None, outside: functions f(t, x, for_slope), and for each event direction, most, action;
        resets: rows (event, state) of the model's kernel; crowd: so many resets in a row are too many.

    Attributes
    ----------
    raised : exception or None
        What a signal, the watch or an event function raised; the run has stopped there.
    finite : bool
        Whether all states of the outcome are.
    """

    cdef eomgen_trajectory trajectory
    cdef eomgen_events events
    cdef object watch, stall_check, outside
    cdef long seen
    cdef cnp.ndarray times, states, notes, pieces, walked
    cdef list stored
    cdef double called_at
    cdef long stride, most
    cdef readonly object raised
    cdef readonly bint finite

    def __cinit__(self, str method, Context context, double t0, y0, double t_bound, double rtol, atol,
                  double max_step, double first_step=0.0, signals=(), plan=None):
        cdef eomgen_trajectory *trajectory = &self.trajectory
        self.stored, self.raised, self.stride = [[], [], [], [], []], None, 16
        cdef cnp.ndarray nodes = numbers_of(list(plan["nodes"]))
        self.held.append(nodes)
        trajectory.nodes, trajectory.n_nodes = <const double *>cnp.PyArray_DATA(nodes), cnp.PyArray_DIM(nodes, 0)
        trajectory.span, trajectory.n_eval = abs(t_bound - t0), -1
        if plan["t_eval"] is not None:
            asked = self.hold(plan["t_eval"], float)
            trajectory.t_eval, trajectory.n_eval = <const double *>cnp.PyArray_DATA(<cnp.ndarray>asked), len(asked)
        trajectory.pieces_room = 256 if plan["dense"] else 0
        self.most = plan.get("trail", 0)
        trajectory.trail_room = 256 if self.most > 0 and trajectory.n_eval >= 0 else 0
        if plan["events"] is not None:
            self.expect(**plan["events"])
        self.allocate(512)
        self.watch, self.stall_check, self.called_at, self.seen = plan["watch"], plan.get("stall_check"), perf_counter(), 0
        self.run.callback, self.run.callback_data, self.run.until_callback = call_python, <void *>self, self.stride

    cdef hold(self, values, kind):
        array = np.array(values, dtype=kind)
        self.held.append(array)
        return array

    cdef void *work(self, cnp.npy_intp n, kind):
        array = np.zeros(max(n, 1), dtype=kind)
        self.held.append(array)
        return cnp.PyArray_DATA(<cnp.ndarray>array)

    def expect(self, int model, tape, outside, direction, most, action, resets, int crowd):
        cdef eomgen_events *ev = &self.events
        cdef int n = len(direction), n_resets = len(resets)
        ev.n, ev.n_model, ev.n_resets, ev.crowd = n, model, n_resets, crowd
        if model:
            ev.values = self.context.model.kernel("events").call
        if n_resets:
            ev.resets = self.context.model.kernel("resets").call
            if self.context.model.projects:
                ev.project = self.context.model.kernel("project").call
        if tape is not None:
            held = Tape(*tape)
            self.held.append(held)
            ev.tape, ev.n_tape = &(<Tape>held).tape, len(tape[2])
        self.outside = list(outside)
        if self.outside:
            ev.outside, ev.asker = ask_outside, <void *>self
        pairs = np.array(resets, dtype=np.intc).reshape(-1, 2)
        ev.direction = <const int *>cnp.PyArray_DATA(<cnp.ndarray>self.hold(direction, np.intc))
        ev.action = <const int *>cnp.PyArray_DATA(<cnp.ndarray>self.hold(action, np.intc))
        ev.most = <const long *>cnp.PyArray_DATA(<cnp.ndarray>self.hold(most, np.dtype("l")))
        ev.reset_of = <const int *>cnp.PyArray_DATA(<cnp.ndarray>self.hold(pairs[:, 0], np.intc))
        ev.reset_x = <const int *>cnp.PyArray_DATA(<cnp.ndarray>self.hold(pairs[:, 1], np.intc))
        ev.values_reset = <double *>self.work(n_resets, float)
        eomgen_lay_out_events(ev, <double *>self.work(15 * n + self.run.n, float), <long *>self.work(n, np.dtype("l")),
                              <int *>self.work(5 * n, np.intc))
        self.trajectory.events = ev

    cdef allocate(self, long room):
        """Room for results, after what is there has been taken out."""
        cdef eomgen_trajectory *j = &self.trajectory
        cdef int n = self.run.n
        cdef cnp.npy_intp long_room
        if j.n_eval >= 0:
            room = j.n_eval
        if self.times is None or j.n_eval < 0:
            long_room = room
            self.times, self.states = cnp.PyArray_EMPTY(1, &long_room, cnp.NPY_DOUBLE, 0), rows(room, n)
            j.room, j.times = room, <double *>cnp.PyArray_DATA(self.times)
            j.states = <double *>cnp.PyArray_DATA(self.states)
        if j.pieces_room > 0:
            j.pieces_room = max(room, 256)
            self.pieces = rows(j.pieces_room, 3 + n * (1 + self.method.rows_F))
            j.pieces = <double *>cnp.PyArray_DATA(self.pieces)
        if j.trail_room > 0:
            j.trail_room = min(2 * j.trail_room, 1 << 16)
            self.walked = rows(j.trail_room, 1 + n)
            j.trail = <double *>cnp.PyArray_DATA(self.walked)
        if j.events != NULL:
            j.notes_room = 4 * self.events.n + room // 4
            self.notes = rows(j.notes_room, 2 + n)
            j.notes = <double *>cnp.PyArray_DATA(self.notes)

    cdef take(self):
        """Take out what has been stored."""
        cdef eomgen_trajectory *j = &self.trajectory
        if j.n_eval < 0:
            self.stored[0].append(self.times[:j.stored])
            self.stored[1].append(self.states[:j.stored])
            j.stored = 0
        if j.n_pieces:
            self.stored[2].append(self.pieces[:j.n_pieces])
            j.n_pieces = 0
        if j.n_notes:
            self.stored[3].append(self.notes[:j.n_notes])
            j.n_notes = 0
        if j.n_trail:
            self.most -= j.n_trail * (1 + self.run.n)
            if self.most >= 0:
                self.stored[4].append(self.walked[:j.n_trail])
            else:  # too many
                self.stored[4] = [self.walked[:0]]
                j.trail_room = 0
            j.n_trail = 0

    def proceed(self):
        """Go on without the GIL until the end (1), a terminal event (2), an event that waits (3), or a failure (< 0)."""
        cdef int status
        while True:
            with nogil:
                status = eomgen_advance(self.method, &self.run, &self.trajectory)
            if status != EOMGEN_FULL:
                return self.tell(status)
            room = min(2 * max(self.trajectory.room, 256), 1 << 16)
            self.take()
            self.allocate(room)

    def jump(self, x):
        """Go on from another state, at an event that waits; a negative number if resets crowd together."""
        cdef cnp.ndarray state = vector(x, self.run.n, "x", ValueError)
        cdef int status
        memcpy(self.run.y, cnp.PyArray_DATA(state), self.run.n * sizeof(double))
        if (self.trajectory.n_eval < 0 and self.trajectory.stored + 2 > self.trajectory.room) or (
                self.trajectory.trail_room > 0 and self.trajectory.n_trail + 2 > self.trajectory.trail_room):
            self.take()
            self.allocate(self.trajectory.room)
        with nogil:
            status = eomgen_jump(self.method, &self.run, &self.trajectory)
        return self.tell(status)

    cdef int tell(self, int status):
        """The status, or that of a run that was stopped where a function of the model raised."""
        try:
            tell_raised()
        except BaseException as error:
            self.raised = error
            return EOMGEN_STOPPED
        return status

    def fired(self):
        """The events that wait."""
        return [i for i in range(self.events.n) if self.events.fired[i]]

    def unknown(self):
        """The events watched that were NaN at the start and after every step."""
        return [i for i in range(self.events.n) if self.events.direction[i] <= 1 and isnan(self.events.size[i])]

    def outcome(self):
        """Times (k,), states (n_x, k), and rows (event, t, state) of events, in order; None without events."""
        cdef eomgen_trajectory *j = &self.trajectory
        if j.n_eval >= 0:
            pair = [[self.times[:j.stored]], [self.states[:j.stored]]]
            self.take()
        else:
            self.take()
            pair = self.stored
        notes = None
        if j.events != NULL:
            notes = np.concatenate(self.stored[3]) if self.stored[3] else np.empty((0, 2 + self.run.n))
        times, states = [parts[0] if len(parts) == 1 else np.concatenate(parts) for parts in pair[:2]]
        cdef cnp.ndarray x = cnp.PyArray_GETCONTIGUOUS(cnp.PyArray_Transpose(states, NULL))
        cdef double total = 0.0
        cdef cnp.npy_intp i
        for i in range(cnp.PyArray_SIZE(x)):
            total += 0.0 * (<double *>cnp.PyArray_DATA(x))[i]  # NaN from the first that is not finite
        self.finite = total == 0.0
        return times, x, notes

    def trail(self):
        """Rows (t, state) of every step, after outcome(); none if too many, None if they were not to be kept."""
        return np.concatenate(self.stored[4]) if self.stored[4] else None

    def dense(self):
        """The solution between steps, after outcome(); None if there is none."""
        if not self.stored[2]:
            return None
        return dense_of(self.method, self.run.n, np.concatenate(self.stored[2]))

    @property
    def resets(self):
        return self.trajectory.resets

    cdef long callback(self, double t):
        now = self.called_at
        try:
            PyErr_CheckSignals()
            now = perf_counter()
            if self.watch is not None:
                self.watch(t)
            if self.stall_check is not None and self.run.steps > self.seen:
                self.stall_check(t, copy(self.run.y_old, self.run.n), self.run.steps - self.seen)
                self.seen = self.run.steps
        except BaseException as error:
            self.raised = error
            return 0
        # the next call in 0.5 ms, as far as the time since the last tells; that of the first few evaluations tells little
        cdef double elapsed = now - self.called_at
        self.called_at = now
        self.stride = <long>min(max(self.stride * (5e-4 / max(elapsed, 1e-9)), 1.0), 16.0 * self.stride)
        return self.stride

    cdef int ask(self, double t, const double *y, double *g):
        cdef int k = 0
        if self.raised is not None:
            return 1
        try:
            for event in self.outside:
                g[k] = event(t, copy(y, self.run.n), self.events.for_slope != 0)
                k += 1
        except BaseException as error:
            self.raised = error
            return 1
        return 0
