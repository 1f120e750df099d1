# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, embedsignature=True
# cython: auto_pickle=False, emit_code_comments=False, freethreading_compatible=True
# distutils: define_macros=NPY_NO_DEPRECATED_API=NPY_1_7_API_VERSION
"""The C table of a model (eomgen_model_table) -> Python callables on NumPy arrays.

One extension module serves all models: a Model is made from the address of its table, and everything else is known from
the table and the JSON metadata in it. In an exported package the model is linked with this text, and is ``model`` here.

Threads: contexts never change but for the work array that one call leaves to the next, and each call has its work array
to itself, on the stack when small and on the heap otherwise. So any number of threads may call one kernel at once, in
free-threaded Pythons too; only ``failure`` is shared: it holds the last failure of any thread. Batches and long kernels
run without the GIL. Lanes that are compiled when needed are published by atomic operations (_model.pxi). Steppers and
runs are of one thread each; their solutions (Dense) may be read by many.
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
from _thread import allocate_lock, get_ident

import numpy as np
cnp.import_array()

cdef extern from "eomgen.h" nogil:
    enum: EOMGEN_ABI
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
        const char *compiler

ctypedef double *reals
ctypedef const double *const_reals
ctypedef int *ints
ctypedef const int *const_ints

cdef extern from "eomgen_steppers.h" nogil:
    ctypedef struct eomgen_tape:
        int n, n_out
        const_ints code, out
        const_reals numbers
        reals results
    ctypedef struct eomgen_signal:
        int n, order
        const_reals times, values
        const eomgen_tape *tape
    ctypedef struct eomgen_run:
        eomgen_function rhs, jacobian, meeting
        const_reals c, atol, closed
        reals u, w, y, y_old, f, next, F, failure_state
        const eomgen_signal *signals
        const eomgen_series *series
        int n, n_u, n_q, n_beside, interpolates, failure, stopped
        double rtol, max_step, t_bound, direction, t, t_old, step, h_abs, hold, failure_time
        long evaluations, rejected, steps, until_callback, differentiations, factorizations
        long (*callback)(void *, const double *) noexcept nogil
        void *callback_data
        int (*ask)(void *, double, const double *, double *, double *) noexcept nogil
    ctypedef struct eomgen_method:
        const char *name
        int rows_K, rows_F, squares, expands
        void (*interpolate)(const eomgen_run *, double, double *) noexcept nogil
        void (*prepare)(eomgen_run *) noexcept nogil
        void (*begin)(eomgen_run *) noexcept nogil
        int (*step)(eomgen_run *) noexcept nogil
    const eomgen_method eomgen_dop853, eomgen_rk45, eomgen_rk4, eomgen_radau, eomgen_taylor
    long eomgen_rows(const eomgen_method *, long, const eomgen_series *)
    double *eomgen_lay_out(eomgen_run *, const eomgen_method *, double *)
    const eomgen_method *eomgen_suited(const eomgen_method *, int) noexcept
    int eomgen_march(eomgen_function, int, double, double, const double *, const double *, const double *, double *,
                     double *, double *) noexcept
    void eomgen_start(const eomgen_method *, eomgen_run *) noexcept
    int eomgen_step(const eomgen_method *, eomgen_run *) noexcept
    void eomgen_between(const eomgen_method *, eomgen_run *, double, double *) noexcept
    const char **eomgen_operations

cdef extern from *:
    """
    #ifdef EOMGEN_LINKED /* with one model, in its package */
    #define EOMGEN_OWN_TABLE eomgen_model_table()
    #else
    #define EOMGEN_OWN_TABLE NULL
    #endif
    #ifndef EOMGEN_SOURCES
    #define EOMGEN_SOURCES ""
    #endif
    """
    const eomgen_model *EOMGEN_OWN_TABLE
    const char *EOMGEN_SOURCES

cdef enum:
    STACK = 1024  # doubles of work kept on the stack: 8 KiB, as a thread may have no more than 512
    MAX_DIMENSIONS = 8
    WIDEST = 8  # lanes; 8 doubles are also the largest alignment they need
    SCALAR = -2  # in place of a number of rows
    MANY = 4096  # columns after which lanes that must be compiled first are worth it

cdef enum:
    LONG = 20_000  # operations from which on a call lets other threads run: 5 microseconds, 100 times what that costs

sources = EOMGEN_SOURCES.decode()  # digest of the texts that this was compiled from


include "_arguments.pxi"
include "_model.pxi"
include "_kernel.pxi"
include "_runs.pxi"
include "_integrators.pxi"
include "_ensembles.pxi"
include "_contacts.pxi"

MAKERS = {
    "kernel": kernel, "stepper": Stepper, "run": Run, "called": CalledRun, "integrator": Integrator,
    "march": march, "solve_contacts": solve_contacts,
}  # of a Model, whose context they take
if EOMGEN_OWN_TABLE != NULL:
    model = Model(<uintptr_t>EOMGEN_OWN_TABLE, __name__, __file__)
