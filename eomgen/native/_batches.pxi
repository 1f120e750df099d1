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
    const double *c
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


cdef int call_one(const Batch *batch, cnp.npy_intp column, double *result) noexcept nogil:
    """Evaluate one column into the (n_out, columns) result; returns its status."""
    cdef double t = load(batch, column)
    cdef cnp.npy_intp i
    cdef int code
    if batch.nan:
        for i in range(batch.n_out):
            batch.y[i] = NAN
    code = batch.call(t, batch.x, batch.u, batch.c, batch.y, batch.w)
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
