# Calls: what Python hands over -> the arguments of a kernel. Keyword arguments of a plain call would go into a dict first,
# which takes longer than small kernels do; CPython's vectorcall hands them over as they are.

cdef extern from "Python.h":
    ctypedef struct PyTypeObject:
        Py_ssize_t tp_vectorcall_offset
        unsigned long tp_flags
        object (*tp_call)(object, object, object)
    const unsigned long Py_TPFLAGS_HAVE_VECTORCALL
    Py_ssize_t PyVectorcall_NARGS(size_t)
    PyTypeObject *Py_TYPE(object)
    Py_ssize_t PyTuple_GET_SIZE(PyObject *)
    PyObject *PyTuple_GET_ITEM(PyObject *, Py_ssize_t)


cdef class Timed(Kernel):
    """A kernel of time and state: ``f(t, x, p=None, u=None, out=None)``."""

    def __call__(self, t, x, p=None, u=None, out=None):
        """Evaluate at time t, a float or (k,), and state x, (n,) or (n, k) for k states as columns.

        p (n_p,) and u, (n_u,) or (n_u, k), replace the context's; out is a float64 array of the result's shape,
        ``shape`` or ``(*shape, k)``.
        """
        return self.evaluate(t, x, p, u, out)


cdef class State(Kernel):
    """A kernel of the state alone: ``f(x, p=None, u=None, out=None, t=0.0)``."""

    def __call__(self, x, p=None, u=None, out=None, t=0.0):
        """Evaluate at state x; arguments as for Timed."""
        return self.evaluate(t, x, p, u, out)


cdef class Motion(Kernel):
    """A kernel of coordinates, velocities, accelerations: ``f(q, v, a, p=None, u=None, out=None, t=0.0)``."""

    def __call__(self, q, v, a, p=None, u=None, out=None, t=0.0):
        """Evaluate at q (n_q,), v and a (n_v,), or with a last axis k; other arguments as for Timed."""
        cdef int n_v = _FACTS.get("n_v", self.n_in // 3)
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
        for i in range(PyTuple_GET_SIZE(names)):
            name, k = PyTuple_GET_ITEM(names, i), 0
            while k < MOST and PyTuple_GET_ITEM(<PyObject *>order, k) != name:  # names in a program are interned
                k += 1
            if k == MOST or sorted[k] != NULL:
                return False
            sorted[k] = given[n + i]
    return True


cdef inline object given_or_none(PyObject *value):
    return None if value == NULL else <object>value


cdef object call_timed(object kernel, PyObject *const *given, size_t flagged, PyObject *names):
    cdef PyObject *a[MOST]
    if sort_arguments(OF_TIMED, given, PyVectorcall_NARGS(flagged), names, a) and a[0] != NULL and a[1] != NULL:
        return (<Timed>kernel).evaluate(
            <object>a[0], <object>a[1], given_or_none(a[2]), given_or_none(a[3]), given_or_none(a[4]))
    return call_plainly(kernel, given, PyVectorcall_NARGS(flagged), names)


cdef object call_state(object kernel, PyObject *const *given, size_t flagged, PyObject *names):
    cdef PyObject *a[MOST]
    if sort_arguments(OF_STATE, given, PyVectorcall_NARGS(flagged), names, a) and a[0] != NULL:
        return (<State>kernel).evaluate(
            0.0 if a[4] == NULL else <object>a[4], <object>a[0], given_or_none(a[1]), given_or_none(a[2]),
            given_or_none(a[3]))
    return call_plainly(kernel, given, PyVectorcall_NARGS(flagged), names)


cdef object call_plainly(object kernel, PyObject *const *given, Py_ssize_t n, PyObject *names):
    """By ``__call__``, which says what is wrong with the arguments."""
    cdef Py_ssize_t i
    cdef tuple words = () if names == NULL else <tuple>names
    return Py_TYPE(kernel).tp_call(
        kernel, tuple([<object>given[i] for i in range(n)]),
        {words[i]: <object>given[n + i] for i in range(len(words))})


cdef int enable_quick_calls(Kernel kernel) except -1:
    """Let CPython find a kernel's quick call; its type learns where that is kept from the first kernel."""
    cdef PyTypeObject *kind
    if type(kernel) is Timed:
        kernel.quick, kind = call_timed, <PyTypeObject *>Timed
    elif type(kernel) is State:
        kernel.quick, kind = call_state, <PyTypeObject *>State
    else:
        kernel.quick = NULL
        return 0
    if kind.tp_vectorcall_offset == 0:
        kind.tp_vectorcall_offset = <char *>&kernel.quick - <char *><PyObject *>kernel
        kind.tp_flags |= Py_TPFLAGS_HAVE_VECTORCALL
    return 0


def address(str name not None):
    """Address of a kernel's C function (its type is in eomgen.h), for ctypes, Numba or another extension."""
    return <uintptr_t>MODEL.kernels[find(name, KeyError)].call


def capsule(str name not None):
    """The same address as a capsule named ``eomgen_function``."""
    return PyCapsule_New(<void *>MODEL.kernels[find(name, KeyError)].call, "eomgen_function", NULL)
