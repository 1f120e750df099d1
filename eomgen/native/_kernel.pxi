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


# Calls: what Python hands over -> the arguments of a kernel. Keyword arguments of a plain call would go into a dict first,
# which takes longer than small kernels do; CPython's vectorcall hands them over as they are.

cdef extern from *:
    """
    #include <structmember.h>
    /* A type of kernel whose instances keep their quick call at an offset: the type itself, or where CPython's types are
       closed to us (the limited API) one derived from it. */
    static PyObject *eomgen_quick_type(PyObject *type, const char *name, Py_ssize_t offset)
    {
    #ifdef Py_LIMITED_API
        PyMemberDef members[] = {{"__vectorcalloffset__", T_PYSSIZET, offset, READONLY, NULL}, {NULL, 0, 0, 0, NULL}};
        PyType_Slot slots[] = {{Py_tp_members, members}, {0, NULL}};
        PyType_Spec spec = {name, 0, 0, Py_TPFLAGS_DEFAULT | 1UL << 11 /* Py_TPFLAGS_HAVE_VECTORCALL */, slots};
        PyObject *bases = PyTuple_Pack(1, type), *made = bases == NULL ? NULL : PyType_FromSpecWithBases(&spec, bases);
        Py_XDECREF(bases);
        return made;
    #else
        (void)name;
        ((PyTypeObject *)type)->tp_vectorcall_offset = offset;
        ((PyTypeObject *)type)->tp_flags |= Py_TPFLAGS_HAVE_VECTORCALL;
        Py_INCREF(type);
        return type;
    #endif
    }
    #ifdef Py_LIMITED_API
    #define EOMGEN_LENGTH PyTuple_Size
    #define EOMGEN_ITEM PyTuple_GetItem
    #else /* 3 ns of a call with keywords less */
    #define EOMGEN_LENGTH PyTuple_GET_SIZE
    #define EOMGEN_ITEM PyTuple_GET_ITEM
    #endif
    #define EOMGEN_COUNT_OF(flagged) ((Py_ssize_t)((flagged) & ~((size_t)1 << (8 * sizeof(size_t) - 1))))
    """
    object quick_type "eomgen_quick_type"(object, const char *, Py_ssize_t)
    Py_ssize_t length_of "EOMGEN_LENGTH"(PyObject *)
    PyObject *item_of "EOMGEN_ITEM"(PyObject *, Py_ssize_t)
    Py_ssize_t count_of "EOMGEN_COUNT_OF"(size_t)  # what PyVectorcall_NARGS does

cdef extern from "Python.h":
    ctypedef struct PyTypeObject
    void *PyType_GetSlot(PyTypeObject *, int)
    const int Py_tp_call
    PyTypeObject *Py_TYPE(object)

ctypedef object (*ternary)(object, object, object)


cdef object one_of(object error, str name, object given, str other, object same):
    """An argument that has two names."""
    if same is None:
        return given
    if given is not None:
        raise fault(error, "EG-CONFLICT", f"{name} and {other} are the same argument; give one of them")
    return same


cdef class Timed(Kernel):
    """A kernel of time and state: ``f(t, x, p=None, u=None, out=None)``."""

    def __call__(self, t, x, p=None, u=None, out=None, wrt=None, parameters=None, inputs=None):
        """Evaluate at time t, a float or (k,), and state x, (n,) or (n, k) for k states as columns.

        p (n_p,) and u, (n_u,) or (n_u, k), replace the context's, a mapping those that it names; they are called
        parameters and inputs as well. out is a float64 array of the result's shape, ``shape`` or ``(*shape, k)``.
        ``wrt`` is for a jacobian: 'x', 'u' or 'p', by which it is.
        """
        p, u = one_of(self.error, "p", p, "parameters", parameters), one_of(self.error, "u", u, "inputs", inputs)
        if wrt is not None:
            if self.others is None:
                raise TypeError(f"{self.name} has no argument wrt")
            if wrt not in ("x", "u", "p"):
                raise self.error(f"wrt must be 'x' (the state), 'u' (the inputs) or 'p' (the parameters), not {wrt!r}")
            if wrt != "x":
                return self.others(f"{'input' if wrt == 'u' else 'parameter'}_jacobian")(t, x, p, u, out)
        return self.evaluate(t, x, p, u, out)


cdef class State(Kernel):
    """A kernel of the state alone: ``f(x, p=None, u=None, out=None, t=0.0)``."""

    def __call__(self, x, p=None, u=None, out=None, t=0.0, parameters=None, inputs=None):
        """Evaluate at state x; arguments as for Timed."""
        p, u = one_of(self.error, "p", p, "parameters", parameters), one_of(self.error, "u", u, "inputs", inputs)
        return self.evaluate(t, x, p, u, out)


cdef class Motion(Kernel):
    """A kernel of coordinates, velocities, accelerations: ``f(q, v, a, p=None, u=None, out=None, t=0.0)``."""

    def __call__(self, q=None, v=None, a=None, p=None, u=None, out=None, t=0.0, parameters=None, inputs=None):
        """Evaluate at q (n_q,), v and a (n_v,), or with a last axis k; other arguments as for Timed."""
        if q is None or v is None or a is None:
            raise TypeError(f"{self.name}(q, v, a) takes at least 3 positional arguments")
        p, u = one_of(self.error, "p", p, "parameters", parameters), one_of(self.error, "u", u, "inputs", inputs)
        cdef int n_v = self.model.n_v
        return self.general(t, [("q", self.n_in - 2 * n_v, q), ("v", n_v, v), ("a", n_v, a)], p, u, out)


cdef enum:
    MOST = 5  # arguments of a quick call

cdef tuple OF_TIMED = tuple(map(intern, ("t", "x", "p", "u", "out")))
cdef tuple OF_STATE = tuple(map(intern, ("x", "p", "u", "out", "t")))


cdef inline bint sort_arguments(tuple order, PyObject *const *given, Py_ssize_t n, PyObject *names,
                                PyObject **sorted) noexcept:
    """Put arguments in order, NULL where there is none; whether that was easy."""
    cdef Py_ssize_t i, k
    cdef PyObject *name
    if n > MOST:
        return False
    for i in range(MOST):
        sorted[i] = given[i] if i < n else NULL
    if names != NULL:
        for i in range(length_of(names)):
            name, k = item_of(names, i), 0
            while k < MOST and item_of(<PyObject *>order, k) != name:  # names in a program are interned
                k += 1
            if k == MOST or sorted[k] != NULL:
                return False
            sorted[k] = given[n + i]
    return True


cdef inline object given_or_none(PyObject *value):
    return None if value == NULL else <object>value


cdef object call_timed(object kernel, PyObject *const *given, size_t flagged, PyObject *names):
    cdef PyObject *a[MOST]
    if sort_arguments(OF_TIMED, given, count_of(flagged), names, a) and a[0] != NULL and a[1] != NULL:
        return (<Timed>kernel).evaluate(
            <object>a[0], <object>a[1], given_or_none(a[2]), given_or_none(a[3]), given_or_none(a[4]))
    return call_plainly(kernel, given, count_of(flagged), names)


cdef object call_state(object kernel, PyObject *const *given, size_t flagged, PyObject *names):
    cdef PyObject *a[MOST]
    if sort_arguments(OF_STATE, given, count_of(flagged), names, a) and a[0] != NULL:
        return (<State>kernel).evaluate(
            0.0 if a[4] == NULL else <object>a[4], <object>a[0], given_or_none(a[1]), given_or_none(a[2]),
            given_or_none(a[3]))
    return call_plainly(kernel, given, count_of(flagged), names)


cdef object call_plainly(object kernel, PyObject *const *given, Py_ssize_t n, PyObject *names):
    """By ``__call__``, which says what is wrong with the arguments."""
    cdef Py_ssize_t i
    cdef tuple words = () if names == NULL else <tuple>names
    try:
        return (<ternary>PyType_GetSlot(Py_TYPE(kernel), Py_tp_call))(
            kernel, tuple([<object>given[i] for i in range(n)]),
            {words[i]: <object>given[n + i] for i in range(len(words))})
    except TypeError as error:
        _, own, fault = str(error).partition("__call__()")
        if not own:
            raise
        words = ("t", "x") if isinstance(kernel, Timed) else ((<Kernel>kernel).label,)
        raise TypeError(f"{kernel.name}({', '.join(words)}){fault}") from None


cdef int set_quick_call(Kernel kernel) except -1:
    """What CPython calls in place of ``__call__``."""
    kernel.quick = NULL
    if isinstance(kernel, Timed):
        kernel.quick = call_timed
    elif isinstance(kernel, State):
        kernel.quick = call_state


cdef Py_ssize_t offset_of_quick(object any):
    """Where in a kernel its quick call is kept; of the object nothing is read."""
    return <char *>&(<Kernel>any).quick - <char *><PyObject *>any


timed = quick_type(Timed, b"_native.Timed", offset_of_quick(Timed))
state = quick_type(State, b"_native.State", offset_of_quick(State))
