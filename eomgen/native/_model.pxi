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
