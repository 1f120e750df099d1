# Lanes: the columns of a batch -> groups of as many as the processor takes at a time. The kernels' entry points are in
# LANES.kernels, by the kernel's index (eomgen_lane_function in eomgen.h tells how to call them); NULL: no lanes.

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


cdef const eomgen_lanes *find_lanes() noexcept:
    """The widest lanes that were compiled and that this processor has; NULL without any."""
    cdef int i = 0
    while MODEL.lanes != NULL and MODEL.lanes[i] != NULL:
        if MODEL.lanes[i].usable():
            return MODEL.lanes[i]
        i += 1
    return NULL


cdef const eomgen_lanes *LANES = find_lanes()
lane_width = 1 if LANES == NULL else LANES.width  # states that batches take at a time

# Lanes that are not in this library yet: `LATE` makes or finds the library that has them and gives the address of their
# table, or 0. A model whose runs are single ones never pays for them.
cdef object LATE = None  # read and written with LATE_TURN alone
cdef int OFFERED = 0  # whether there is one
cdef object LATE_TURN = allocate_lock()


def renew_turn():
    """In a forked child: the thread that held the lock is not there."""
    global LATE_TURN
    LATE_TURN = allocate_lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=renew_turn)
cdef cnp.npy_intp BATCHED = 0  # columns evaluated without lanes
cdef frozenset IN_LANES = frozenset(_FACTS.get("lanes", ()))


cdef const eomgen_series *SERIES = MODEL.series
cdef bint HAS_SERIES = bool(_FACTS.get("series"))


def offer_lanes(find):
    """Have ``find()`` called for lanes when they are needed; it gives the address of an eomgen_lanes, or 0."""
    global LATE
    with LATE_TURN:
        if (LANES == NULL and IN_LANES) or (SERIES == NULL and HAS_SERIES):
            LATE = find
            show_offer(OFFERED, 1)


def take_lanes(str name="rhs"):
    """Have the lanes that were offered now, if a kernel has any; other threads that want them wait."""
    global LATE, lane_width
    cdef const eomgen_lanes *found
    if not has_offer(OFFERED) or name not in IN_LANES:
        return
    with LATE_TURN:
        if LATE is None:
            return
        try:
            found = <const eomgen_lanes *><uintptr_t>LATE()
        except Exception:
            LATE = None  # not again and again; after an interrupt it is tried again
            show_offer(OFFERED, 0)
            raise
        if found != NULL and found.usable():
            lane_width = found.width
            if SERIES == NULL:
                show_series(SERIES, found.series)
            show_lanes(LANES, found)
        LATE = None
        show_offer(OFFERED, 0)


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
    cdef double *c = u + width * MODEL.n_u
    cdef double *x = c + width * MODEL.n_const
    cdef double *y = x + width * batch.n_in
    cdef double *w = y + width * batch.n_out
    cdef Piece constants = Piece(<char *>batch.c, MODEL.n_const, sizeof(double), 0)
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
