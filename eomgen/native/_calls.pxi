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
