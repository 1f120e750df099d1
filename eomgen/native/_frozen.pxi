# A journey between two steps <-> the numbers it goes on from: the same steps follow, to the last bit.

cdef object FROZEN = ("numbers", "counts", "rows", "block", "events", "event_counts")


cdef cnp.npy_intp block_length(Journey j):
    """Numbers in stages, in what a method keeps besides, and in the coefficients between two states."""
    cdef cnp.npy_intp n = j.run.n
    return n * (j.method.rows_K + j.method.rows_F) + eomgen_further(j.method, n, j.run.series)


cdef dict freeze(Journey j, long status):
    """Arrays by name; `status` is what travel returned, 0 on the way."""
    cdef eomgen_run *r = &j.run
    cdef eomgen_events *ev = &j.events
    cdef int n = r.n, k = ev.n, i
    cdef double **places = [r.y, r.y_old, r.f, r.failure_state, r.next]
    cdef double **values = [ev.g, ev.slope, ev.g_new, ev.slope_new, ev.size, ev.latest]
    for i in range(5):
        if len(j.stored[i]) > 1:  # parts of larger arrays
            j.stored[i] = [np.concatenate(j.stored[i])]
    empty = {0: 0, 1: (0, n), 2: (0, 3 + n * (1 + j.method.rows_F)), 3: (0, 2 + n), 4: (0, 1 + n)}
    results = [parts[0] if parts else np.empty(empty[i]) for i, parts in enumerate(j.stored)]
    if j.journey.n_eval >= 0:
        results[0], results[1] = j.times[:j.journey.stored], j.states[:j.journey.stored]
    return {
        "numbers": np.array([r.t, r.t_old, r.step, r.h_abs, r.t_bound, r.hold, r.direction, r.failure_time,
                             ev.last_reset]),
        "counts": np.array([r.interpolates, r.evaluations, r.rejected, r.steps, r.failure, r.differentiations,
                            r.factorizations, r.order, r.side, r.expanded, j.journey.node, j.journey.done,
                            j.journey.resets, ev.crowded, j.most, j.journey.trail_room > 0, status], dtype=np.int64),
        "rows": np.array([copy(places[i], n) for i in range(5)]).reshape(5, n),
        "block": copy(r.K, <int>block_length(j)),
        "events": np.array([copy(values[i], k) for i in range(6 if k else 0)]).reshape(6, k),
        "event_counts": np.array([[ev.count[i], ev.leaving[i], ev.fired[i]] for i in range(k)],
                                 dtype=np.int64).reshape(k, 3),
        **dict(zip(("times", "states", "pieces", "notes", "trail"), results)),
    }


cdef int require_order(Journey j) except -1:
    """The places that an implicit method keeps, which are whole numbers among the others, must be there."""
    if j.method.squares > 0 and not eomgen_is_sound(j.method, &j.run):
        raise ValueError("places in a matrix that are not there")
    return 0


cdef long thaw(Journey j, dict kept) except -1000:
    """Take the place of a journey that was frozen, and return its status.

    Raises
    ------
    ValueError
        The numbers cannot be those of such a journey.
    """
    cdef eomgen_run *r = &j.run
    cdef eomgen_events *ev = &j.events
    cdef int n = r.n, k = ev.n, i
    shapes = {"numbers": (9,), "counts": (17,), "rows": (5, n), "block": (block_length(j),), "events": (6, k),
              "event_counts": (k, 3)}
    found = {name: np.ascontiguousarray(kept[name], dtype=np.int64 if "counts" in name else float) for name in FROZEN}
    if any(found[name].shape != shape for name, shape in shapes.items()):
        raise ValueError("arrays of other sizes")
    whole, stored = found["counts"].tolist(), [np.ascontiguousarray(kept[name], dtype=float) for name in
                                               ("times", "states", "pieces", "notes", "trail")]
    widths = [1, n, 3 + n * (1 + j.method.rows_F), 2 + n, 1 + n]
    if any(array.size != len(array) * width for array, width in zip(stored, widths)):
        raise ValueError("results of other sizes")
    most_order = j.run.series.most if j.method.expands else 0
    at_times = j.journey.n_eval >= 0
    bounds = {7: most_order, 8: 1, 9: 1, 10: j.journey.n_nodes - 1, 11: max(j.journey.n_eval, 0), 15: 1, 16: 2}
    if any(not 0 <= whole[place] <= most for place, most in bounds.items()) or min(whole[1:7]) < -1000:
        raise ValueError("counts that cannot be")
    if len(stored[0]) != len(stored[1]) or (at_times and len(stored[0]) != whole[11]):
        raise ValueError("results that do not fit each other")
    if k and not (np.isin(found["event_counts"][:, 1], (-1, 0, 1)).all() and
                  np.isin(found["event_counts"][:, 2], (-1, 0, 1, 2)).all()):
        raise ValueError("events that cannot be")
    if len(stored[3]) and not np.isin(stored[3][:, 0], np.arange(k)).all():
        raise ValueError("events that are not there")
    numbers = found["numbers"].tolist()
    (r.t, r.t_old, r.step, r.h_abs, r.t_bound, r.hold, r.direction, r.failure_time, ev.last_reset) = numbers
    (r.interpolates, r.evaluations, r.rejected, r.steps, r.failure, r.differentiations, r.factorizations, r.order,
     r.side, r.expanded, j.journey.node, j.journey.done, j.journey.resets, ev.crowded, j.most) = whole[:15]
    cdef cnp.ndarray rows_ = found["rows"], block = found["block"], events = found["events"]
    cdef double *data = <double *>cnp.PyArray_DATA(rows_)
    cdef double **places = [r.y, r.y_old, r.f, r.failure_state, r.next]
    for i in range(5):
        memcpy(places[i], data + i * n, n * sizeof(double))
    memcpy(r.K, cnp.PyArray_DATA(block), cnp.PyArray_SIZE(block) * sizeof(double))
    require_order(j)
    data = <double *>cnp.PyArray_DATA(events)
    cdef double **values = [ev.g, ev.slope, ev.g_new, ev.slope_new, ev.size, ev.latest]
    for i in range(6 if k else 0):
        memcpy(values[i], data + i * k, k * sizeof(double))
    for i in range(k):
        ev.count[i], ev.leaving[i], ev.fired[i] = found["event_counts"][i].tolist()
    if at_times:
        j.times[:whole[11]], j.states[:whole[11]] = stored[0], stored[1]
        j.journey.stored, stored[0], stored[1] = whole[11], None, None
    j.stored = [[] if array is None or not len(array) else [array] for array in stored]
    if j.journey.trail_room > 0 and not whole[15]:  # there were too many
        j.journey.trail_room, j.stored[4] = 0, [np.empty((0, 1 + n))]
    j.journey.begun, j.seen = 1, r.steps
    return whole[16]
