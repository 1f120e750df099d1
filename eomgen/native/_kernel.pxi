# Kernels: functions of the model, bound to parameters and inputs -> callables on arrays.

ctypedef object (*vectorcall)(object, PyObject *const *, size_t, PyObject *)


cdef class Kernel:
    """A kernel of the model, bound to a context; call it with arrays.

    Parameters
    ----------
    name : str
        Name of the kernel, one of ``names``.
    context : Context
        Parameters and inputs of the model, used when a call gives none.
    shape : tuple of int
        Shape of the result for one state.
    fail : callable
        Called as ``fail(name, status, t, x)`` when the kernel fails, then p and u if any was given; it must raise.
    nan : bool
        At a recoverable failure (status > 0) remember it instead, and put NaN where an entry is no finite number, or
        everywhere if it is another failure.
    error : type
        Exception raised for arguments that do not fit.

    Attributes
    ----------
    others : callable or None
        Of a jacobian: ``others(name)`` gives the kernel that differentiates by something else.
    failure : tuple or None
        With ``nan``: (status, t, x) of the last failure. Assign None to forget it.
    """

    cdef vectorcall quick
    cdef const eomgen_model *table
    cdef eomgen_function call
    cdef const double *c
    cdef const double *u
    cdef int index, n_in, n_out, ndim
    cdef bint long, tolerant
    cdef cnp.npy_intp[MAX_DIMENSIONS + 1] dims
    cdef object fail, error
    cdef readonly object name, shape, nan
    cdef readonly Context context
    cdef Model model
    cdef str label  # what users call its state
    cdef object last_failure
    cdef public object others

    def __cinit__(self, str name not None, Context context not None, shape, fail, nan=False, error=ValueError):
        set_quick_call(self)
        self.name, self.context, self.fail, self.nan, self.error = name, context, fail, bool(nan), error
        self.model, self.table = context.model, context.model.table
        cdef const eomgen_kernel *kernel = self.model.kernel(name, error)
        self.index, self.call, self.n_in, self.n_out = kernel - self.table.kernels, kernel.call, kernel.n_in, kernel.n_out
        self.label = "q" if self.n_in == self.model.n_q else "x"
        self.c = <const double *>cnp.PyArray_DATA(context.c)
        self.u = <const double *>cnp.PyArray_DATA(context.u)
        self.tolerant = nan
        self.shape = tuple(shape)
        self.ndim = len(self.shape)
        if self.ndim > MAX_DIMENSIONS or np.prod(self.shape, dtype=int) != self.n_out:
            raise error(f"shape {self.shape} does not hold the {self.n_out} numbers of kernel {name!r}")
        for i in range(self.ndim):
            self.dims[i] = self.shape[i]
        counts = self.model.facts.get("operations", {}).get(name, {}).values()
        self.long = sum([count for count in counts if isinstance(count, (int, float))]) > LONG

    @property
    def failure(self):
        with cython.critical_section(self):
            return self.last_failure

    @failure.setter
    def failure(self, value):
        with cython.critical_section(self):
            self.last_failure = value

    def __repr__(self):
        return f"<{type(self).__name__} kernel {self.name} of {self.table.name.decode()}: ({self.n_in},) -> {self.shape}>"

    cdef inline bint is_target(self, object out, const double *x) noexcept:
        """Whether the kernel can write into out: float64, right shape, contiguous, apart from x."""
        if not (cnp.PyArray_Check(out) and cnp.PyArray_TYPE(<cnp.ndarray>out) == cnp.NPY_DOUBLE
                and cnp.PyArray_NDIM(<cnp.ndarray>out) == self.ndim and cnp.PyArray_ISCARRAY(<cnp.ndarray>out)
                and memcmp(cnp.PyArray_DIMS(<cnp.ndarray>out), self.dims, self.ndim * sizeof(cnp.npy_intp)) == 0):
            return False
        cdef const double *data = <const double *>cnp.PyArray_DATA(<cnp.ndarray>out)
        return data >= x + self.n_in or x >= data + self.n_out

    cdef object evaluate(self, object t, object x, object p, object u, object out):
        """The fast way for contiguous float64 vectors, one state; all else goes the general way."""
        cdef double[STACK] stack
        cdef double *w = stack
        cdef double *data
        cdef const double *state
        cdef const double *inputs = self.u
        cdef const double *constants = self.c
        cdef double now
        cdef cnp.npy_intp n_work = self.table.n_work
        cdef int status, i
        if not (is_vector(x, self.n_in) and (u is None or is_vector(u, self.table.n_u))
                and (p is None or is_vector(p, self.table.n_p))):
            return self.general(t, [(self.label, self.n_in, x)], p, u, out)
        now = moment(t, "t", self.error, self.name)
        state = <const double *>cnp.PyArray_DATA(<cnp.ndarray>x)
        if out is None:
            out = cnp.PyArray_EMPTY(self.ndim, self.dims, cnp.NPY_DOUBLE, 0)
        elif not self.is_target(out, state):
            return self.general(t, [(self.label, self.n_in, x)], p, u, out)
        data = <double *>cnp.PyArray_DATA(<cnp.ndarray>out)
        if u is not None:
            inputs = <const double *>cnp.PyArray_DATA(<cnp.ndarray>u)
            if data < inputs + self.table.n_u and inputs < data + self.n_out:
                return self.general(t, [(self.label, self.n_in, x)], p, u, out)
        if p is not None:
            n_work += self.table.n_const
        if n_work > STACK:
            heap = self.context.take_work()
            w = <double *>cnp.PyArray_DATA(<cnp.ndarray>heap)
        if p is not None:
            fill_constants(self.model, <cnp.ndarray>p, w, self.error)
            constants = w
            w += self.table.n_const
        if self.tolerant:
            for i in range(self.n_out):
                data[i] = NAN
        if self.long:
            with nogil:
                status = self.call(now, state, inputs, constants, data, w)
        else:
            status = self.call(now, state, inputs, constants, data, w)
        tell_raised()
        if status != 0:
            for i in range(self.n_out):
                data[i] = entry(data[i], status)
            given = () if p is None and u is None else (p, copy(inputs, self.table.n_u))
            self.report(status, now, copy(state, self.n_in), given)
        elif n_work > STACK:
            self.context.leave_work(heap)
        return out

    cdef int report(self, int status, double t, cnp.ndarray x, tuple given) except -1:
        """Remember a recoverable failure where NaN is wanted, else raise; `given` has p and u of the call, if any."""
        if not self.tolerant or status < 0:
            self.fail(self.name, status, t, x, *given)
            raise RuntimeError(f"kernel {self.name!r} failed with status {status} at t = {t}")
        with cython.critical_section(self):
            self.last_failure = (status, t, x)

    cdef object general(self, object t, list values, object p, object u, object out):
        """Any arrays: values are (label, length, array_like) in the order the kernel wants them, at most three."""
        cdef Batch batch
        cdef cnp.npy_intp columns = -2, failed = -1
        cdef int i, status = 0
        cdef double now = 0
        cdef list held = []
        p, u = self.by_name("p", p, self.context.p), self.by_name("u", u, self.context.u)
        batch.table, batch.call, batch.c, batch.nan = self.table, self.call, self.c, self.tolerant
        batch.n_pieces, batch.n_in, batch.n_out = len(values), self.n_in, self.n_out
        batch.lanes = NULL
        for i in range(batch.n_pieces):
            label, length, value = values[i]
            held.append(self.read(value, length, label, &batch.pieces[i], &columns))
        batch.time = Piece(<char *>&now, 1, 0, 0)
        if not isinstance(t, (float, int)):
            t = doubles(t, "t", self.error, self.name, SCALAR)
        if cnp.PyArray_Check(t) and cnp.PyArray_NDIM(<cnp.ndarray>t) > 0:
            if cnp.PyArray_NDIM(<cnp.ndarray>t) > 1 or cnp.PyArray_DIM(<cnp.ndarray>t, 0) != columns:
                raise self.error(f"t of {self.name} must be a number or have shape (k,), not {t.shape}")
            held.append(t)
            batch.time = Piece(cnp.PyArray_BYTES(<cnp.ndarray>t), 1, 0, cnp.PyArray_STRIDE(<cnp.ndarray>t, 0))
        else:
            now = moment(t, "t", self.error, self.name)
        batch.inputs = Piece(<char *>self.u, self.table.n_u, sizeof(double), 0)
        if u is not None:
            held.append(self.read(u, self.table.n_u, "u", &batch.inputs, &columns))
        if p is not None:
            constants = self.model.constants(vector(p, self.table.n_p, "p", self.error), self.error)
            batch.c = <const double *>cnp.PyArray_DATA(<cnp.ndarray>constants)
        cdef cnp.ndarray result = self.target(out, held, columns)
        cdef cnp.npy_intp length_of_all = self.table.n_work + self.n_in + self.n_out + self.table.n_u
        cdef cnp.npy_intp plain = length_of_all
        cdef const eomgen_lanes *lanes
        if columns >= 0 and has_offer(self.model.offers):
            self.wait_for_lanes(columns)
        lanes = seen_lanes(self.model.lanes)
        if columns >= 0 and lanes != NULL and lanes.kernels[self.index] != NULL:
            batch.lanes, batch.width = lanes.kernels[self.index], lanes.width
            length_of_all += WIDEST + lanes.width * (plain + 1 + self.table.n_const)
        cdef cnp.ndarray heap = cnp.PyArray_EMPTY(1, &length_of_all, cnp.NPY_DOUBLE, 0)
        batch.w = <double *>cnp.PyArray_DATA(heap)
        batch.columns = 1 if columns < 0 else columns
        batch.x, batch.y = batch.w + self.table.n_work, batch.w + self.table.n_work + self.n_in
        batch.u = batch.y + self.n_out
        batch.side = batch.w + plain
        batch.side += (64 - <uintptr_t>batch.side % 64) % 64 // sizeof(double)
        at_once = columns > 1 and self.model.functions is not None and self.name in self.model.functions.blocks
        if at_once:
            failed = self.call_columns(&batch, result, &status)
        elif self.long or columns > 1:
            with nogil:
                failed = evaluate(&batch, <double *>cnp.PyArray_DATA(result), &status)
        else:
            failed = evaluate(&batch, <double *>cnp.PyArray_DATA(result), &status)
        tell_raised()
        if failed >= 0:
            now = load(&batch, failed)
            given = () if p is None and u is None else (p, copy(batch.u, self.table.n_u))
            self.report(status, now, copy(batch.x, self.n_in), given)
        if out is not None and out is not result:
            out[...] = result
        return result if out is None else out

    cdef cnp.npy_intp call_columns(self, const Batch *batch, cnp.ndarray result, int *status) except -2:
        """Evaluate all columns at once by the model's Python function; those that are not finite again, one by one."""
        cdef cnp.npy_intp failed = -1, j
        cdef int code
        try:
            call_at_once(self.model.functions.blocks[self.name][0], batch, result)
        except tuple(self.model.functions.codes):
            pass
        for j in np.flatnonzero(~np.isfinite(result.reshape(batch.n_out, batch.columns)).all(axis=0)):
            code = call_one(batch, j, <double *>cnp.PyArray_DATA(result))
            if code != 0 and (failed < 0 or code < 0):
                failed, status[0] = j, code
            if code < 0 or (code != 0 and not batch.nan):
                break
        return failed

    cdef object by_name(self, str label, object given, object bound):
        """Values by name as an array, the others as bound, where who asked for the kernel knows names."""
        if given is not None and not isinstance(given, np.ndarray) and hasattr(self.fail, "vector"):
            return self.fail.vector(label, given, bound)
        return given

    cdef int wait_for_lanes(self, cnp.npy_intp columns) except -1:
        """Count columns that lanes could take, and have the lanes made when there were many."""
        if self.name in self.model.in_lanes and count_columns(self.model.batched, columns) >= MANY:
            self.model.take_lanes(self.name)
        return 0

    cdef cnp.ndarray read(self, object value, cnp.npy_intp n, str label, Piece *piece, cnp.npy_intp *columns):
        """Describe an input of shape (n,) or (n, k) by a piece; columns is k, -1 for a vector, -2 while unknown."""
        cdef cnp.ndarray array = doubles(value, label, self.error, self.name, n)
        cdef cnp.npy_intp k = cnp.PyArray_DIM(array, 1) if array.ndim == 2 else -1
        if columns[0] == -2:
            columns[0] = k
        if array.ndim not in (1, 2) or cnp.PyArray_DIM(array, 0) != n or k not in (-1, columns[0]):
            batch = "k" if columns[0] < 0 else columns[0]
            raise self.error(f"{called(label, self.name)} must have shape ({n},) or ({n}, {batch}), "
                             f"not {(<object>array).shape}")
        piece.data, piece.n, piece.row = cnp.PyArray_BYTES(array), n, cnp.PyArray_STRIDE(array, 0)
        piece.column = cnp.PyArray_STRIDE(array, 1) if k >= 0 else 0
        return array

    cdef cnp.ndarray target(self, object out, list held, cnp.npy_intp columns):
        """Where the kernel writes: out itself if it is contiguous and apart from the inputs, else a new array."""
        cdef cnp.npy_intp[MAX_DIMENSIONS + 1] dims = self.dims
        cdef int ndim = self.ndim
        if columns >= 0:
            dims[ndim] = columns
            ndim += 1
        if out is not None:
            shape = tuple([dims[i] for i in range(ndim)])
            if not isinstance(out, np.ndarray) or out.dtype != np.float64 or out.shape != shape:
                given = f"{out.dtype} array of shape {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
                raise self.error(f"out of {self.name} must be a float64 array of shape {shape}, not {given}")
            if not out.flags.writeable:
                raise self.error(f"out of {self.name} is read-only")
            if out.size and 0 in [step for step, n in zip(out.strides, out.shape) if n > 1]:
                raise self.error(f"out of {self.name} has strides {out.strides}: several of its entries are one number in memory")
            if out.flags.carray and not any([np.may_share_memory(out, array) for array in held]):
                return out
        return cnp.PyArray_EMPTY(ndim, dims, cnp.NPY_DOUBLE, 0)


include "_calls.pxi"

timed = quick_type(Timed, b"_native.Timed", offset_of_quick(Timed))
state = quick_type(State, b"_native.State", offset_of_quick(State))
