# Models whose functions are Python functions of NumPy arrays, as those of target numpy. Each is a C function by ctypes,
# so that solvers, steppers and kernels take it as they take compiled ones.

cdef extern from "eomgen_solvers.h" nogil:
    """
    #include <stddef.h>
    #include <string.h>
    /* Puts a model's table together: numbers and tables as eom_model has them, in its order. */
    enum {
        N_NUMBERS = (int)(offsetof(eom_model, order) / sizeof(int)),
        N_TABLES = (int)((offsetof(eom_model, quaternion) - offsetof(eom_model, order)) / sizeof(int *)),
        N_FUNCTIONS = (int)((sizeof(eom_model) - offsetof(eom_model, scales)) / sizeof(eomgen_function))
    };
    static void eomgen_fill(eom_model *m, const int *numbers, const int *const *tables, const int *quaternion,
                            const short *const *places, const int *areas, const eomgen_function *functions)
    {
        memset(m, 0, sizeof *m);
        memcpy(&m->n_v, numbers, N_NUMBERS * sizeof *numbers);
        memcpy(&m->order, tables, N_TABLES * sizeof *tables);
        m->quaternion = (const int (*)[2])quaternion;
        m->place = (const short (*)[2])places[0], m->relax = (const short (*)[2])places[1];
        memcpy(m->areas, areas, sizeof m->areas);
        memcpy(&m->scales, functions, N_FUNCTIONS * sizeof *functions);
    }
    static const eom_solvers eom_table = {
        EOM_LAYOUT, eom_project, eom_rhs, eom_outputs, eom_jacobian, eom_input_jacobian, eom_parameter_jacobian, eom_mass_matrix,
        eom_embedded_mass_matrix, eom_kinematics, eom_dae_jacobian, eom_inverse_dynamics_derivatives, eom_finish_rhs
    };
    #define EOM_SOLVERS (&eom_table.project)
    """
    enum: AREAS
    enum: N_NUMBERS
    enum: N_TABLES
    enum: N_FUNCTIONS
    ctypedef struct eom_model:
        int n_v, n_c, n_quaternions, n_places, n_relaxed
    ctypedef struct eom_solvers:
        int layout
    ctypedef struct eom_at:
        const eom_model *m
        double t
        const double *u
        const double *c
        double *w
    void eomgen_fill(eom_model *, const int *, const int **, const int *, const short **, const int *,
                     const eomgen_function *)
    const eom_solvers eom_table
    ctypedef int (*eom_solver)(const eom_at *, const double *, double *)
    const eom_solver *EOM_SOLVERS

cdef tuple SOLVED = (  # in the order of eom_solvers
    "project", "rhs", "outputs", "jacobian", "input_jacobian", "parameter_jacobian", "mass_matrix",
    "embedded_mass_matrix", "kinematics", "dae_jacobian", "inverse_dynamics_derivatives",
)


solvers = <uintptr_t>&eom_table  # for the models that a session opens


cdef inline double *numbers_at(object address) noexcept:
    """An argument of a callback, whose null is None."""
    return NULL if address is None else <double *><uintptr_t>address


cdef int require(str what, tuple lengths, tuple wanted) except -1:
    """Compare lengths that C cannot know."""
    if lengths != wanted:
        raise ValueError(f"{what} must be {wanted}, not {lengths}")
    return 0


cdef int check_numbers(const double *out, int n) noexcept:
    cdef int i
    for i in range(n):
        if not isfinite(out[i]):
            return EOMGEN_NON_FINITE
    return 0


cdef dict RAISED = {}  # by functions in Python that C called, in each thread: what is no failure of an evaluation


cdef inline int tell_raised() except -1:
    """Raise what functions in Python raised while C ran in this thread."""
    if RAISED and (error := RAISED.pop(get_ident(), None)) is not None:
        raise error
    return 0


cdef class Functions:
    """The table of a model whose functions are Python's.

    Parameters
    ----------
    name, metadata : str
    sizes : dict of str to int
        n_p, n_u, n_const, n_work, closed_at.
    kernels : list of (name, n_in, n_out)
        Each either one of the blocks or solved for by them.
    blocks : dict of str to (callable, n_in, n_out)
        ``f(t, x, u, c) -> out``, x (n_in,) or (n_in, k), out (n_out,) or (n_out, k).
    precompute : callable
        ``p -> c``
    equations : dict or None
        numbers, tables, quaternions, places, areas, functions (their blocks' names) of eom_model.
    codes : dict of type to int
        Exceptions of blocks, and the status that each stands for.

    Raises
    ------
    ValueError
        Lengths that do not fit the layout of eom_model, or each other.

    Attributes
    ----------
    address : int
        Of the eomgen_model.
    blocks : dict
    """

    cdef eomgen_model table
    cdef eom_model equations
    cdef list held
    cdef readonly dict blocks
    cdef dict codes
    cdef object compute

    def __init__(self, str name, str metadata, dict sizes, list kernels, dict blocks, precompute, equations, dict codes):
        import ctypes
        number, place = ctypes.c_double, ctypes.c_void_p
        function = ctypes.CFUNCTYPE(ctypes.c_int, number, *[place] * 5)
        self.blocks, self.codes, self.compute = blocks, codes, precompute
        self.table.n_u, self.table.n_const = sizes["n_u"], sizes["n_const"]
        for of, n_in, n_out in kernels:
            if of in blocks:
                require(f"lengths of kernel {of}", tuple(blocks[of][1:]), (n_in, n_out))
        calls = {of: function(Call(self, *blocks[of])) for of in blocks}
        starts = {of: ctypes.cast(call, place).value for of, call in calls.items()}
        public = [function(Call(self, *blocks[of], True) if of in blocks else Solve(self, of, n_out))
                  for of, _, n_out in kernels]
        constants = ctypes.CFUNCTYPE(ctypes.c_int, place, place)(self.fill)
        names = [of.encode() for of, _, _ in kernels]
        cdef cnp.npy_intp room = len(kernels) * sizeof(eomgen_kernel)
        cdef cnp.ndarray memory = cnp.PyArray_ZEROS(1, &room, cnp.NPY_UINT8, 0)
        cdef eomgen_kernel *table = <eomgen_kernel *>cnp.PyArray_DATA(memory)
        for i, (of, n_in, n_out) in enumerate(kernels):
            table[<int>i] = eomgen_kernel(<const char *><bytes>names[i],
                                          <eomgen_function><uintptr_t>ctypes.cast(public[i], place).value, n_in, n_out)
        texts = np.array([0, 0], dtype=np.uintp)
        cdef bytes title = name.encode(), about = metadata.encode()
        self.held = [calls, public, constants, names, memory, texts, title, about]
        texts[0] = <uintptr_t><const char *>about
        self.table.abi, self.table.name = EOMGEN_ABI, <const char *>title
        self.table.n_p, self.table.n_work, self.table.n_kernels = sizes["n_p"], sizes["n_work"], len(kernels)
        self.table.kernels, self.table.closed_at = table, sizes["closed_at"]
        self.table.precompute = <int (*)(const double *, double *) noexcept nogil><uintptr_t>ctypes.cast(constants, place).value
        self.table.metadata = <const text_pointer *>cnp.PyArray_DATA(<cnp.ndarray>texts)
        self.table.compiler = "Python"
        if equations is not None:
            self.describe(starts, **equations)

    def describe(self, dict starts, numbers, tables, quaternions, places, areas, functions):
        require("lengths of the table of a model",
                (len(numbers), len(tables), len(places), len(areas), len(functions)),
                (N_NUMBERS, N_TABLES, 2, AREAS, N_FUNCTIONS))
        whole = [np.array(table, dtype=np.intc) for table in tables]
        short = [np.array(table, dtype=np.short) for table in places]
        first, second, third = [np.array(table, dtype=np.intc) for table in (numbers, quaternions, areas)]
        calls = np.array([starts[of] if of else 0 for of in functions], dtype=np.uintp)
        of_whole, of_short = [np.array([table.ctypes.data for table in group], dtype=np.uintp) for group in (whole, short)]
        self.held += [whole, short, second]
        eomgen_fill(
            &self.equations, <const int *>pointer(first), <const int **>pointer(of_whole), <const int *>pointer(second),
            <const short **>pointer(of_short), <const int *>pointer(third), <const eomgen_function *>pointer(calls),
        )
        cdef const eom_model *m = &self.equations
        require("lengths of tables of a model", (*map(len, tables), len(quaternions), *map(len, places)), (
            m.n_v, m.n_v, m.n_c, m.n_c + 1, max(tables[3]), m.n_v, m.n_v, m.n_quaternions, m.n_places, m.n_relaxed))

    @property
    def address(self):
        return <uintptr_t>&self.table

    def fill(self, p, c):
        """Precompute, for C."""
        cdef cnp.ndarray found
        try:
            found = vector(self.compute(copy(numbers_at(p), self.table.n_p)), self.table.n_const, "c", ValueError)
            memcpy(numbers_at(c), cnp.PyArray_DATA(found), self.table.n_const * sizeof(double))
            return 0
        except BaseException as error:
            return self.note(error)

    cdef int note(self, object error):
        """The status of what a function raised; what is no failure of an evaluation is kept for the caller of the C."""
        for kind, code in self.codes.items():
            if isinstance(error, kind):
                return code
        RAISED.setdefault(get_ident(), error)
        return EOMGEN_NON_FINITE


cdef class Call:
    """A Python function for C; of a kernel, which tells of numbers that are not finite."""

    cdef Functions owner
    cdef object function
    cdef int n_in, n_out
    cdef bint checks

    def __init__(self, Functions owner, function, int n_in, int n_out, bint checks=False):
        self.owner, self.function, self.n_in, self.n_out, self.checks = owner, function, n_in, n_out, checks

    def __call__(self, double t, x, u, c, out, w):
        cdef double *result = numbers_at(out)
        cdef const eomgen_model *table = &self.owner.table
        cdef cnp.ndarray found
        cdef int i, status
        if result == NULL:
            return 0
        try:
            if not RAISED or get_ident() not in RAISED:
                found = cnp.PyArray_FROM_OTF(
                    self.function(t, copy(numbers_at(x), self.n_in), copy(numbers_at(u), table.n_u),
                                  copy(numbers_at(c), table.n_const)), cnp.NPY_DOUBLE, cnp.NPY_ARRAY_IN_ARRAY)
                if cnp.PyArray_SIZE(found) != self.n_out:
                    raise ValueError(f"a function gave {cnp.PyArray_SIZE(found)} numbers instead of {self.n_out}")
                memcpy(result, cnp.PyArray_DATA(found), self.n_out * sizeof(double))
                return check_numbers(result, self.n_out) if self.checks else 0
            status = EOMGEN_NON_FINITE
        except BaseException as error:
            status = self.owner.note(error)
        for i in range(self.n_out):
            result[i] = NAN
        return status


cdef class Solve:
    """A kernel that is solved for by the model's functions."""

    cdef Functions owner
    cdef eom_solver solve
    cdef int n_out

    def __init__(self, Functions owner, str name, int n_out):
        self.owner, self.solve, self.n_out = owner, EOM_SOLVERS[<int>SOLVED.index(name)], n_out

    def __call__(self, double t, x, u, c, out, w):
        cdef double *result = numbers_at(out)
        cdef eom_at at = eom_at(&self.owner.equations, t, numbers_at(u), numbers_at(c), numbers_at(w))
        cdef int status
        if result == NULL:
            return 0
        status = self.solve(&at, numbers_at(x), result)
        return status if status != 0 else check_numbers(result, self.n_out)


cdef int call_at_once(object function, const Batch *batch, cnp.ndarray result) except -1:
    """All columns of a batch by one call, NaN where that fails."""
    cdef cnp.npy_intp k = batch.columns, j
    cdef cnp.ndarray x = rows(k, batch.n_in), u = rows(k, batch.table.n_u), t = rows(1, k)
    for j in range(k):
        (<double *>cnp.PyArray_DATA(t))[j] = load(batch, j)
        memcpy(<double *>cnp.PyArray_DATA(x) + j * batch.n_in, batch.x, batch.n_in * sizeof(double))
        memcpy(<double *>cnp.PyArray_DATA(u) + j * batch.table.n_u, batch.u, batch.table.n_u * sizeof(double))
    result[...] = NAN
    now, inputs = t[0] if batch.time.column else float(t[0, 0]), u.T if batch.inputs.column else u[0]
    found = function(now, np.ascontiguousarray(x.T), np.ascontiguousarray(inputs), copy(batch.c, batch.table.n_const))
    (<object>result).reshape(batch.n_out, k)[...] = found
    return 0
