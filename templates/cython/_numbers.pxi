# Numbers: what a call is given -> contiguous float64 arrays, or an error that says what was wanted.

# What Python or NumPy would make a float of, or NaN, though it is no real number.
cdef tuple UNREAL = (str, bytes, complex, np.complexfloating, np.datetime64, np.timedelta64, type(None))


cdef cnp.ndarray doubles(object value, str label, object error, str name=None, int n=-1):
    """The value as an aligned float64 array: itself if it is one, whatever its strides; else a converted copy.

    What is refused is told as the argument `label` of kernel `name`, of n rows.
    """
    if (cnp.PyArray_CheckExact(value) and cnp.PyArray_TYPE(<cnp.ndarray>value) == cnp.NPY_DOUBLE
            and cnp.PyArray_ISBEHAVED_RO(<cnp.ndarray>value)):
        return value
    return converted(value, label, error, name, n)


cdef cnp.ndarray converted(object value, str label, object error, str name, int n):
    """Real numbers, by the rule of as_real in eomgen's runtime/room.py."""
    try:
        array = np.asarray(value)
        kind = array.dtype.kind
        real = kind in "biuf" or kind == "O" and not any([isinstance(one, UNREAL) for one in array.flat])
        if real and not (isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value)):
            return np.require(array, np.float64, "A")
    except (TypeError, ValueError, OverflowError):
        pass
    if label in ("p", "u") and isinstance(value, dict):
        raise error(f"{label} of a call is an array in the order of {label}_names; by name: bind({label}={{...}})")
    if n == SCALAR:
        wanted = "be a number" if name is None else "be a real number, or (k,)"
    else:
        shape = "" if n < 0 else f", ({n},)" if name is None else f", ({n},) or ({n}, k)"
        wanted = f"hold real numbers{shape}"
    raise error(f"{called(label, name, n)} must {wanted}, not {shown(value)}")


cdef str called(str label, str name, int n):
    """What users call an argument: the x of some kernels is q."""
    label = "q" if label == "x" and n == len(_FACTS.get("q_names", ())) else label
    return label if name is None else f"{label} of {name}"


cdef str shown(object value):
    text = " ".join(repr(value).split())
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
            raise error(f"{label} must be a number, not {shown(t)}")
        raise error(f"{label} of {name} must be a number or have shape (k,), not {(<object>array).shape}")
    return (<double *>cnp.PyArray_DATA(array))[0]


cdef cnp.ndarray vector(object value, int n, str label, object error):
    """The value as a contiguous float64 vector of n numbers."""
    cdef cnp.ndarray array = cnp.PyArray_GETCONTIGUOUS(doubles(value, label, error, None, n))
    if array.ndim != 1 or cnp.PyArray_DIM(array, 0) != n:
        raise error(f"{label} must have shape ({n},), not {(<object>array).shape}")
    return array
