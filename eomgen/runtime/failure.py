"""Status code of a kernel, time, state -> a named exception that says where, what and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array, correlated
from ..base.kernel_table import NAMED
from ..base.limits.numbers import LARGE_ROOT, SINGULAR, TINY_ROOT
from ..base.limits.positions import FLAT, LOCKED
from ..errors import STATUS, EvaluationError, UsageError
from .layout import Layout

# -- causes ------------------------------------------------------------------------------------------------------------


def diagnose(kernels: Any, status: int, t: float, x: Array, p: Array | None, u: Array | None) -> str:
    """Names what a failure at a state is due to, as far as it can be told, with p and u of the call."""
    layout, q = kernels.layout, x[: kernels.layout.n_q]
    if status == 1:
        return _not_finite(kernels, t, x, p, u)
    if status == 2:
        M = kernels.kernel("embedded_mass_matrix", nan=True)(q, t=t, p=p, u=u)
        if not np.isfinite(M).all():
            return ""
        values, vectors = algebra.eigh(correlated(M))  # whatever the units of the coordinates
        if layout.info.indefinite:
            return f"the eigenvalue nearest to 0 is {values[np.abs(values).argmin()]:.2g}"
        if values[0] > SINGULAR:
            return "because its reactions are not unique; method='embedding' does not need them"
        weights = np.abs(vectors[:, 0])
        moved = zip(layout.independent, weights, strict=True)
        names = [layout.velocity_labels[i] for i, w in moved if w > 0.1 * weights.max()]
        moving = " and ".join(names) if len(names) < 5 else ", ".join(names[:4]) + ", ..."
        size = "negative" if values[0] < -SINGULAR else "no"
        return f"moving {moving} meets {size} inertia (smallest eigenvalue {values[0]:.2g})"
    if status == 3:
        e = kernels.kernel("constraints", nan=True)(q, t=t, p=p, u=u)
        if not np.isfinite(e).all() or not e.size:
            return ""
        worst = int(np.abs(layout.scales.residual(e)).argmax())
        return f"largest residual at {layout.constraint_labels[worst]}, {abs(e[worst]):.3g}"
    if status == 4:
        return f"independent are {', '.join(layout.velocity_labels[i] for i in layout.independent)}"
    return ""


def _not_finite(kernels: Any, t: float, x: Array, p: Array | None, u: Array | None) -> str:
    """Names what makes a result that is no number: inputs, loads of elements, the mass matrix."""
    layout = kernels.layout
    inputs = kernels.context.u if u is None else u
    bad = [name for name, value in zip(layout.u, inputs, strict=True) if not np.isfinite(value).all()]
    if bad:
        return f"the input{'s' * (len(bad) > 1)} {', '.join(bad)} given {'are' if len(bad) > 1 else 'is'} not"
    if layout.sizes.n_finite_forces and "finite_forces" in kernels.core.names and x.size >= layout.n_x:
        finite = kernels.kernel("finite_forces", nan=True)(x[: layout.n_x], t=t, p=p, u=u)
        bad = [name for name, fine in zip(layout.fragile_forces, finite, strict=True) if not fine > 0]
        known = layout.info.not_finite_where
        own = {known[name]: None for name in bad if name in known}
        if bad and set(bad) <= set(layout.reaction_laws):
            return (
                f"the forces of {' and '.join(bad)} depend on reactions which they change so strongly that the motion "
                "may have several solutions or none (Painleve's paradox); give smaller coefficients"
                f"{''.join(f'; or {why}' for why in own)}"
            )
        held = [name for name in bad if name in layout.switches]
        if held:
            return f"the equations of {' and '.join(held)} are not (outside their domain, or a wheel lies flat)"
        loads = [name for name in bad if name not in layout.reaction_laws]
        if loads:
            ends = [] if known.keys() >= {*loads} else ["its ends meet or lie inside the cylinder"]
            why = ", or ".join([*own, *ends, "its law is outside its domain"])
            return f"the loads of {' and '.join(loads)} are not ({why})"
    if "mass_matrix" in kernels.core.names and x.size >= layout.n_q:
        M = kernels.kernel("mass_matrix", nan=True)(x[: layout.n_q], t=t, p=p, u=u)
        if not np.isfinite(M).all():
            return "the mass matrix is not (a mass, an inertia or a length outside the domain of its law)"
    if layout.states and "rhs" in kernels.core.names and x.size == layout.n_x:
        fine = np.isfinite(kernels.kernel("rhs", nan=True)(t, x, p=p, u=u))
        bad = [name for name, known in zip(layout.x, fine, strict=True) if not known]
        if bad and {*bad} <= {*layout.states}:
            many = len(bad) > 1
            return f"the rate{'s' * many} of {', '.join(bad)} {'are' if many else 'is'} not (outside the law's domain)"
    return ""


# -- exceptions --------------------------------------------------------------------------------------------------------


Own = Array | None  #: p or u of a call; None for those that are bound
SHOWN = 8  #: coordinates listed in a message

WORDS = {
    1: (
        "the result is not finite",
        "look for an input that is not a number, a division by zero, or a root or logarithm of a negative number",
    ),
    2: (
        "the mass matrix of the degrees of freedom is not positive definite",
        "give the bodies behind the named coordinates mass or inertia",
    ),
    3: (
        "the state could not be brought onto the constraints",
        "start from an assembled state (x0), or look for a position the mechanism cannot reach",
    ),
    4: (
        "the independent coordinates cannot move the mechanism here (dead centre or singular position)",
        "choose other independent coordinates, or start a little away from a change point",
    ),
    5: (
        "because of rounding the linear system of the equations of motion could not be solved",
        "compile with method='embedding', or look for masses or lengths of very different sizes",
    ),
}


class Fail:
    """Raises the exception for a failed kernel; what cores call as ``fail(name, status, t, x)``.

    p and u follow where the call was given any; the kernels of the model tell what is to blame.
    """

    def __init__(self, kernels: Any) -> None:
        self.kernels = kernels
        self.layout: Layout = kernels.layout

    def vector(self, label: str, raw: Any, bound: Array) -> Any:
        """The p or u of a call, as an array where it is given by name; the others are as bound."""
        what, names = ("parameter", self.layout.p) if label == "p" else ("input", self.layout.u)
        return self.layout.values(what, names, raw, bound) if isinstance(raw, Mapping) else raw

    def trouble(self, x: Array, t: float = 0.0, p: Own = None) -> tuple[str, str] | None:
        """What is wrong at a state with a rolling disc or with how a rotation is described, and the remedy."""
        return flat_disc(self.kernels, x, t, p) or rotation_trouble(self.layout, x)

    def __call__(self, name: str, status: int, t: float, x: Array, p: Own = None, u: Own = None) -> None:
        raise self.exception(name, status, t, x, p, u)

    def exception(self, name: str, status: int, t: float, x: Array, p: Own = None, u: Own = None) -> EvaluationError:
        """The exception, not raised."""
        what, remedy = WORDS.get(status, (f"the kernel returned status {status}", "this is a defect of eomgen"))
        names = self._names(name)
        at, blame = place(names, x), ""
        if not np.isfinite(x).all() and names:
            bad = ~np.isfinite(x)
            raw = place([n for n, fault in zip(names, bad, strict=True) if fault], x[bad])
            at, blame = "", f": {raw[2:]} {'is' if bad.sum() == 1 else 'are'} given"
            remedy = "check the state given"
        elif names and (trouble := no_rotation(self.layout, x)):
            what, remedy = trouble
            status = 1
        elif status == 2 and (massless := self.layout.info.no_inertia):
            what, remedy = f"the model is for kinematics only: {massless}", "give those bodies mass or inertia"
        elif status in (1, 2, 4) and names and (trouble := self.trouble(x, t, p)):
            blame, remedy = f": {trouble[0]}", trouble[1]
        elif status == 1 and (large := [n for n, value in zip(names, x, strict=False) if abs(value) > LARGE_ROOT]):
            blame, remedy = f": squares of {', '.join(large[:SHOWN])} overflow", "check the state given"
        elif name == "resets" and (switches := self.layout.switches):
            held = ", ".join(one for one, state in switches.items() if x[self.layout.x.index(state)] > 0.5)
            blame = (
                f": not finite, or contrary to a constraint that is closed ({held or 'none'}), closes or never opens"
            )
            remedy = "give new values that obey it, or open it first (releases)"
        elif status == 4 and not len(self.layout.independent):
            what = "the constraints are singular here, and the mechanism has no degree of freedom"
            remedy = "start a little away from this position, or change the dimensions"
        elif names or not self.layout.n_x:
            if status == 5 and (result := self._diagnose(1, t, x, p, u)):
                status, (what, remedy) = 1, WORDS[1]  # a solver cannot tell a law that is no number from rounding
            else:
                result = self._diagnose(status, t, x, p, u)
            blame = f": {result}" if result else ""
        if status == 1 and name == "jacobian" and not blame:
            remedy += ", or a root of 0, which has no derivative"
        error = STATUS.get(status, EvaluationError)
        return error(f"{name} at t = {t:.6g}{at}: {what}{blame}; {remedy}", t, x)

    def _diagnose(self, status: int, t: float, x: Array, p: Own, u: Own) -> str:
        try:
            return diagnose(self.kernels, status, t, x, p, u)
        except UsageError:  # a kernel that would tell was not generated
            return ""

    def _names(self, kernel: str) -> Sequence[str]:
        known = {("q",): self.layout.q, ("q", "v"): self.layout.x, ("q", "v", "a"): self.layout.x + self.layout.a}
        return known.get(NAMED[kernel].inputs if kernel in NAMED else (), ())


def no_rotation(layout: Layout, x: Array) -> tuple[str, str] | None:
    """Euler parameters whose squares are all zero at a state, and the remedy; None if there are none."""
    for i, _ in layout.quaternion_slots:
        if not np.abs(x[i : i + 4]).max() > TINY_ROOT:
            four = f"{layout.q[i]} .. {layout.q[i + 3]}"
            return f"the Euler parameters {four} are all zero", f"give a rotation ({layout.q[i]} = 1 for no rotation)"
    return None


def flat_disc(kernels: Any, x: Array, t: float, p: Array | None) -> tuple[str, str] | None:
    """A rolling disc that lies flat at a state, and the remedy; None if none does."""
    layout = kernels.layout
    discs = layout.info.rolling_discs
    if not discs or "poses" not in kernels.core.names or len(x) < layout.n_q:
        return None
    poses = kernels.kernel("poses", nan=True)
    turns = np.concatenate([poses(x[: layout.n_q], t=t, p=p)[:, :3, :3], np.eye(3)[None]])  # the last is that of ground
    for name, wheel, axle, plane, normal in discs:
        across = np.cross(turns[wheel] @ axle, turns[plane] @ normal)
        if np.linalg.norm(across) < FLAT:
            what = f"constraint {name!r}: the disc lies flat (axle along the plane's normal)"
            return what, "the disc has fallen, or nearly; end the run before that, for example with an event"
    return None


def rotation_trouble(layout: Layout, x: Array) -> tuple[str, str] | None:
    """What is wrong with how a rotation is described at a state, and the remedy; None if nothing is."""
    if trouble := no_rotation(layout, x):
        return trouble
    for joint, k, vanishing in layout.info.euler_angles:
        if abs(np.cos(x[k]) if vanishing == "cos" else np.sin(x[k])) < LOCKED:
            what = f"the Euler angles of joint {joint!r} are singular here ({layout.q[k]} = {np.degrees(x[k]):.6g} deg)"
            return what, f"describe joint {joint!r} with rotation: euler_parameters, or with another sequence"
    return None


def place(names: Sequence[str], x: Array) -> str:
    """``, theta = 0.3, s = 0.4``: the first coordinates of a state."""
    shown = [f"{name} = {value:.6g}" for name, value in zip(names, x, strict=False)][:SHOWN]
    return "".join(f", {item}" for item in shown) + (", ..." if len(names) > SHOWN else "")
