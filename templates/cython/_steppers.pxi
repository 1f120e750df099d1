# Steppers: the explicit Runge-Kutta methods of eomgen_steppers.h over the model's right-hand side.

cdef extern from "eomgen_steppers.h" nogil:
    ctypedef struct eomgen_signal:
        int n, order
        const double *times
        const double *values
    ctypedef struct eomgen_run:
        eomgen_function rhs
        const double *c
        double *u
        const eomgen_signal *signals
        int n_u
        double *w
        int n
        double rtol, max_step, t_bound, direction
        const double *atol
        double t, t_old, step, h_abs
        double *y
        double *y_old
        double *f
        const double *closed
        double *next
        double *K
        double *F
        int interpolates
        long evaluations, rejected
        int failure
        double failure_time
        double *failure_state
    ctypedef struct eomgen_method:
        const char *name
        int rows_K, rows_F, error_order
        void (*interpolate)(const eomgen_run *, double, double *) noexcept nogil
    const eomgen_method eomgen_dop853, eomgen_rk45, eomgen_rk23
    void eomgen_start(const eomgen_method *, eomgen_run *) noexcept
    int eomgen_step(const eomgen_method *, eomgen_run *) noexcept
    void eomgen_between(const eomgen_method *, eomgen_run *, double, double *) noexcept
    int eomgen_advance(const eomgen_method *, eomgen_run *, long, const double *, long, long *, double *, double *,
                       long *) noexcept

ctypedef const eomgen_method *method_pointer
cdef method_pointer[3] METHODS
METHODS[0], METHODS[1], METHODS[2] = &eomgen_dop853, &eomgen_rk45, &eomgen_rk23
methods = tuple([METHODS[i].name.decode() for i in range(3)])


cdef cnp.ndarray rows(cnp.npy_intp n, cnp.npy_intp k):
    cdef cnp.npy_intp[2] dims = [n, k]
    return cnp.PyArray_EMPTY(2, dims, cnp.NPY_DOUBLE, 0)


cdef class Interpolant:
    """The solution within one step: ``f(t)`` for t (k,) gives (n, k), for one number (n,)."""

    cdef eomgen_run run
    cdef const eomgen_method *method
    cdef cnp.ndarray memory
    cdef readonly double t_old, t

    def __call__(self, t):
        times = np.asarray(t, dtype=float)
        cdef cnp.ndarray flat = np.ascontiguousarray(times.reshape(-1))
        cdef cnp.npy_intp k = cnp.PyArray_DIM(flat, 0), i
        cdef cnp.ndarray result = rows(k, self.run.n)
        cdef double *y = <double *>cnp.PyArray_DATA(result)
        cdef double *at = <double *>cnp.PyArray_DATA(flat)
        for i in range(k):
            self.method.interpolate(&self.run, at[i], y + i * self.run.n)
        return result[0] if times.ndim == 0 else np.ascontiguousarray(result.T)


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
    atol : (n_x,) array
    max_step, first_step : float
        A first step of 0 is chosen.
    signals : list of (index, order, times, values), optional
        Inputs over time: order 0 holds, 1 is linear; 3 has rows of 4 coefficients in values.
    closed : bool
        Start each step on the constraints, where the last one came near them.

    Attributes
    ----------
    t, t_old, evaluations, rejected
        Time, time before the last step, calls of the right-hand side so far, steps tried in vain.
    """

    cdef eomgen_run run
    cdef const eomgen_method *method
    cdef eomgen_signal *signals
    cdef Context context
    cdef cnp.ndarray memory, atol
    cdef list held

    def __cinit__(self, str method, Context context, double t0, y0, double t_bound, double rtol, atol,
                  double max_step, double first_step=0.0, signals=(), closed=False):
        cdef int index = find("rhs", ValueError), n = MODEL.kernels[index].n_in, i
        self.method = METHODS[methods.index(method)]
        self.context, self.held = context, []
        self.atol = np.array(vector(atol, n, "atol", ValueError))
        cdef cnp.ndarray start = vector(y0, n, "y0", ValueError)
        cdef cnp.npy_intp length = MODEL.n_work + MODEL.n_u + n * (5 + self.method.rows_K + self.method.rows_F)
        self.memory = cnp.PyArray_ZEROS(1, &length, cnp.NPY_DOUBLE, 0)
        cdef double *free = <double *>cnp.PyArray_DATA(self.memory)
        cdef eomgen_run *run = &self.run
        run.rhs, run.n, run.n_u = MODEL.kernels[index].call, n, MODEL.n_u
        run.c = <const double *>cnp.PyArray_DATA(context.c)
        run.w = free
        run.u = run.w + MODEL.n_work
        run.y = run.u + MODEL.n_u
        run.y_old = run.y + n
        run.f = run.y_old + n
        run.failure_state = run.f + n
        run.next = run.failure_state + n
        run.closed = run.w + MODEL.closed_at if closed and MODEL.closed_at else NULL
        run.K = run.next + n
        run.F = run.K + n * self.method.rows_K
        memcpy(run.y, cnp.PyArray_DATA(start), n * sizeof(double))
        memcpy(run.u, cnp.PyArray_DATA(context.u), MODEL.n_u * sizeof(double))
        run.atol = <const double *>cnp.PyArray_DATA(self.atol)
        run.rtol, run.max_step, run.h_abs = rtol, max_step, first_step
        run.t = run.t_old = t0
        run.t_bound, run.direction = t_bound, -1.0 if t_bound < t0 else 1.0
        self.listen(signals)
        eomgen_start(self.method, run)

    cdef listen(self, signals):
        cdef eomgen_signal *table
        cdef cnp.npy_intp bytes = MODEL.n_u * sizeof(eomgen_signal)
        if not signals:
            return
        memory = cnp.PyArray_ZEROS(1, &bytes, cnp.NPY_UINT8, 0)
        table = <eomgen_signal *>cnp.PyArray_DATA(<cnp.ndarray>memory)
        self.held.append(memory)
        for index, order, times, values in signals:
            pair = np.array(times, dtype=float), np.array(values, dtype=float, order="C")
            self.held.extend(pair)
            table[<int>index].n, table[<int>index].order = len(times), order
            table[<int>index].times = <const double *>cnp.PyArray_DATA(<cnp.ndarray>pair[0])
            table[<int>index].values = <const double *>cnp.PyArray_DATA(<cnp.ndarray>pair[1])
        self.run.signals = table

    def step(self):
        """Take one step; False if it would have to be too small."""
        return eomgen_step(self.method, &self.run) == 0

    def advance(self, long steps, t_eval=None, long done=0):
        """Take up to so many steps without the GIL.

        Returns
        -------
        status : int
            0 while under way, 1 at the end, negative if a step would have to be too small.
        times : (k,) array
            Of all steps; with t_eval, of those of t_eval[done:] that were reached.
        states : (k, n_x) array
        """
        cdef cnp.ndarray asked, times, states
        cdef cnp.npy_intp room
        cdef long n_eval = -1, stored = 0
        cdef int status
        cdef const double *wanted = NULL
        if t_eval is None:
            room = steps
        else:
            asked = np.ascontiguousarray(t_eval, dtype=float)
            n_eval, room, wanted = len(t_eval), len(t_eval) - done, <const double *>cnp.PyArray_DATA(asked)
        times, states = np.empty(room), rows(room, self.run.n)
        cdef double *T = <double *>cnp.PyArray_DATA(times)
        cdef double *X = <double *>cnp.PyArray_DATA(states)
        cdef long first = done
        with nogil:
            status = eomgen_advance(self.method, &self.run, steps, wanted, n_eval, &done, T, X, &stored)
        return status, (times[:stored] if t_eval is None else asked[first:done]), states[:stored]

    def state(self):
        """A copy of the state (n_x,)."""
        return copy(self.run.y, self.run.n)

    def interpolant(self):
        """The solution within the last step."""
        cdef Interpolant result = Interpolant.__new__(Interpolant)
        cdef int n = self.run.n
        eomgen_between(self.method, &self.run, self.run.t, self.run.K + n)  # forms the coefficients
        result.method, result.run, result.t_old, result.t = self.method, self.run, self.run.t_old, self.run.t
        cdef cnp.npy_intp length = n * (1 + self.method.rows_F)
        result.memory = cnp.PyArray_EMPTY(1, &length, cnp.NPY_DOUBLE, 0)
        cdef double *data = <double *>cnp.PyArray_DATA(result.memory)
        memcpy(data, self.run.y_old, n * sizeof(double))
        memcpy(data + n, self.run.F, n * self.method.rows_F * sizeof(double))
        result.run.y_old, result.run.F = data, data + n
        return result

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
    def failure(self):
        """(status, t, x) of the last evaluation that failed, or None."""
        if self.run.failure == 0:
            return None
        return self.run.failure, self.run.failure_time, copy(self.run.failure_state, self.run.n)


stepper = Stepper
