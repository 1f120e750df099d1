# Kernels: functions of the model, bound to parameters and inputs -> callables on arrays.

ctypedef object (*vectorcall)(object, PyObject *const *, size_t, PyObject *)

cdef enum:
    MOST = 7  # arguments of a kernel


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
    order : tuple of str
        Names of its arguments: the time t, states, p, u and out, and last a choice if it has one.
    required : int
        How many of these must be given.
    nan : bool
        At a recoverable failure (status > 0) remember it instead, and put NaN where an entry is no finite number, or
        everywhere if it is another failure.
    error : type
        Exception raised for arguments that do not fit.
    pick : array of int, optional
        Places of the result among the numbers of the kernel; all of them by default.
    choose : callable, optional
        Of the value of the choice -> the kernel with the arguments before it that is called instead; None: this one.
    load : callable, optional
        Of a kernel that is made when it is first called: gives the context of the model that has it, or the error.
    find : callable, optional
        ``find(*states, p=, u=, t=, out=)`` is called in place of a function of the model.

    Attributes
    ----------
    failure : tuple or None
        With ``nan``: (status, t, x) of the last failure. Assign None to forget it.
    """

    cdef vectorcall quick
    cdef const eomgen_model *table
    cdef eomgen_function call
    cdef const double *c
    cdef const double *u
    cdef int index, n_in, n_out, ndim
    cdef int n_states, n_order, required, at_t, at_p, at_u, at_out, at_choice  # arguments by their places; -1: none
    cdef int[3] at_states
    cdef bint long, tolerant
    cdef cnp.npy_intp[MAX_DIMENSIONS + 1] dims
    cdef object fail, error, choose, load, find
    cdef readonly object name, shape, nan
    cdef readonly tuple order
    cdef readonly Context context
    cdef Model model
    cdef str label  # what users call its state
    cdef cnp.ndarray pick
    cdef object last_failure

    def __cinit__(self, str name not None, Context context not None, shape, fail, tuple order not None, int required,
                  nan=False, error=ValueError, pick=None, choose=None, load=None, find=None):
        cdef int i
        self.quick = call_kernel
        self.name, self.fail, self.nan, self.error = name, fail, bool(nan), error
        self.order, self.required, self.tolerant, self.shape = order, required, nan, tuple(shape)
        self.choose, self.load, self.find, self.pick = choose, load, find, pick
        self.ndim, self.n_order = len(self.shape), len(order)
        if self.ndim > MAX_DIMENSIONS or self.n_order > MOST:
            raise error(f"kernel {name!r} has too many dimensions or arguments")
        self.at_choice = -1
        for i in range(self.n_order):
            if order[i] == "t":
                self.at_t = i
            elif order[i] == "p":
                self.at_p = i
            elif order[i] == "u":
                self.at_u = i
            elif order[i] == "out":
                self.at_out = i
            elif choose is not None and i == self.n_order - 1:
                self.at_choice = i
            else:
                self.at_states[self.n_states] = i
                self.n_states += 1
        for i in range(self.ndim):
            self.dims[i] = self.shape[i]
        self.label = order[self.at_states[0]]
        self.context, self.model = context, context.model
        if load is None and find is None:
            self.take(context)

    cdef int take(self, Context context) except -1:
        """The function of a model."""
        cdef cnp.npy_intp length = 1
        cdef int i
        self.context, self.model, self.table = context, context.model, context.model.table
        cdef const eomgen_kernel *kernel = self.model.kernel(self.name, self.error)
        self.index, self.n_in, self.n_out = kernel - self.table.kernels, kernel.n_in, kernel.n_out
        if self.n_states == 1:
            self.label = "q" if self.n_in == self.model.n_q else "x"
        self.c = <const double *>cnp.PyArray_DATA(context.c)
        self.u = <const double *>cnp.PyArray_DATA(context.u)
        for i in range(self.ndim):
            length *= self.dims[i]
        if length != (self.n_out if self.pick is None else self.pick.size):
            raise self.error(f"shape {self.shape} does not hold the {self.n_out} numbers of kernel {self.name!r}")
        counts = self.model.facts.get("operations", {}).get(self.name, {}).values()
        self.long = sum([count for count in counts if isinstance(count, (int, float))]) > LONG
        self.call = kernel.call
        return 0

    cdef int make(self) except -1:
        """What is left until the first call."""
        found = self.load()
        if isinstance(found, BaseException):
            raise found
        return self.take(found)

    @property
    def failure(self):
        with cython.critical_section(self):
            return self.last_failure

    @failure.setter
    def failure(self, value):
        with cython.critical_section(self):
            self.last_failure = value

    def __repr__(self):
        return f"<kernel {self.name} of {self.model.table.name.decode()}: {self.__signature__} -> {self.shape}>"

    @property
    def __signature__(self):
        """Names of the arguments as users know them, as Python's functions have it."""
        from inspect import Parameter, Signature

        defaults = [Parameter.empty] * self.required + [0.0 if x == "t" else None for x in self.order[self.required:]]
        return Signature([Parameter(self.argument(name), Parameter.POSITIONAL_OR_KEYWORD, default=default)
                          for name, default in zip(self.order, defaults)])

    cdef object argument(self, name):
        """What users call an argument."""
        return self.label if self.n_states == 1 and name == self.order[self.at_states[0]] else name

    def __call__(self, *args, **given):
        """Evaluate at states, (n,) or (n, k) for k states as columns, and times t, a float or (k,).

        p and u, (n,) or (n, k), replace the context's, a mapping those that it names; they are called parameters and
        inputs as well. out is a float64 array of the result's shape, ``shape`` or ``(*shape, k)``.
        wrt of a Jacobian is 'x', 'u' or 'p'; rows of constraints are 'independent' or 'all'.
        """
        return self.plainly(args, given)

    cdef object plainly(self, tuple args, dict given):
        """A call with arguments under any of their names; says what is wrong with them."""
        cdef PyObject *sorted[MOST]
        cdef dict named = dict(zip(self.order, args))
        cdef int i
        if self.call == NULL and self.find is None:
            self.make()
        what = f"{self.name}({', '.join([self.argument(name) for name in self.order[:self.required]])})"
        if len(args) > self.n_order:
            raise TypeError(f"{what} takes at most {self.n_order} positional arguments ({len(args)} given)")
        for name, value in given.items():
            if self.n_states == 1 and name == self.label:
                name = self.order[self.at_states[0]]
            if name in named:
                raise TypeError(f"{what} got multiple values for keyword argument '{name}'")
            if name in self.order:
                named[name] = value
            elif name not in ("parameters", "inputs"):
                raise TypeError(f"{what} got an unexpected keyword argument '{name}'")
        for name, other in (("p", "parameters"), ("u", "inputs")):
            if given.get(other) is not None:
                if named.get(name) is not None:
                    text = f"{name} and {other} are the same argument; give one of them"
                    raise fault(self.error, "EG-CONFLICT", text)
                named[name] = given[other]
        for i in range(self.n_order):
            name = self.order[i]
            sorted[i] = <PyObject *>named[name] if name in named else NULL
            if i < self.required and sorted[i] == NULL:
                raise TypeError(f"{what} takes at least {self.required} positional argument{'s' * (self.required > 1)} "
                                f"({len(args)} given)")
        return call_sorted(self, sorted)

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
        if not (self.pick is None and is_vector(x, self.n_in) and (u is None or is_vector(u, self.table.n_u))
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
        batch.lanes, batch.width, batch.parameters = NULL, 1, Piece(NULL, 0, 0, 0)
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
            p = doubles(p, "p", self.error, self.name, self.table.n_p)
            if cnp.PyArray_NDIM(<cnp.ndarray>p) == 2:
                held.append(self.read(p, self.table.n_p, "p", &batch.parameters, &columns))
            else:
                constants = self.model.constants(vector(p, self.table.n_p, "p", self.error), self.error)
                batch.c = <const double *>cnp.PyArray_DATA(<cnp.ndarray>constants)
        cdef cnp.ndarray picked = self.target(out, held, columns)
        cdef cnp.ndarray result = picked if self.pick is None else rows(self.n_out, 1 if columns < 0 else columns)
        cdef cnp.npy_intp length_of_all = self.table.n_work + self.n_in + self.n_out + self.table.n_u
        cdef cnp.npy_intp plain = length_of_all
        cdef const eomgen_lanes *lanes
        if columns >= 0 and has_offer(self.model.offers):
            self.wait_for_lanes(columns)
        lanes = seen_lanes(self.model.lanes)
        if columns >= 0 and lanes != NULL and lanes.kernels[self.index] != NULL:
            batch.lanes, batch.width = lanes.kernels[self.index], lanes.width
            length_of_all += WIDEST + lanes.width * (plain + 1 + self.table.n_const)
        cdef cnp.npy_intp before_c = length_of_all
        if batch.parameters.n:
            length_of_all += batch.width * self.table.n_const + self.table.n_p
        cdef cnp.ndarray heap = cnp.PyArray_EMPTY(1, &length_of_all, cnp.NPY_DOUBLE, 0)
        batch.w = <double *>cnp.PyArray_DATA(heap)
        batch.columns = 1 if columns < 0 else columns
        batch.x, batch.y = batch.w + self.table.n_work, batch.w + self.table.n_work + self.n_in
        batch.u = batch.y + self.n_out
        batch.side = batch.w + plain
        batch.column_c = batch.w + before_c
        batch.side += (64 - <uintptr_t>batch.side % 64) % 64 // sizeof(double)
        at_once = columns > 1 and batch.parameters.n == 0 and self.model.functions is not None and self.name in self.model.functions.blocks
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
            given = p if batch.parameters.n == 0 else (<object>p)[:, failed]
            given = () if p is None and u is None else (given, copy(batch.u, self.table.n_u))
            self.report(status, now, copy(batch.x, self.n_in), given)
        if self.pick is not None:
            (<object>picked)[...] = (<object>result)[self.pick].reshape((<object>picked).shape)
        if out is not None and out is not picked:
            out[...] = picked
        return picked if out is None else out

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
        """Values by name as an array, the others as bound, where who requested the kernel knows names."""
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


cdef inline bint sort_arguments(Kernel kernel, PyObject *const *given, Py_ssize_t n, PyObject *names,
                                PyObject **sorted) noexcept:
    """Put arguments in order, NULL where there is none; whether that was easy."""
    cdef Py_ssize_t i, k
    cdef PyObject *name
    if n > kernel.n_order:
        return False
    for i in range(kernel.n_order):
        sorted[i] = given[i] if i < n else NULL
    if names != NULL:
        for i in range(length_of(names)):
            name, k = item_of(names, i), 0
            while k < kernel.n_order and item_of(<PyObject *>kernel.order, k) != name:  # names are interned
                k += 1
            if k == kernel.n_order or sorted[k] != NULL:
                return False
            sorted[k] = given[n + i]
    for i in range(n, kernel.required):
        if sorted[i] == NULL:
            return False
    return True


cdef inline object given_or_none(PyObject *value):
    return None if value == NULL else <object>value


cdef object call_sorted(Kernel kernel, PyObject **a):
    """A call with arguments in order, NULL where there is none."""
    cdef int i, n_v
    t = 0.0 if a[kernel.at_t] == NULL else <object>a[kernel.at_t]
    p, u, out = given_or_none(a[kernel.at_p]), given_or_none(a[kernel.at_u]), given_or_none(a[kernel.at_out])
    if kernel.at_choice >= 0 and a[kernel.at_choice] != NULL:
        chosen = kernel.choose(<object>a[kernel.at_choice])
        if chosen is not None:  # the arguments before the choice are its own
            return call_sorted(<Kernel?>chosen, a)
    if kernel.call == NULL:
        if kernel.find is not None:
            states = [<object>a[kernel.at_states[i]] for i in range(kernel.n_states)]
            return kernel.find(*states, t=t, p=p, u=u, out=out)
        kernel.make()
    if kernel.n_states == 1:
        return kernel.evaluate(t, <object>a[kernel.at_states[0]], p, u, out)
    n_v = kernel.model.n_v
    lengths = (kernel.n_in - 2 * n_v, n_v, n_v)
    values = [(kernel.order[kernel.at_states[i]], lengths[i], <object>a[kernel.at_states[i]]) for i in range(3)]
    return kernel.general(t, values, p, u, out)


cdef object call_kernel(object any, PyObject *const *given, size_t flagged, PyObject *names):
    cdef Kernel kernel = <Kernel>any
    cdef PyObject *sorted[MOST]
    cdef Py_ssize_t i, n = count_of(flagged)
    if names == NULL and n == kernel.required and kernel.n_states == 1 and kernel.call != NULL:
        return kernel.evaluate(0.0 if kernel.at_t >= n else <object>given[kernel.at_t],
                               <object>given[kernel.at_states[0]], None, None, None)
    if sort_arguments(kernel, given, n, names, sorted):
        return call_sorted(kernel, sorted)
    cdef tuple words = () if names == NULL else <tuple>names
    return kernel.plainly(tuple([<object>given[i] for i in range(n)]),
                          {words[i]: <object>given[n + i] for i in range(len(words))})


cdef Py_ssize_t offset_of_quick(object any):
    """Where in a kernel its quick call is kept; of the object nothing is read."""
    return <char *>&(<Kernel>any).quick - <char *><PyObject *>any


kernel = quick_type(Kernel, b"_native.Kernel", offset_of_quick(Kernel))
