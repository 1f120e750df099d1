# Numbers: what a call is given -> contiguous float64 arrays, or an error that says what was wanted.

# What Python or NumPy would make a float of, or NaN, though it is no real number.
cdef tuple UNREAL = (str, bytes, complex, np.complexfloating, np.datetime64, np.timedelta64, type(None))
cdef enum:
    DEEPEST = 64  # lists in lists, as in NumPy


cdef object fault(object error, str code, str text):
    """The error for a caller, of this code where it is one of eomgen's."""
    return error(text) if error is ValueError else error(text, code=code)


cdef cnp.ndarray doubles(object value, str label, object error, str name=None, int n=-1):
    """The value as an aligned float64 array: itself if it is one, whatever its strides; else a converted copy.

    What is refused is told as the argument `label` of kernel `name`, of n rows.
    """
    if (cnp.PyArray_CheckExact(value) and cnp.PyArray_TYPE(<cnp.ndarray>value) == cnp.NPY_DOUBLE
            and cnp.PyArray_ISBEHAVED_RO(<cnp.ndarray>value)):
        return value
    return converted(value, label, error, name, n)


cdef cnp.ndarray converted(object value, str label, object error, str name, int n):
    """Real numbers, by the rule of as_real in eomgen's runtime/argument_checks.py."""
    cdef cnp.ndarray found
    cdef int kind
    try:
        if cnp.PyArray_CheckExact(value):
            kind = cnp.PyArray_TYPE(<cnp.ndarray>value)
            if kind <= cnp.NPY_DOUBLE:  # booleans, integers, floats
                return aligned(value)
        elif type(value) is list or type(value) is tuple:
            found = of_numbers(value)
            if found is not None:
                return found
        if not has_masked(value, 0):
            array = np.asarray(value)
            if array.dtype.kind in "biuf" or array.dtype.kind == "O" and not any(
                    [isinstance(one, UNREAL) or has_masked(one, 0) for one in array.flat]):
                with np.errstate(over="ignore"):
                    return aligned(array)
    except MemoryError:
        raise
    except Exception:  # of an object's own __array__, __float__, ...
        pass
    if n == SCALAR:
        wanted = "be a number" if name is None else "be a real number, or (k,)"
    else:
        shape = "" if n < 0 else f", ({n},)" if name is None else f", ({n},) or ({n}, k)"
        wanted = f"hold real numbers{shape}"
    raise error(f"{called(label, name)} must {wanted}, not {shown(value)}")


cdef cnp.ndarray aligned(object array):
    return cnp.PyArray_FROM_OTF(
        array, cnp.NPY_DOUBLE, cnp.NPY_ARRAY_ALIGNED | cnp.NPY_ARRAY_NOTSWAPPED | cnp.NPY_ARRAY_FORCECAST)


cdef cnp.ndarray of_numbers(object given):
    """A list or tuple of Python's own numbers as an array; None if it holds anything else."""
    cdef cnp.npy_intp length = len(given), i = 0
    cdef cnp.ndarray array = cnp.PyArray_EMPTY(1, &length, cnp.NPY_DOUBLE, 0)
    cdef double *data = <double *>cnp.PyArray_DATA(array)
    for one in given:
        if i == length or not isinstance(one, (float, int)):
            return None
        data[i] = one
        i += 1
    return array if i == length else None


cdef bint has_masked(object given, int depth) except -1:
    """Whether NumPy would read the value under a masked entry, or NaN, in an array or in lists of these."""
    if isinstance(given, np.ma.MaskedArray):
        return np.ma.is_masked(given)
    if depth <= DEEPEST and isinstance(given, (list, tuple)):
        for one in given:
            if not isinstance(one, (float, int)) and has_masked(one, depth + 1):
                return True
    return False


cdef str called(str label, str name):
    """What users call an argument."""
    return label if name is None else f"{label} of {name}"


cdef str shown(object value):
    try:
        text = " ".join(repr(value).split())
    except Exception:  # its own __repr__, or an integer of thousands of digits
        return f"an object of type {type(value).__name__}, which cannot be shown"
    return text if len(text) <= 80 else text[:80] + "..."


cdef inline double moment(object t, str label, object error, str name=None) except? -7.0:
    """A time: one real number."""
    if isinstance(t, float):
        return t
    if isinstance(t, int):
        try:
            return t
        except OverflowError:
            pass
    array = doubles(t, label, error, name, SCALAR)
    if cnp.PyArray_NDIM(array):
        if name is None:
            raise fault(error, "EG-NUMBER", f"{label} must be a number, not {shown(t)}")
        raise error(f"{label} of {name} must be a number or have shape (k,), not {(<object>array).shape}")
    return (<double *>cnp.PyArray_DATA(array))[0]


cdef double finite(object given, str label, object error) except? -7.0:
    """A number that is neither NaN nor infinite."""
    cdef double number = moment(given, label, error)
    if not isfinite(number):
        raise fault(error, "EG-NUMBER", f"{label} must be finite, not {number}")
    return number


cdef cnp.ndarray vector(object value, int n, str label, object error):
    """The value as a contiguous float64 vector of n numbers."""
    cdef cnp.ndarray array = cnp.PyArray_GETCONTIGUOUS(doubles(value, label, error, None, n))
    if array.ndim != 1 or cnp.PyArray_DIM(array, 0) != n:
        raise error(f"{label} must have shape ({n},), not {(<object>array).shape}")
    return array


cdef inline bint is_vector(object given, cnp.npy_intp n) noexcept:
    """Whether C can read so many doubles in a row from it."""
    return (cnp.PyArray_CheckExact(given) and cnp.PyArray_TYPE(<cnp.ndarray>given) == cnp.NPY_DOUBLE
            and cnp.PyArray_NDIM(<cnp.ndarray>given) == 1 and cnp.PyArray_DIM(<cnp.ndarray>given, 0) == n
            and cnp.PyArray_ISCARRAY_RO(<cnp.ndarray>given))


cdef cnp.ndarray copy(const double *data, cnp.npy_intp n):
    cdef cnp.ndarray array = cnp.PyArray_EMPTY(1, &n, cnp.NPY_DOUBLE, 0)
    memcpy(cnp.PyArray_DATA(array), data, n * sizeof(double))
    return array


cdef cnp.ndarray rows(cnp.npy_intp n, cnp.npy_intp k):
    cdef cnp.npy_intp[2] dims = [n, k]
    return cnp.PyArray_EMPTY(2, dims, cnp.NPY_DOUBLE, 0)


# Batches: many states as columns of strided arrays -> one call of a kernel for each, without the GIL.

cdef struct Piece:  # one input of a kernel: n numbers `row` bytes apart, states `column` bytes apart
    char *data
    cnp.npy_intp n, row, column


cdef struct Batch:  # one call of a kernel for `columns` states; w, x, y and u belong to this call
    const eomgen_model *table
    eomgen_function call
    eomgen_lane_function lanes  # NULL: column by column
    int width  # of lanes
    Piece[3] pieces
    Piece time, inputs
    int n_pieces, n_in, n_out
    cnp.npy_intp columns
    bint nan
    const double *c  # constants of all columns
    Piece parameters  # of each column, n of them; n = 0: the constants are the same for all
    double *column_c  # place for the constants of `width` columns, at least of one, and then for the parameters of one
    double *w
    double *x
    double *y
    double *u
    double *side  # room of lanes, aligned


cdef inline void gather(const Piece *piece, cnp.npy_intp column, double *target) noexcept nogil:
    cdef char *data = piece.data + column * piece.column
    cdef cnp.npy_intp i
    for i in range(piece.n):
        target[i] = (<double *>data)[0]
        data += piece.row


cdef inline double entry(double value, int code) noexcept nogil:
    """An entry of a result: NaN where it could not be computed, even if others could."""
    return value if code == 0 or (code == EOMGEN_NON_FINITE and isfinite(value)) else NAN


cdef double load(const Batch *batch, cnp.npy_intp column) noexcept nogil:
    """Gather the state and the inputs of one column; returns its time."""
    cdef double *x = batch.x
    cdef double t
    for i in range(batch.n_pieces):
        gather(&batch.pieces[i], column, x)
        x += batch.pieces[i].n
    gather(&batch.inputs, column, batch.u)
    gather(&batch.time, column, &t)
    return t


cdef void column_constants(const Batch *batch, cnp.npy_intp column, double *constants) noexcept nogil:
    """The constants that follow from the parameters of one column; NaN where these give none."""
    cdef int n_const = batch.table.n_const, i
    cdef double *p = batch.column_c + batch.width * n_const
    gather(&batch.parameters, column, p)
    memset(constants, 0, n_const * sizeof(double))
    if batch.table.precompute(p, constants) != 0:
        for i in range(n_const):
            constants[i] = NAN


cdef int call_one(const Batch *batch, cnp.npy_intp column, double *result) noexcept nogil:
    """Evaluate one column into the (n_out, columns) result; returns its status."""
    cdef double t = load(batch, column)
    cdef const double *c = batch.c
    cdef cnp.npy_intp i
    cdef int code
    if batch.parameters.n:
        column_constants(batch, column, batch.column_c)
        c = batch.column_c
    if batch.nan:
        for i in range(batch.n_out):
            batch.y[i] = NAN
    code = batch.call(t, batch.x, batch.u, c, batch.y, batch.w)
    for i in range(batch.n_out):
        result[i * batch.columns + column] = entry(batch.y[i], code)
    return code


cdef cnp.npy_intp sweep(const Batch *batch, double *result, int *status) noexcept nogil:
    """Evaluate all columns into the (n_out, columns) result; returns the first column that failed, or -1."""
    cdef cnp.npy_intp failed = -1, j
    cdef int code
    for j in range(batch.columns):
        code = call_one(batch, j, result)
        if code != 0 and (failed < 0 or code < 0):
            failed, status[0] = j, code
        if code < 0 or (code != 0 and not batch.nan):
            break
    return failed
