# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, embedsignature=True
# cython: auto_pickle=False, emit_code_comments=False, freethreading_compatible=True
# distutils: define_macros=NPY_NO_DEPRECATED_API=NPY_1_7_API_VERSION
"""Cython layer: the C table of one model (eomgen_model_table) -> Python callables on NumPy arrays.

The text is the same for every model. It is compiled once and linked with a model's C source; everything it knows about
the model it reads from the table and from the model's JSON metadata.

Threads: contexts never change but for the work array that one call leaves to the next, and each call has its work array
to itself, on the stack when small and on the heap otherwise. So any number of threads may call one kernel at once, in free-threaded Pythons too; only ``failure`` is
shared: it holds the last failure of any thread. Batches and long kernels run without the GIL. What late lanes change
is published by atomic operations (_lanes.pxi). Steppers and journeys are of one thread each; their solutions
(interpolants, dense) may be read by many.
"""
cimport cython
cimport numpy as cnp
from cpython.object cimport PyObject
from cpython.pycapsule cimport PyCapsule_New
from libc.math cimport NAN, isfinite
from libc.stdint cimport int64_t, uintptr_t
from libc.string cimport memcmp, memcpy, memset

import json
import os
from sys import intern
from _thread import allocate_lock

import numpy as np
cnp.import_array()

cdef extern from "eomgen.h" nogil:
    enum: EOMGEN_NON_FINITE
    enum: EOMGEN_LEFT_ALONE
    ctypedef int (*eomgen_function)(double, const double *, const double *, const double *,
                                    double *, double *) noexcept nogil
    ctypedef struct eomgen_kernel:
        const char *name
        eomgen_function call
        int n_in, n_out
    ctypedef int (*eomgen_lane_function)(const double *, const double *, const double *, const double *, double *,
                                         double *, int *) noexcept nogil
    ctypedef struct eomgen_series:
        int n_work, most
    ctypedef struct eomgen_lanes:
        int width
        int (*usable)() noexcept nogil
        const eomgen_lane_function *kernels
        const eomgen_series *series
        void (*contracted)() noexcept
        void (*expand)() noexcept
    ctypedef const eomgen_lanes *eomgen_lanes_pointer
    ctypedef const char *text_pointer "const char *"
    ctypedef struct eomgen_model:
        int abi
        const char *name
        int n_p, n_u, n_const, n_work, n_kernels
        const eomgen_kernel *kernels
        int (*precompute)(const double *, double *) noexcept nogil
        const text_pointer *metadata
        const eomgen_lanes_pointer *lanes
        int closed_at
        const eomgen_series *series
    const eomgen_model *eomgen_model_table() noexcept

cdef extern from *:
    """
    #if defined(__clang__)
    #define EOMGEN_COMPILER "clang " __clang_version__
    #elif defined(__GNUC__)
    #define EOMGEN_COMPILER "gcc " __VERSION__
    #else
    #define EOMGEN_COMPILER "unknown"
    #endif
    """
    const char *EOMGEN_COMPILER

cdef enum:
    STACK = 1024  # doubles of work kept on the stack: 8 KiB, as a thread may have no more than 512
    MAX_DIMENSIONS = 8
    WIDEST = 8  # lanes; 8 doubles are also the largest alignment they need
    SCALAR = -2  # in place of a number of rows
    MANY = 4096  # columns after which lanes that must be compiled first are worth it

cdef const eomgen_model *MODEL = eomgen_model_table()
if MODEL.abi != 4:
    raise ImportError(f"the model's C table has layout {MODEL.abi} and this layer reads layout 4: generate both again")

metadata = ""
cdef int _piece = 0
while MODEL.metadata[_piece] != NULL:
    metadata += MODEL.metadata[_piece].decode()
    _piece += 1
table = <uintptr_t>MODEL  # for classes that are compiled apart
compiler = EOMGEN_COMPILER.decode()  # of this layer, and of the model that is linked with it
names = tuple([MODEL.kernels[i].name.decode() for i in range(MODEL.n_kernels)])
cdef dict _PLACES = {name: place for place, name in enumerate(names)}
sizes = {"n_p": MODEL.n_p, "n_u": MODEL.n_u, "n_const": MODEL.n_const, "n_work": MODEL.n_work}
_FACTS = json.loads(metadata)
_LONG = 20_000  # operations from which on a call lets other threads run: 5 microseconds, 100 times what that costs


cdef int find(str name, object error) except -1:
    if name not in _PLACES:
        raise error(f"model {MODEL.name.decode()!r} has no kernel {name!r}; it has {', '.join(names)}")
    return _PLACES[name]


include "_numbers.pxi"


cdef list declared(str key):
    """Values as the metadata hold them, where what is not given is null."""
    return [NAN if value is None else value for value in _FACTS.get(key, ())]


cdef cnp.ndarray copy(const double *data, cnp.npy_intp n):
    cdef cnp.ndarray array = cnp.PyArray_EMPTY(1, &n, cnp.NPY_DOUBLE, 0)
    memcpy(cnp.PyArray_DATA(array), data, n * sizeof(double))
    return array


cdef class Context:
    """Parameters and inputs bound to a model, with the constants that follow from them.

    Parameters
    ----------
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

    cdef readonly cnp.ndarray p, u, c
    cdef object spare  # work that an earlier call is done with

    def __cinit__(self, p=None, u=None, error=ValueError):
        p = declared("p_values") if p is None else p
        u = declared("u_values") if u is None else u
        self.p = np.array(vector(p, MODEL.n_p, "p", error))
        self.u = np.array(vector(u, MODEL.n_u, "u", error))
        self.c = compute_constants(self.p, error)
        for array in (self.p, self.u, self.c):
            array.flags.writeable = False

    cdef object take_work(self):
        """Work for a call and for constants of its own. Large arrays, which systems map anew each time, are kept."""
        cdef cnp.npy_intp length = MODEL.n_work + MODEL.n_const
        with cython.critical_section(self):
            found, self.spare = self.spare, None
        return cnp.PyArray_EMPTY(1, &length, cnp.NPY_DOUBLE, 0) if found is None else found

    cdef int leave_work(self, object work) except -1:
        """Keep the work of a call that went well for the next one."""
        with cython.critical_section(self):
            self.spare = work


include "_batches.pxi"
include "_lanes.pxi"

include "_kernel.pxi"
include "_steppers.pxi"
include "_ensembles.pxi"
include "_contacts.pxi"
