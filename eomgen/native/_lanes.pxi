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
    cdef Piece constants = Piece(<char *>batch.c, batch.table.n_const, sizeof(double), 0)
    spread(&constants, 0, 0, width, c)
    while first < batch.columns and (failed < 0 or batch.nan):
        last = min(first + width, batch.columns) - 1
        if first == 0 or batch.time.column != 0:
            spread(&batch.time, first, last, width, t)
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
