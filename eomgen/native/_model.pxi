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
    #define EOM_FUNCTION(name) eom_##name,
    static const eom_solvers eom_table = { EOM_LAYOUT, EOM_EACH(EOM_FUNCTION) eom_finish_rhs };
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


# Models: the C table of a model -> what Python knows of it, and its lanes once they are there.

cdef extern from *:
    """
    #if defined(__GNUC__)
    #define EOMGEN_SEEN(at) __atomic_load_n(&(at), __ATOMIC_ACQUIRE)
    #define EOMGEN_SHOW(at, value) __atomic_store_n(&(at), (value), __ATOMIC_RELEASE)
    #define EOMGEN_COUNT(at, more) __atomic_add_fetch(&(at), (more), __ATOMIC_RELAXED)
    #else /* under the GIL */
    #define EOMGEN_SEEN(at) (at)
    #define EOMGEN_SHOW(at, value) ((at) = (value))
    #define EOMGEN_COUNT(at, more) ((at) += (more))
    #endif
    """
    const eomgen_lanes *seen_lanes "EOMGEN_SEEN"(const eomgen_lanes *)
    void show_lanes "EOMGEN_SHOW"(const eomgen_lanes *, const eomgen_lanes *)
    const eomgen_series *seen_series "EOMGEN_SEEN"(const eomgen_series *)
    void show_series "EOMGEN_SHOW"(const eomgen_series *, const eomgen_series *)
    bint has_offer "EOMGEN_SEEN"(int)
    void show_offer "EOMGEN_SHOW"(int, int)
    cnp.npy_intp count_columns "EOMGEN_COUNT"(cnp.npy_intp, cnp.npy_intp)

ctypedef const eomgen_method *method_pointer
cdef enum:
    N_METHODS = 5
cdef method_pointer[N_METHODS] METHODS = [&eomgen_dop853, &eomgen_rk45, &eomgen_rk4, &eomgen_radau, &eomgen_taylor]

cdef object LANES_LOCK = allocate_lock()  # of all models: lanes are compiled one after the other


def renew_lock():
    """In a forked child: the thread that had the lock is not there."""
    global LANES_LOCK
    LANES_LOCK = allocate_lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=renew_lock)


cdef class Model:
    """A compiled model.

    Parameters
    ----------
    address : int
        Of its eomgen_model, which stays where it is.
    name, file : str
        Name of the module, and the file that its code was loaded from.
    find_lanes : callable, optional
        ``find_lanes()`` -> address of its eomgen_lanes, compiled when they are first needed, or 0.
    functions : Functions, optional
        Whose table it is, where functions are Python's.

    Attributes
    ----------
    metadata : str
        JSON.
    names : tuple of str
        Its kernels.
    methods : tuple of str
        The methods of integration that it can be run with.
    sizes : dict of str to int
        n_p, n_u, n_const, n_work.
    compiler : str
        That compiled it.
    lane_width : int
        States that batches take at a time.

    Raises
    ------
    ImportError
        The table has another layout.
    """

    cdef const eomgen_model *table
    cdef const eomgen_lanes *lanes
    cdef const eomgen_series *series
    cdef readonly str __name__, __file__, metadata, compiler
    cdef readonly tuple names, methods
    cdef readonly dict sizes
    cdef dict places, facts
    cdef int n_q, n_v
    cdef bint projects, has_series
    cdef frozenset in_lanes
    cdef Functions functions
    cdef object find_lanes  # read and written with LANES_LOCK alone
    cdef int offers  # whether find_lanes is there
    cdef cnp.npy_intp batched  # columns evaluated without lanes
    cdef method_pointer[N_METHODS] suited
    cdef object __weakref__

    def __cinit__(self, uintptr_t address, str name, str file, find_lanes=None, Functions functions=None):
        cdef int i = 0
        self.functions = functions
        self.table = <const eomgen_model *>address
        if self.table.abi != EOMGEN_ABI:
            raise ImportError(f"the model's C table has layout {self.table.abi} and this module reads layout "
                              f"{EOMGEN_ABI}: generate both again")
        self.__name__, self.__file__, self.metadata, self.compiler = name, file, "", self.table.compiler.decode()
        while self.table.metadata[i] != NULL:
            self.metadata += self.table.metadata[i].decode()
            i += 1
        self.facts = json.loads(self.metadata)
        self.names = tuple([self.table.kernels[i].name.decode() for i in range(self.table.n_kernels)])
        self.places = {name: place for place, name in enumerate(self.names)}
        self.sizes = {"n_p": self.table.n_p, "n_u": self.table.n_u, "n_const": self.table.n_const,
                      "n_work": self.table.n_work}
        self.n_q, self.n_v = self.facts.get("n_q", 0), self.facts.get("n_v", 0)
        self.projects = bool(self.facts.get("n_c", 0) or self.facts.get("quaternion_slots"))
        self.in_lanes, self.has_series = frozenset(self.facts.get("lanes", ())), bool(self.facts.get("series"))
        for i in range(N_METHODS):  # once: to ask the processor may take longer than a short run
            self.suited[i] = eomgen_suited(METHODS[i], self.kernel("rhs").n_in) if "rhs" in self.places else METHODS[i]
        self.methods = tuple([
            METHODS[i].name.decode() for i in range(N_METHODS)
            if (METHODS[i].squares == 0 or "jacobian" in self.places) and (not METHODS[i].expands or self.has_series)
        ])
        self.series = self.table.series
        i = 0
        while self.lanes == NULL and self.table.lanes != NULL and self.table.lanes[i] != NULL:
            if self.table.lanes[i].usable():
                self.lanes = self.table.lanes[i]
            i += 1
        if find_lanes is not None and (
                self.in_lanes and self.lanes == NULL or self.has_series and self.series == NULL):
            self.find_lanes, self.offers = find_lanes, 1

    def __getattr__(self, str name):
        if name not in MAKERS:
            raise AttributeError(f"a compiled model has no attribute {name!r}")
        return MAKERS[name]

    def __repr__(self):
        return f"<compiled model {self.table.name.decode()} from {self.__file__}>"

    def context(self, p=None, u=None, error=ValueError):
        """Parameters and inputs bound to this model."""
        return Context(self, p, u, error)

    def ensemble(self, *options, **named):
        """Trajectories to run; see Ensemble."""
        return Ensemble(self, *options, **named)

    def rigid_stepper(self, *options):
        """Steps with rigid contacts; see RigidStepper."""
        return RigidStepper(self, *options)

    def address(self, str name not None):
        """Address of a kernel's C function (its type is in eomgen.h), for ctypes, Numba or another extension."""
        return <uintptr_t>self.kernel(name, KeyError).call

    def capsule(self, str name not None):
        """The same address as a capsule named ``eomgen_function``."""
        return PyCapsule_New(<void *>self.kernel(name, KeyError).call, "eomgen_function", NULL)

    @property
    def lane_width(self):
        cdef const eomgen_lanes *lanes = seen_lanes(self.lanes)
        return 1 if lanes == NULL else lanes.width

    def take_lanes(self, str name="rhs"):
        """Have the lanes now, if a kernel has any; other threads that want them wait."""
        cdef const eomgen_lanes *found
        if not has_offer(self.offers) or name not in self.in_lanes:
            return
        with LANES_LOCK:
            if self.find_lanes is None:
                return
            try:
                found = <const eomgen_lanes *><uintptr_t>self.find_lanes()
            except Exception:
                self.find_lanes = None  # not again and again; after an interrupt it is tried again
                show_offer(self.offers, 0)
                raise
            if found != NULL and found.usable():
                if self.series == NULL:
                    show_series(self.series, found.series)
                show_lanes(self.lanes, found)
            self.find_lanes = None
            show_offer(self.offers, 0)

    cdef const eomgen_kernel *kernel(self, str name, object error=ValueError) except NULL:
        if name not in self.places:
            raise error(f"model {self.table.name.decode()!r} has no kernel {name!r}; it has {', '.join(self.names)}")
        return &self.table.kernels[<int>self.places[name]]

    cdef method_pointer method(self, str name) except NULL:
        """The method of a name, with what it needs of the model."""
        cdef int i
        for i in range(N_METHODS):
            if name == METHODS[i].name.decode() and name in self.methods:
                if METHODS[i].expands and seen_series(self.series) == NULL:
                    self.take_lanes()
                    if seen_series(self.series) == NULL:
                        raise RuntimeError(
                            f"method Taylor: the series of {self.table.name.decode()} could not be compiled; "
                            "the warning before says why; correct that and start Python again, or use DOP853"
                        )
                return self.suited[i]
        raise ValueError(f"no method {name}")

    cdef list declared(self, str key):
        """Values as the metadata hold them, where what is not given is null."""
        return [NAN if value is None else value for value in self.facts.get(key, ())]

    cdef cnp.ndarray constants(self, cnp.ndarray p, object error):
        """The constants (n_const,) that follow from the parameters (n_p,)."""
        cdef cnp.npy_intp n = self.table.n_const
        cdef cnp.ndarray constants = cnp.PyArray_EMPTY(1, &n, cnp.NPY_DOUBLE, 0)
        fill_constants(self, p, <double *>cnp.PyArray_DATA(constants), error)
        return constants


cdef int fill_constants(Model model, cnp.ndarray p, double *constants, object error) except -1:
    """The constants that follow from the parameters, into a place for them."""
    memset(constants, 0, model.table.n_const * sizeof(double))
    cdef int status = model.table.precompute(<double *>cnp.PyArray_DATA(p), constants)
    if status != 0:
        tell_raised()
        raise error(f"the constants that follow from the parameters cannot be computed (status {status}); p = {p}")
    return 0


cdef class Context:
    """Parameters and inputs bound to a model, with the constants that follow from them.

    Parameters
    ----------
    model : Model
    p : (n_p,) array_like, optional
        Parameters in the order of ``p_names``; the declared values by default.
    u : (n_u,) array_like, optional
        Inputs in the order of ``u_names``; the declared values by default.
    error : type
        Exception raised for values that do not fit.

    Attributes
    ----------
    p, u, c : ndarray
        Parameters, inputs and the constants handed to kernels; read-only.
    """

    cdef readonly Model model
    cdef readonly cnp.ndarray p, u, c
    cdef object spare  # work that an earlier call is done with

    def __cinit__(self, Model model not None, p=None, u=None, error=ValueError):
        self.model = model
        p = model.declared("p_values") if p is None else p
        u = model.declared("u_values") if u is None else u
        self.p = np.array(vector(p, model.table.n_p, "p", error))
        self.u = np.array(vector(u, model.table.n_u, "u", error))
        self.c = model.constants(self.p, error)
        for array in (self.p, self.u, self.c):
            array.flags.writeable = False

    cdef object take_work(self):
        """Work for a call and for constants of its own. Large arrays, which systems map anew each time, are kept."""
        cdef cnp.npy_intp length = self.model.table.n_work + self.model.table.n_const
        with cython.critical_section(self):
            found, self.spare = self.spare, None
        return cnp.PyArray_EMPTY(1, &length, cnp.NPY_DOUBLE, 0) if found is None else found

    cdef int leave_work(self, object work) except -1:
        """Keep the work of a call that went well for the next one."""
        with cython.critical_section(self):
            self.spare = work


# Lanes: the columns of a batch -> groups of as many as the processor takes at a time. The kernels' entry points are in
# the model's lanes.kernels, by the kernel's index (eomgen_lane_function in eomgen.h tells how to call them).

cdef inline void spread(const Piece *piece, cnp.npy_intp first, cnp.npy_intp last, int width,
                        double *target) noexcept nogil:
    """Columns first, ..., last side by side; the last one fills what lanes are left."""
    cdef cnp.npy_intp i, k, filled = last - first + 1
    cdef char *data = piece.data + first * piece.column
    for i in range(piece.n):
        for k in range(filled):
            target[k] = (<double *>(data + k * piece.column))[0]
        for k in range(filled, width):
            target[k] = target[filled - 1]
        target += width
        data += piece.row


cdef cnp.npy_intp sweep_lanes(const Batch *batch, double *result, int *status) noexcept nogil:
    """What sweep does, a group of columns at a time."""
    cdef cnp.npy_intp failed = -1, first = 0, last, i, k
    cdef int width = batch.width
    cdef int[WIDEST] codes
    cdef double *t = batch.side
    cdef double *u = t + width
    cdef double *c = u + width * batch.table.n_u
    cdef double *x = c + width * batch.table.n_const
    cdef double *y = x + width * batch.n_in
    cdef double *w = y + width * batch.n_out
    cdef int n_const = batch.table.n_const
    cdef Piece constants = Piece(<char *>batch.c, n_const, sizeof(double), 0)
    if batch.parameters.n:
        constants = Piece(<char *>batch.column_c, n_const, sizeof(double), n_const * sizeof(double))
    while first < batch.columns and (failed < 0 or batch.nan):
        last = min(first + width, batch.columns) - 1
        if first == 0 or batch.time.column != 0:
            spread(&batch.time, first, last, width, t)
        if batch.parameters.n:
            for i in range(last - first + 1):
                column_constants(batch, first + i, batch.column_c + i * n_const)
        if first == 0 or batch.parameters.n:
            spread(&constants, 0, last - first, width, c)
        if first == 0 or batch.inputs.column != 0:
            spread(&batch.inputs, first, last, width, u)
        k = 0
        for i in range(batch.n_pieces):
            spread(&batch.pieces[i], first, last, width, x + k * width)
            k += batch.pieces[i].n
        if batch.nan:
            for i in range(width * batch.n_out):
                y[i] = NAN
        if batch.lanes(t, x, u, c, y, w, codes) == 0:
            for i in range(batch.n_out):
                memcpy(result + i * batch.columns + first, y + i * width, (last - first + 1) * sizeof(double))
        else:
            for k in range(last - first + 1):
                if codes[k] == EOMGEN_LEFT_ALONE:
                    codes[k] = call_one(batch, first + k, result)
                else:
                    for i in range(batch.n_out):
                        result[i * batch.columns + first + k] = entry(y[i * width + k], codes[k])
                if codes[k] != 0 and failed < 0:
                    failed, status[0] = first + k, codes[k]
        first += width
    return failed


cdef inline cnp.npy_intp evaluate(const Batch *batch, double *result, int *status) noexcept nogil:
    """Evaluate all columns, in lanes where the kernel has them."""
    return sweep(batch, result, status) if batch.lanes == NULL else sweep_lanes(batch, result, status)
