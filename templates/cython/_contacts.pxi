# Impulses of rigid contacts.

cdef extern from "eomgen_contacts.h" nogil:
    int eomgen_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                              double tolerance, int most, int *count, double *residual)


def solve_contacts(W, c, friction, start, double tolerance, int most):
    """Impulses (m, d) of rigid contacts, iterations and residual; see numeric/contact_impulses.py.

    Parameters
    ----------
    W : (m d, m d) ndarray
    c, start : (m, d) ndarray
    friction : (m,) ndarray
    tolerance : float
    most : int
    """
    cdef int m = c.shape[0], d = c.shape[1], count = 0, failed
    cdef cnp.ndarray compliance = np.ascontiguousarray(W, dtype=float), free = np.ascontiguousarray(c, dtype=float)
    cdef cnp.ndarray coefficients = np.ascontiguousarray(friction, dtype=float)
    cdef cnp.ndarray P = np.array(start, dtype=float, order="C")
    cdef double residual = 0.0
    if not 1 <= d <= 3 or P.shape[0] != m or P.shape[1] != d or compliance.size != m*d*m*d or coefficients.size != m:
        raise ValueError("contacts have shapes that do not belong together")
    with nogil:
        failed = eomgen_solve_contacts(
            m, d, <const double *>cnp.PyArray_DATA(compliance), <const double *>cnp.PyArray_DATA(free),
            <const double *>cnp.PyArray_DATA(coefficients), <double *>cnp.PyArray_DATA(P), tolerance, most, &count,
            &residual,
        )
    if failed:
        raise MemoryError("there is no memory for the matrix of contacts")
    return P, count, residual
