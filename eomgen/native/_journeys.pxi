# Journeys: whole trajectories by eomgen_loop.h, with a call of Python every few milliseconds.

from cpython.exc cimport PyErr_CheckSignals
from libc.math cimport INFINITY, isnan

from time import perf_counter

cdef extern from "eomgen_loop.h" nogil:
    ctypedef struct eomgen_events:
        int n, n_model, n_tape
        eomgen_function values
        const eomgen_tape *tape
        int (*outside)(void *, double, const double *, double *) noexcept nogil
        void *asker
        const int *direction
        const long *most
        const int *action
        eomgen_function resets, project
        int n_resets
        const int *reset_of
        const int *reset_x
        double *values_reset
        double *g
        double *g_new
        double *slope
        double *slope_new
        double *size
        double *trial
        double *y
        long *count
        int *leaving
        double *bracket
        int *whose
        int *fired
        int *touch
        int crowd
        double *latest
        double last_reset
        int crowded, for_slope
    ctypedef struct eomgen_journey:
        const double *nodes
        long n_nodes
        const double *t_eval
        long n_eval
        eomgen_events *events
        double span
        long room
        double *times
        double *states
        long pieces_room
        double *pieces
        long notes_room
        double *notes
        long trail_room
        double *trail
        long node, done, stored, n_pieces, n_notes, n_trail, resets
        int begun
    enum: EOMGEN_FULL, EOMGEN_RESET_FAILED, EOMGEN_STOPPED
    int eomgen_travel(const eomgen_method *, eomgen_run *, eomgen_journey *) noexcept
    int eomgen_jump(const eomgen_method *, eomgen_run *, eomgen_journey *) noexcept


cdef long call_python(void *callback_data, const double *t) noexcept with gil:
    return (<Journey>callback_data).callback(t[0])


cdef int ask_outside(void *asker, double t, const double *y, double *g) noexcept with gil:
    return (<Journey>asker).ask(t, y, g)


cdef class Dense:
    """The solution of a run: ``f(t)`` for times (k,) gives (n_x, k)."""

    cdef eomgen_run run
    cdef const eomgen_method *method
    cdef readonly cnp.ndarray pieces

    @property
    def ends(self):
        """First and last time."""
        return self.pieces[0, 0], self.pieces[len(self.pieces) - 1, 2]

    def __call__(self, t):
        cdef cnp.ndarray at = np.ascontiguousarray(t, dtype=float)
        sign = 1.0 if self.pieces[0, 1] >= 0.0 else -1.0
        which = np.searchsorted(sign * self.pieces[:, 2], sign * at)
        cdef cnp.ndarray chosen = np.minimum(which, len(self.pieces) - 1).astype(np.intp)
        cdef cnp.npy_intp k = cnp.PyArray_DIM(at, 0), i
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
        return np.ascontiguousarray(result.T)


cdef class Journey(Stepper):
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

    cdef eomgen_journey journey
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
        cdef eomgen_journey *journey = &self.journey
        self.stored, self.raised, self.stride = [[], [], [], [], []], None, 16
        cdef cnp.ndarray nodes = numbers_of(list(plan["nodes"]))
        self.held.append(nodes)
        journey.nodes, journey.n_nodes = <const double *>cnp.PyArray_DATA(nodes), cnp.PyArray_DIM(nodes, 0)
        journey.span, journey.n_eval = abs(t_bound - t0), -1
        if plan["t_eval"] is not None:
            asked = self.hold(plan["t_eval"], float)
            journey.t_eval, journey.n_eval = <const double *>cnp.PyArray_DATA(<cnp.ndarray>asked), len(asked)
        journey.pieces_room = 256 if plan["dense"] else 0
        self.most = plan.get("trail", 0)
        journey.trail_room = 256 if self.most > 0 and journey.n_eval >= 0 else 0
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
        cdef double *numbers = <double *>self.work(15 * n + self.run.n, float)
        ev.g, ev.g_new, ev.slope, ev.slope_new = numbers, numbers + n, numbers + 2 * n, numbers + 3 * n
        ev.size, ev.trial, ev.latest = numbers + 4 * n, numbers + 5 * n, numbers + 6 * n
        ev.bracket, ev.y = numbers + 7 * n, numbers + 15 * n
        ev.count = <long *>self.work(n, np.dtype("l"))
        cdef int *whole = <int *>self.work(5 * n, np.intc)
        ev.leaving, ev.fired, ev.touch, ev.whose = whole, whole + n, whole + 2 * n, whole + 3 * n
        self.journey.events = ev

    cdef allocate(self, long room):
        """Room for results, after what is there has been taken out."""
        cdef eomgen_journey *j = &self.journey
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
        cdef eomgen_journey *j = &self.journey
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

    def travel(self):
        """Go on without the GIL until the end (1), a terminal event (2), an event that waits (3), or a failure (< 0)."""
        cdef int status
        while True:
            with nogil:
                status = eomgen_travel(self.method, &self.run, &self.journey)
            if status != EOMGEN_FULL:
                return self.tell(status)
            room = min(2 * max(self.journey.room, 256), 1 << 16)
            self.take()
            self.allocate(room)

    def jump(self, x):
        """Go on from another state, at an event that waits; a negative number if resets crowd together."""
        cdef cnp.ndarray state = vector(x, self.run.n, "x", ValueError)
        cdef int status
        memcpy(self.run.y, cnp.PyArray_DATA(state), self.run.n * sizeof(double))
        if (self.journey.n_eval < 0 and self.journey.stored + 2 > self.journey.room) or (
                self.journey.trail_room > 0 and self.journey.n_trail + 2 > self.journey.trail_room):
            self.take()
            self.allocate(self.journey.room)
        with nogil:
            status = eomgen_jump(self.method, &self.run, &self.journey)
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
        cdef eomgen_journey *j = &self.journey
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
        cdef Dense dense = Dense.__new__(Dense)
        dense.method, dense.run.n, dense.pieces = self.method, self.run.n, np.concatenate(self.stored[2])
        return dense

    @property
    def resets(self):
        return self.journey.resets

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
