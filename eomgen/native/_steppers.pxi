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


cdef class Interpolant:
    """The solution within one step: ``f(t)`` for t (k,) gives (n, k), for one number (n,)."""

    cdef eomgen_run run
    cdef const eomgen_method *method
    cdef cnp.ndarray memory
    cdef readonly double t_old, t

    def __call__(self, t):
        cdef cnp.ndarray flat = cnp.PyArray_GETCONTIGUOUS(doubles(t, "t", ValueError)), result
        cdef cnp.npy_intp k = cnp.PyArray_SIZE(flat), i, n = self.run.n
        cdef int j
        cdef double *at = <double *>cnp.PyArray_DATA(flat)
        cdef cnp.ndarray state = cnp.PyArray_EMPTY(1, &n, cnp.NPY_DOUBLE, 0)  # of this call: threads may share the object
        cdef double *y = <double *>cnp.PyArray_DATA(state)
        cdef double *out
        if cnp.PyArray_NDIM(flat) == 0:
            self.method.interpolate(&self.run, at[0], y)
            return state
        result = rows(n, k)
        out = <double *>cnp.PyArray_DATA(result)
        for i in range(k):
            self.method.interpolate(&self.run, at[i], y)
            for j in range(n):
                out[j * k + i] = y[j]
        return result

    @property
    def t_min(self):
        return min(self.t_old, self.t)

    @property
    def t_max(self):
        return max(self.t_old, self.t)


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
        Of a Journey; then the first evaluation is left to it, and each step starts on the constraints.

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
        cdef cnp.npy_intp length = table.n_work + table.n_u + n * (5 + self.method.rows_K + self.method.rows_F)
        if self.method.squares > 0:
            self.run.jacobian = model.kernel("jacobian").call
        if "meeting_time" in model.places:
            self.run.meeting = model.kernel("meeting_time").call
        self.run.n_q, self.run.n_beside = model.n_q, n - rhs.n_in
        if method != "called" and n != rhs.n_in:
            raise ValueError(f"y0 must have shape ({rhs.n_in},)")
        cdef const eomgen_series *series = seen_series(model.series)
        self.run.series = series
        length += eomgen_further(self.method, n, series)
        self.memory = cnp.PyArray_ZEROS(1, &length, cnp.NPY_DOUBLE, 0)
        cdef double *free = <double *>cnp.PyArray_DATA(self.memory)
        cdef eomgen_run *run = &self.run
        run.rhs, run.n, run.n_u = rhs.call, n, table.n_u
        run.c = <const double *>cnp.PyArray_DATA(context.c)
        run.w = free
        run.u = run.w + table.n_work
        run.y = run.u + table.n_u
        run.y_old = run.y + n
        run.f = run.y_old + n
        run.failure_state = run.f + n
        run.next = run.failure_state + n
        run.closed = run.w + table.closed_at if plan is not None and table.closed_at else NULL
        run.K = run.next + n
        run.F = run.K + n * self.method.rows_K + eomgen_further(self.method, n, series)
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
        cdef Interpolant result = Interpolant.__new__(Interpolant)
        cdef int n = self.run.n
        eomgen_between(self.method, &self.run, self.run.t, self.run.next)  # forms the coefficients
        tell_raised()
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


include "_journeys.pxi"
include "_called.pxi"
include "_integrators.pxi"
