"""States and accelerations -> the matrix Y by which a tree's forces are linear in inertial parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import EvaluationError, ProjectionError, cannot, ill_shaped
from ..runtime.argument_checks import read_numbers, read_vector
from ..runtime.constrained import free_motions
from ..runtime.kernels import into
from ..runtime.refusals import require_support

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- random states -----------------------------------------------------------------------------------------------------


def random_states(module: BoundModel, random: np.random.Generator, count: int) -> tuple[Array, Array, Array]:
    """Random q, v, a on the constraints, as fast as gravity makes the mechanism over its own length."""
    layout = module.layout
    s = layout.scales.q[:, None]
    rate = _rate(module)
    if not layout.n_c:
        long = np.array([kind == "length" for kind in layout.coordinate_kinds], dtype=bool)[:, None]
        q = np.where(long, layout.length, np.pi) * random.uniform(-1.0, 1.0, (module.n_q, count))
        for i, _ in layout.quaternion_slots:
            e = random.normal(size=(4, count))
            q[i : i + 4] = e / np.linalg.norm(e, axis=0)
        v, a = random.normal(size=(2, module.n_v, count))
        return q, rate * s * v, rate * rate * s * a
    states: list[Array] = []
    accelerations: list[Array] = []
    for _ in range(4 * count):
        if len(states) == count:
            break
        try:
            x, rates = _on_constraints(module, random, rate)
        except EvaluationError:
            continue
        states.append(x)
        accelerations.append(rates)
    if not states:
        raise ProjectionError(f"model {module.name!r}: no random state could be put on the constraints")
    x = np.array(states).T
    return x[: module.n_q], x[module.n_q :], np.array(accelerations).T


def _on_constraints(module: BoundModel, random: np.random.Generator, rate: float) -> tuple[Array, Array]:
    """A state x on the constraints, and accelerations that keep it there."""
    layout = module.layout
    n_q, scales = module.n_q, layout.scales
    q = scales.move(layout.q_reference, np.pi * random.uniform(-1.0, 1.0, module.n_v))
    x = module.project(np.concatenate([q, rate * scales.q * random.normal(size=module.n_v)]))
    free = free_motions(module.constraint_jacobian(x[:n_q], rows="all"), scales)
    a = module.rhs(0.0, x)[n_q:]  # keeps the constraints, as does every change along what they leave free
    return x, a + free @ (rate * rate * random.normal(size=free.shape[1]))


def _rate(module: BoundModel) -> float:
    """sqrt(g / L), at which gravity and inertia are alike; 1 where there is no gravity."""
    still = np.zeros(module.n_v)
    terms = module.kernels.inertial_terms(module.layout.q_reference, still, still)
    fall = float(np.linalg.norm(terms[:, 9:12], axis=1).max())
    return float(np.sqrt(fall / module.layout.length)) if fall > 0.0 else 1.0


# -- regressor ---------------------------------------------------------------------------------------------------------

# Y pi is what the joints must exert to move the bodies and to hold them against gravity, pi being per body its mass m,
# first moment m c and inertia I about the body's origin, in body axes (C. G. Atkeson, C. H. An, J. M. Hollerbach,
# Estimation of inertial parameters of manipulator loads and links, Int. J. Robotics Research 5(3) (1986), 101-119).


#: The inertial parameters of a body, in the order of columns; I is about the body's origin.
STANDARD = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
MOTION = 12  #: numbers of a body's motion in the kernel, before its parameters
CHUNK = 4_000_000  #: numbers held at once


def standard_names(module: BoundModel) -> tuple[str, ...]:
    """Names of the columns: ``m(link)``, ``mx(link)``, ..., ``Iyz(link)``, body by body."""
    if not module.n_bodies:
        raise cannot(f"model {module.name!r} has no bodies, hence no inertial parameters")
    return tuple(f"{which}({body})" for body in module.body_names for which in STANDARD)


def standard_parameters(module: BoundModel, /, p: Any = None) -> dict[str, float]:
    """Tell the ten inertial parameters of every body that the model has.

    Parameters
    ----------
    p : optional
        As for ``bind``.

    Returns
    -------
    dict of str to float
        ``m(link)`` (kg), ``mx(link)``, ``my``, ``mz`` (first moment, kg m), ``Ixx(link)``, ``Iyy``, ``Izz``, ``Ixy``,
        ``Ixz``, ``Iyz`` (kg m^2, about the body's origin, products with the tensor's own sign), in body axes.
    """
    names = standard_names(module)
    state, still = module.layout.q_reference, np.zeros(module.layout.n_v)  # of states too
    terms = module.kernels.inertial_terms(state, still, still, p=_values(module, p, "standard_parameters"))
    return dict(zip(names, map(float, terms[:, MOTION:].ravel()), strict=True))


def regressor(
    module: BoundModel,
    /,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    p: Any = None,
    u: Any = None,
    out: Array | None = None,
    t: float = 0.0,
) -> Array:
    """Compute Y(q, v, a): Y pi are the generalized forces of inertia and gravity on the spanning tree.

    Parameters
    ----------
    q, v, a : (n_q,), (n_v,), (n_v,) arrays, or (..., k)
    p, u, t, out : optional
        As for ``inverse_dynamics``.

    Returns
    -------
    (n_v, 10 n_bodies) or (n_v, 10 n_bodies, k) array
        Columns in the order of :meth:`standard_parameters`.

    Raises
    ------
    UsageError
        A wrong shape, or a model without bodies.
    UnavailableError
        The model has first-order states.

    Notes
    -----
    ``inverse_dynamics(q, v, a)`` is Y pi and what no body's inertia makes: springs, dampers and other force elements,
    inputs, and the inertia of drives (``armature``).  :meth:`inertial_remainder` is that part.
    """
    require_support(module.layout, "regressor")
    names, (q, v, a), single = _motion(module, q, v, a)
    values, count, n_v = _values(module, p, "regressor"), q.shape[1], module.n_v
    result = np.empty((n_v, len(names), count))
    width = max(1, CHUNK // max(1, module.n_bodies * max((MOTION + 10) * n_v, 60)))
    for k in range(0, count, width):
        some = slice(k, k + width)
        result[:, :, some] = _columns(module, q[:, some], v[:, some], a[:, some], values, t)
    return into(out, np.ascontiguousarray(result[..., 0] if single else result))


def inertial_remainder(
    module: BoundModel,
    /,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    p: Any = None,
    u: Any = None,
    out: Array | None = None,
    t: float = 0.0,
) -> Array:
    """Compute the part of ``inverse_dynamics`` that is not Y pi: force elements, inputs and the inertia of drives.

    Parameters
    ----------
    q, v, a, p, u, out, t
        As for :meth:`regressor`.

    Returns
    -------
    (n_v,) or (n_v, k) array
    """
    p = _values(module, p, "inertial_remainder")
    pi = np.array(list(standard_parameters(module, p).values()))
    whole = module.inverse_dynamics(q, v, a, p=p, u=module.kernels.fail.vector("u", u, module.u), t=t)
    return into(out, whole - np.tensordot(pi, regressor(module, q, v, a, p=p, t=t), (0, 1)))


def _values(module: BoundModel, p: Any, call: str) -> Any:
    p = module.kernels.fail.vector("p", p, module.p)
    return None if p is None else read_vector(f"p of {call}, one set for all states,", p, module.n_p)


def _motion(
    module: BoundModel, q: ArrayLike, v: ArrayLike, a: ArrayLike
) -> tuple[tuple[str, ...], tuple[Array, Array, Array], bool]:
    names = standard_names(module)
    arrays = [np.asarray(read_numbers(name, x), dtype=float) for name, x in (("q", q), ("v", v), ("a", a))]
    sizes = (module.n_q, module.n_v, module.n_v)
    single = all(x.ndim == 1 for x in arrays)
    arrays = [x[:, None] if single else x for x in arrays]
    shapes = {x.shape[1:] for x in arrays}
    if [x.shape[:1] for x in arrays] != [(n,) for n in sizes] or len(shapes) != 1 or arrays[0].ndim != 2:
        raw = ", ".join(str(np.shape(x)) for x in (q, v, a))
        wanted = ", ".join(f"({n},)" for n in sizes)
        raise ill_shaped(f"q, v, a must have shapes {wanted}, or (..., k) for k states, not {raw}")
    return names, (arrays[0], arrays[1], arrays[2]), single


def _columns(module: BoundModel, q: Array, v: Array, a: Array, p: Any, t: float) -> Array:
    """Y of k states, (n_v, 10 n_bodies, k)."""
    kernel = module.kernels.inertial_terms
    n_v, count = v.shape
    omega, _, alpha, lifted = np.moveaxis(_parts(kernel(q, v, a, p=p, t=t)), 1, 0)
    twists = kernel(  # linear in v: those of unit velocities are the columns of the bodies' Jacobians
        np.repeat(q, n_v, axis=1), np.tile(np.eye(n_v), count), np.zeros((n_v, n_v * count)), p=p, t=t
    )
    turning, moving = np.moveaxis(_parts(twists)[:, :2].reshape(-1, 2, 3, count, n_v), 1, 0)
    force, moment = _wrenches(omega, alpha, lifted)
    result = np.einsum("bikj,bimk->jbmk", moving, force) + np.einsum("bikj,bimk->jbmk", turning, moment)
    return np.asarray(result.reshape(n_v, -1, count))


def _parts(terms: Array) -> Array:
    return np.asarray(terms[:, :MOTION].reshape(len(terms), 4, 3, -1))


def _wrenches(omega: Array, alpha: Array, lifted: Array) -> tuple[Array, Array]:
    """Force and moment about the body's origin for each parameter, (n_bodies, 3, 10, k) of (n_bodies, 3, k).

    force = m A + ([alpha] + [w][w]) mc;  moment = -[A] mc + L(alpha) I + [w] L(w) I, where I w = L(w) (xx, .., yz).
    """
    bodies, _, count = omega.shape
    force, moment = np.zeros((2, bodies, 3, 10, count))
    force[:, :, 0] = lifted
    W = _skew(omega)
    force[:, :, 1:4] = _skew(alpha) + np.einsum("bijk,bjmk->bimk", W, W)
    moment[:, :, 1:4] = -_skew(lifted)
    moment[:, :, 4:] = _inertia_times(alpha) + np.einsum("bijk,bjmk->bimk", W, _inertia_times(omega))
    return force, moment


def _skew(x: Array) -> Array:
    """[x]: [x] y = x cross y, of (n_bodies, 3, k)."""
    result = np.zeros((len(x), 3, 3, x.shape[-1]))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[:, k, j], result[:, j, k] = x[:, i], -x[:, i]
    return result


def _inertia_times(x: Array) -> Array:
    """L: I x = L (xx, yy, zz, xy, xz, yz)."""
    result = np.zeros((len(x), 3, 6, x.shape[-1]))
    for i in range(3):
        result[:, i, i] = x[:, i]
    for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=3):
        result[:, i, column], result[:, j, column] = x[:, j], x[:, i]
    return result
