# Impulses of rigid contacts.

cdef extern from "eomgen_contacts.h" nogil:
    void eomgen_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                               double tolerance, int most, double *work, int *numbers, int *count, double *residual)


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
    cdef int m = c.shape[0], d = c.shape[1], n = m*d, count = 0
    cdef cnp.ndarray compliance = np.ascontiguousarray(W, dtype=float), free = np.ascontiguousarray(c, dtype=float)
    cdef cnp.ndarray coefficients = np.ascontiguousarray(friction, dtype=float)
    cdef cnp.ndarray P = np.array(start, dtype=float, order="C")
    cdef cnp.ndarray work = np.empty(n*(n + 8) + 3*m + 1), numbers = np.empty(n + m + 1, dtype=np.intc)
    cdef double residual = 0.0
    if not 1 <= d <= 3 or P.shape[0] != m or P.shape[1] != d or compliance.size != m*d*m*d or coefficients.size != m:
        raise ValueError("contacts have shapes that do not belong together")
    with nogil:
        eomgen_solve_contacts(
            m, d, <const double *>cnp.PyArray_DATA(compliance), <const double *>cnp.PyArray_DATA(free),
            <const double *>cnp.PyArray_DATA(coefficients), <double *>cnp.PyArray_DATA(P), tolerance, most,
            <double *>cnp.PyArray_DATA(work), <int *>cnp.PyArray_DATA(numbers), &count, &residual,
        )
    return P, count, residual
