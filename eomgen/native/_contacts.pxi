# Impulses of rigid contacts.

cdef extern from "eomgen_contacts.h" nogil:
    void eomgen_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                               double tolerance, int most, double *work, int *numbers, int *count, double *residual)


def solve_contacts(W, c, friction, start, double tolerance, int most):
    """Impulses (m, d) of rigid contacts, iterations and residual; see eomgen_contacts.h.

    Parameters
    ----------
    W : (m d, m d) ndarray
    c, start : (m, d) ndarray
    friction : (m,) ndarray
    tolerance : float
    most : int
    """
    cdef int m = c.shape[0], d = c.shape[1], n = m*d, count = 0
    cdef cnp.ndarray compliance = np.ascontiguousarray(W, dtype=float), free = np.ascontiguousarray(c, dtype=float)
    cdef cnp.ndarray coefficients = np.ascontiguousarray(friction, dtype=float)
    cdef cnp.ndarray P = np.array(start, dtype=float, order="C")
    cdef cnp.ndarray work = np.empty(n*(n + 8) + 3*m + 1), numbers = np.empty(n + m + 1, dtype=np.intc)
    cdef double residual = 0.0
    if not 1 <= d <= 3 or P.shape[0] != m or P.shape[1] != d or compliance.size != m*d*m*d or coefficients.size != m:
        raise ValueError("contacts have shapes that do not belong together")
    with nogil:
        eomgen_solve_contacts(
            m, d, <const double *>cnp.PyArray_DATA(compliance), <const double *>cnp.PyArray_DATA(free),
            <const double *>cnp.PyArray_DATA(coefficients), <double *>cnp.PyArray_DATA(P), tolerance, most,
            <double *>cnp.PyArray_DATA(work), <int *>cnp.PyArray_DATA(numbers), &count, &residual,
        )
    return P, count, residual


cdef extern from "eomgen_contacts.h" nogil:
    ctypedef struct eomgen_source:
        eomgen_function call
        const double *c
    enum:
        EOMGEN_MORE_ROOM
        EOMGEN_NO_INPUT
    ctypedef struct eomgen_rigid:
        int n_q, n_v, n_u, n_rows, n_c, n_h, n_plain, n_balls, n_lists, n_shapes, n_witnesses, m, most, begins, wide, room, needed
        int known, missed, iterations, contacts, status, list
        const_ints rows, plain, balls, lists
        const signed char *moved
        eomgen_source mass
        int (*inputs)(void *, double, const double *, double *) noexcept nogil
        void *forcing
        ints numbers, keys
        reals u, w, x, x_m, next, held, many, last, acting
        double tolerance, residual, depth, when
        double law[2]
        const eomgen_source *source
        const_reals where
    int eomgen_contacts_wide()
    long eomgen_rigid_fixed(const eomgen_rigid *)
    long eomgen_rigid_further(const eomgen_rigid *)
    int eomgen_rigid_step(eomgen_rigid *, double, double)

cdef extern from "eomgen_steppers.h" nogil:
    void eomgen_force(eomgen_run *, double, const double *)

cdef enum:
    ACTING = 14  # numbers of a contact that acts

cdef tuple SOURCES = (  # functions of the model, in the order of eomgen_rigid
    "mass_matrix", "constraint_jacobian", "velocity_constraints", "constraints", "near_pairs", "motion_axes", "bias_apart",
    "meeting_time",
)

ctypedef struct played_inputs:
    eomgen_run run
    double first, last


cdef int play_inputs(void *forcing, double t, const double *x, double *u) noexcept nogil:
    cdef played_inputs *played = <played_inputs *>forcing
    played.run.hold = min(max(t, played.first), played.last)
    eomgen_force(&played.run, t, x)
    return 0


cdef int ask_for_inputs(void *stepper, double t, const double *x, double *u) noexcept with gil:
    cdef RigidStepper self = <RigidStepper>stepper
    try:
        found = vector(self.forcing(t, copy(x, self.s.n_q + self.s.n_v)), self.s.n_u, "u", ValueError)
        memcpy(u, cnp.PyArray_DATA(<cnp.ndarray>found), self.s.n_u * sizeof(double))
        return 0
    except BaseException as error:
        self.raised = error
        return 1


cdef class RigidStepper:
    """Steps of a mechanism with rigid contacts; see runtime/impacts/moreau.py.

    Parameters
    ----------
    model : Model
    bound : Context
        Parameters and inputs; of any build of the model.
    sources : dict of str to (int, ndarray)
        Of each function of the model that is needed its address and its constants.
    n_work : int
        Numbers that these work on.
    facts : dict of str to int
        n_rows, n_c, n_h, n_witnesses.
    tables : dict of str to sequences of int
        rows, plain, balls, lists, moved.
    tolerance, most : float, int
        Of the laws of contact.
    signals : list or None
        Inputs over time, as for Stepper; None where `forcing` tells them.
    forcing : callable or None
        u (n_u,) for t and x.
    within : (float, float)
        Times between which tables are read.
    """

    cdef eomgen_rigid s
    cdef played_inputs played
    cdef list held
    cdef object forcing, raised
    cdef cnp.ndarray memory, many, numbers, acting, known

    def __cinit__(self, Model model not None, bound, dict sources, int n_work, dict facts, dict tables, double tolerance,
                  int most, signals, forcing, within):
        cdef eomgen_rigid *s = &self.s
        cdef Context context = bound if isinstance(bound, Context) else Context(model, bound.p, bound.u)
        cdef dict kept = {name: np.ascontiguousarray(table, np.int8 if name == "moved" else np.intc)
                          for name, table in tables.items()}
        cdef cnp.npy_intp length
        self.held, self.forcing, self.raised = [context, kept, sources], forcing, None
        s.n_q, s.n_v, s.n_u = model.n_q, model.n_v, model.table.n_u
        s.n_rows, s.n_c, s.n_h, s.n_witnesses = facts["n_rows"], facts["n_c"], facts["n_h"], facts["n_witnesses"]
        s.n_plain, s.n_balls = kept["plain"].size // 2, kept["balls"].size // 2
        s.n_lists, s.n_shapes = kept["lists"].size // 2, len(kept["moved"])
        s.rows, s.plain = <const int *>pointer(kept["rows"]), <const int *>pointer(kept["plain"])
        s.balls, s.lists = <const int *>pointer(kept["balls"]), <const int *>pointer(kept["lists"])
        s.moved = <const signed char *>pointer(kept["moved"])
        for k, name in enumerate(SOURCES):
            (&s.mass)[<int>k] = source_of(sources, name)
        s.tolerance, s.most, s.begins, s.room = tolerance, most, 1, 0
        s.wide = eomgen_contacts_wide()
        cdef cnp.npy_intp n = s.n_q + 2 * s.n_v
        length = 3 * n + s.n_u + n_work + eomgen_rigid_fixed(s)
        self.memory = cnp.PyArray_ZEROS(1, &length, cnp.NPY_DOUBLE, 0)
        s.x = <double *>cnp.PyArray_DATA(self.memory)
        s.x_m = s.x + n
        s.next = s.x_m + n
        s.u = s.next + n
        s.w = s.u + s.n_u
        s.held = s.w + n_work
        memcpy(s.u, cnp.PyArray_DATA(context.u), s.n_u * sizeof(double))
        if forcing is not None:
            s.inputs, s.forcing = ask_for_inputs, <void *>self
        elif signals:
            self.played.run.n_u, self.played.run.u = s.n_u, s.u
            self.played.first, self.played.last = within
            self.played.run.c = <const double *>cnp.PyArray_DATA(context.c)
            self.played.run.signals = make_signals(signals, s.n_u, self.held)
            s.inputs, s.forcing = play_inputs, &self.played
        self.make_room(16)

    cdef int make_room(self, int room) except -1:
        """Memory for more contacts; what is known of the last ones stays."""
        cdef eomgen_rigid *s = &self.s
        cdef cnp.npy_intp numbers = 11 * room, acting = (ACTING + 3) * room, many
        cdef cnp.ndarray keys = np.zeros(numbers, np.intc), found = cnp.PyArray_ZEROS(1, &acting, cnp.NPY_DOUBLE, 0)
        s.room = room
        many = eomgen_rigid_further(s)
        self.many = cnp.PyArray_EMPTY(1, &many, cnp.NPY_DOUBLE, 0)
        s.many = <double *>cnp.PyArray_DATA(self.many)
        cdef int *places = <int *>cnp.PyArray_DATA(keys)
        cdef double *impulses = <double *>cnp.PyArray_DATA(found)
        if s.known:
            memcpy(places, s.keys, 3 * s.known * sizeof(int))
            memcpy(impulses, s.last, 3 * s.known * sizeof(double))
        self.numbers, self.acting = keys, found
        s.keys, s.numbers, s.last, s.acting = places, places + 3 * room, impulses, impulses + 3 * room
        return 0

    def step(self, double t, double h, x, next):
        """A step from x (n_x,) into next; 0, or what became of it as eomgen_contacts.h says."""
        cdef int status = EOMGEN_MORE_ROOM
        cdef cnp.npy_intp n = self.s.n_q + self.s.n_v
        cdef cnp.ndarray given = vector(x, n, "x", ValueError), found = target(next, n, ValueError)
        memcpy(self.s.x, cnp.PyArray_DATA(given), n * sizeof(double))
        while True:
            with nogil:
                status = eomgen_rigid_step(&self.s, t, h)
            if status != EOMGEN_MORE_ROOM:
                break
            self.make_room(max(self.s.needed, 2 * self.s.room))
        tell_raised()
        if status == EOMGEN_NO_INPUT:
            error, self.raised = self.raised, None
            raise error
        if status == 0:
            memcpy(cnp.PyArray_DATA(found), self.s.next, n * sizeof(double))
        return status

    def contacts_of_step(self):
        """Contacts of the last step (m, 14): both shapes, normal, first direction across, point, impulses (3)."""
        cdef cnp.ndarray found = rows(self.s.m, ACTING)
        memcpy(cnp.PyArray_DATA(found), self.s.acting, self.s.m * ACTING * sizeof(double))
        return found

    @property
    def failure(self):
        """Of a function that failed: its name, status, time, what it was called with, and inputs; None without one."""
        if self.s.source == NULL:
            return None
        return (SOURCES[self.s.source - &self.s.mass], self.s.status, self.s.when,
                copy(self.s.where, self.s.n_q + 2 * self.s.n_v), copy(self.s.u, self.s.n_u))

    @property
    def refused(self):
        """Of contacts that were refused: their list, pairs that are near, friction and restitution."""
        return self.s.list, self.s.needed, self.s.law[0], self.s.law[1]

    @property
    def figures(self):
        """The largest residual (m/s) and penetration (m), steps that missed the tolerance, the most iterations and contacts."""
        return {"contact_iterations": self.s.iterations, "contacts": self.s.contacts, "missed_steps": self.s.missed,
                "contact_residual": self.s.residual, "penetration": self.s.depth}


cdef const void *pointer(cnp.ndarray table):
    return cnp.PyArray_DATA(table)


cdef eomgen_source source_of(dict sources, str name):
    """A function of the model and its constants; none where it has none."""
    cdef eomgen_source found
    found.call, found.c = NULL, NULL
    if name in sources:
        address_of, constants = sources[name]
        found.call = <eomgen_function><uintptr_t>address_of
        found.c = <const double *>cnp.PyArray_DATA(<cnp.ndarray>constants)
    return found

