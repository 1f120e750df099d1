"""A core (compiled or NumPy), parameters and inputs -> the calls of one model, and why they fail where they do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache, partial
from importlib import import_module
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices, correlated
from ..base.assembly import ConstraintSystem, CutJoints
from ..base.files import find_module
from ..base.kernel_table import NAMED
from ..base.limits.numbers import LARGE_ROOT, SINGULAR, TINY_ROOT
from ..base.limits.positions import FLAT, LOCKED
from ..errors import STATUS, EvaluationError, UsageError, cannot, ill_shaped, no_choice, not_finite
from .argument_checks import fitting, read_numbers
from .layout import Layout, at_parameters
from .refusals import require_support

if TYPE_CHECKING:
    from .protocols import Call, Core

# -- cores -------------------------------------------------------------------------------------------------------------

# A core is the part that differs between targets: a Model of eomgen._native or of a package's own.  All its kernels are
# of one class (native/_kernel.pxi), whose arguments are named and ordered as ORDERS says.


class LazyCore:
    """A core that offers further kernels, compiled or loaded at the first call of any of them.

    Most runs need few of the kernels, and compiling those of the analyses as well would make every start slower.  An
    exported package has them all from the beginning.

    ``load(group)`` makes the core of the ``lazy`` kernels that have :attr:`~..base.kernel_table.Kernel.lazy` in common;
    ``further`` holds those made so far.
    """

    def __init__(self, core: Core, lazy: Sequence[str], load: Callable[[str], Core]) -> None:
        self.core = core
        self.names = (*core.names, *(name for name in lazy if name not in core.names))
        self.load = load
        self.further: dict[str, Core] = {}
        self.run = core.run  # here, because every run asks for it

    def having(self, name: str) -> Core:
        """The core with a rarer kernel, made now if there is none yet."""
        group = str(NAMED[name].lazy)
        if group not in self.further:
            self.further[group] = self.load(group)
        return self.further[group]

    def kernel(self, name: str, context: Any, *options: Any, **more: Any) -> Any:
        """A kernel; a rarer one is made when it is first called."""
        if name in self.names and name not in self.core.names and not more.keys() & {"load", "find"}:
            more["load"] = lambda: self.having(name).context(context.p, context.u, ill_shaped)
        return self.core.kernel(name, context, *options, **more)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.core, name)


def eager(core: Any) -> Any:
    """The core that was there from the beginning, which has the right-hand side and the steppers."""
    return core.core if isinstance(core, LazyCore) else core


# -- kernels -----------------------------------------------------------------------------------------------------------


ENERGY = (
    "the energy of the model {!r} is not known: its equations of motion are given without kinetic_energy; "
    "give equations.kinetic_energy, and equations.potential_energy if forces have a potential"
)
#: Kind of a kernel -> its arguments in order, and how many of them must be given.
ORDERS: dict[str, tuple[tuple[str, ...], int]] = {
    "timed": (("t", "x", "p", "u", "out"), 2),
    "state": (("x", "p", "u", "out", "t"), 1),
    "motion": (("q", "v", "a", "p", "u", "out", "t"), 3),
    "project": (("x", "t", "p", "u", "out"), 1),
    "jacobian": (("t", "x", "p", "u", "out", "wrt"), 2),
    "rows": (("q", "p", "u", "out", "t", "rows"), 1),
}


class Kernels:
    """The calls of one model, sharing one set of parameters and inputs.

    ``kernels.poses`` is the kernel of this name.  Here all are as in C: velocities are [v; s], with first-order states
    among them, and rows those of all constraints; :func:`public_call` gives what users see.  They are made anew when
    requested: what is kept lives as long as Fail, which refers back.

    Parameters
    ----------
    core : Core
    layout : Layout
    p, u : arrays, optional
        Parameters (n_p,) and inputs (n_u,); the declared values by default.
    """

    def __init__(self, core: Core, layout: Layout, p: Array | None = None, u: Array | None = None) -> None:
        self.core = core
        self.layout = layout
        self.context = core.context(p, u, ill_shaped)
        if p is not None and "scales" in core.names:
            shape, order = layout.shape("scales"), ORDERS["state"]
            scales = core.kernel("scales", self.context, shape, self._unscaled, *order, False, ill_shaped)
            self.layout = layout = layout.sized(scales(np.empty(0)))
        if p is not None and (layout.info.start_terms or layout.info.start_fixed):
            self.layout = layout = at_parameters(layout, self.context.p)
        self.fail = Fail(self)
        self._derivatives: dict[str, Call] = {}

    def __getattr__(self, name: str) -> Call:
        if name not in NAMED:
            raise AttributeError(f"there is no kernel {name!r}", name=name)
        return self.kernel(name)

    def _unscaled(self, *_: Any) -> None:
        """Refuse parameters whose lengths and masses scale nothing."""
        raw = zip(self.layout.p, self.context.p, strict=True)
        bad = [f"{name} = {value:.6g}" for name, value in raw if not np.isfinite(value)]
        raise not_finite(f"the sizes computed from the parameters are not finite{': ' * bool(bad)}{', '.join(bad)}")

    def kernel(
        self, name: str, nan: bool = False, kind: str = "", pick: Indices | None = None, choose: Any = None
    ) -> Call:
        """A kernel.

        Parameters
        ----------
        name : str
        nan : bool
            NaN for recoverable failures.
        kind : str
            Of its arguments, one of ORDERS; that of the table of kernels by default.
        pick : array of int, optional
            Places of the result among the numbers of the kernel, in its shape; all of them by default.
        choose : callable, optional
            Of its last argument -> the kernel that is called instead, or None for this one.
        """
        layout, shape, kind = self.layout, self.layout.shape(name), kind or NAMED[name].kind
        result = shape if pick is None else pick.shape
        if name in self.core.names:
            places = None if pick is None or np.array_equal(pick, _places(shape)) else pick.ravel()
            make = self.core.kernel
            collected = make(name, self.context, result, self.fail, *ORDERS[kind], nan, ill_shaped, places, choose)
            return cast("Call", collected)
        if 0 in shape:
            n = layout.inputs(name)
            return self.derived(name, kind, lambda *x, **_: np.zeros((*result, *batch_of(x, n))), choose)
        if not layout.n_c and name == "project":
            return self.derived(name, kind, self._normalized)
        if not layout.rank and name == "embedded_mass_matrix":
            every = _places((layout.n_v, layout.n_v))[np.ix_(layout.independent, layout.independent)]
            return self.kernel("mass_matrix", nan, kind, every if pick is None else every.ravel()[pick])
        return self.refused(name, kind, partial(self.missing, name))

    def missing(self, name: str) -> UsageError:
        """Why the model has no kernel of a name."""
        if name == "energy" and not self.layout.energy_known:
            return cannot(ENERGY.format(self.layout.name))
        message = f"model {self.layout.name!r} was generated without the kernel {name!r}"
        return cannot(f"{message}; compile again with kernels=None for all, or name it in kernels")

    def refused(self, name: str, kind: str, load: Callable[[], Any]) -> Call:
        """In place of a kernel that the model cannot have: ``load()`` raises why, or returns it, at a call."""
        return self._made(name, kind, load=load)

    def derived(self, name: str, kind: str, find: Callable[..., Array], choose: Any = None) -> Call:
        """A call of a kind that is made of kernels: ``find(*states, p=, u=, t=)`` -> its result."""

        def call(*states: Any, out: Array | None = None, **raw: Any) -> Array:
            return into(out, find(*states, **raw))

        return self._made(name, kind, find=call, choose=choose)

    def _made(self, name: str, kind: str, **how: Any) -> Call:
        made = self.core.kernel(name, self.context, (), self.fail, *ORDERS[kind], False, ill_shaped, **how)
        return cast("Call", made)

    def derivative(self, name: str) -> Call:
        """The kernel ``input_jacobian`` or ``parameter_jacobian``, made once."""
        if name not in self._derivatives:
            refused = self.layout.general_rates or not self.layout.projects
            load = partial(require_support, self.layout, name)
            self._derivatives[name] = self.refused(name, "timed", load) if refused else self.kernel(name)
        return self._derivatives[name]

    def rows(self, name: str, chosen: Any, t: float, x: Array, u: Array | None = None) -> Array:
        """Rows of a timed kernel at one state; the others need not be numbers there."""
        result = np.asarray(self.kernel(name, nan=True)(t, x, u=u)[chosen])
        if not np.isfinite(result).all():
            self.kernel(name)(t, x, u=u)  # tells what is wrong
        return result

    def _normalized(self, x: Any, **raw: Any) -> Array:
        """The projection of a tree: nothing to do but for the length of Euler parameters."""
        result = np.array(read_numbers("x", x))
        batch_of((result,), self.layout.n_x)
        for i, _ in self.layout.quaternion_slots:
            result[i : i + 4] /= np.sqrt((result[i : i + 4] ** 2).sum(axis=0))
        return result


def _places(shape: tuple[int, ...]) -> Indices:
    """Where the numbers of a result lie."""
    return np.arange(prod(shape)).reshape(shape)


def batch_of(arrays: Sequence[Any], n: int) -> tuple[int, ...]:
    """The last axis (k,) of n numbers for each of k states, none of one state; of several arrays n are all theirs."""
    shape = read_numbers("x", arrays[0]).shape
    if len(arrays) == 1 and (shape[:1] != (n,) or len(shape) > 2):
        raise ill_shaped(f"x must have shape ({n},) or ({n}, k), not {shape}")
    return shape[1:]


def into(out: Array | None, result: Array) -> Array:
    """A result, in the array that was given for it."""
    if out is not None:
        fitting(out, result.shape)[...] = result
    return result if out is None else out


# -- what users call ---------------------------------------------------------------------------------------------------


def public_call(kernels: Kernels, name: str) -> Call:
    """The call of a module: of M, h and the constraints without first-order states, of the independent rows alone.

    A state is a velocity of unit inertia that no constraint touches, so that its rows and columns are left out.
    """
    layout = kernels.layout
    n, free = layout.moving, layout.n_dof - layout.n_states
    if name == "jacobian":
        return kernels.kernel(name, kind="jacobian", choose=partial(_differentiated, kernels))
    if name == "project":
        return kernels.kernel(name, kind="project")
    if name in PARTS:
        return _centroidal(kernels, name)
    if name in ("input_jacobian", "parameter_jacobian"):
        return kernels.derivative(name)
    if name == "inverse_dynamics" and layout.reaction_laws:
        return kernels.refused(name, "motion", partial(require_support, layout, name))
    if name == "inverse_dynamics" and layout.n_states:
        return kernels.derived(name, "motion", partial(_mechanical_forces, kernels))
    if name in ("constraints", "constraint_jacobian", "velocity_constraints"):
        every, rows = _places(layout.shape(name)), layout.rows
        every = every[:, :n] if name == "constraint_jacobian" else every
        whole = cache(lambda: kernels.kernel(name, pick=every))

        def choose(which: Any) -> Call | None:
            if not isinstance(which, str) or which not in ("independent", "all"):
                raise no_choice(f"rows must be 'independent' or 'all', not {which!r}")
            return whole() if which == "all" else None

        return kernels.kernel(name, False, "rows", every[rows[rows < len(every)]], choose)
    mechanical: dict[str, Any] = {
        "mass_matrix": np.s_[:n, :n],
        "embedded_mass_matrix": np.s_[:free, :free],
        "bias": np.s_[:n],
    }
    if layout.n_states and name in mechanical:
        return kernels.kernel(name, pick=_places(layout.shape(name))[mechanical[name]])
    return kernels.kernel(name)


def _differentiated(kernels: Kernels, wrt: Any) -> Call | None:
    """The Jacobian by something else than the state."""
    if wrt is None or (isinstance(wrt, str) and wrt == "x"):
        return None
    if not isinstance(wrt, str) or wrt not in ("u", "p"):
        raise ill_shaped(f"wrt must be 'x' (the state), 'u' (the inputs) or 'p' (the parameters), not {wrt!r}")
    return kernels.derivative("input_jacobian" if wrt == "u" else "parameter_jacobian")


def _mechanical_forces(kernels: Kernels, q: Any, v: Any, a: Any, **raw: Any) -> Array:
    """The inverse dynamics of a model with first-order states, whose rates may be left out."""
    layout, states, rates = kernels.layout, read_numbers("v", v), read_numbers("a", a)
    if states.shape[:1] != (layout.n_v,):
        raise ill_shaped(
            f"inverse_dynamics of a model with first-order states takes v = [v; s], ({layout.n_v},) or "
            f"({layout.n_v}, k), not {states.shape}: forces depend on the states {', '.join(layout.states)}, which "
            "come after the velocities"
        )
    if rates.shape[:1] == (layout.moving,):
        rates = np.concatenate([rates, np.zeros((layout.n_states, *rates.shape[1:]))])
    return np.array(kernels.inverse_dynamics(q, states, rates, **raw)[: layout.moving])


#: Sums over all bodies, in ground axes, which are parts of the kernel ``centroidal``.
PARTS = ("center_of_mass", "com_jacobian", "momentum", "centroidal_inertia")


def _centroidal(kernels: Kernels, name: str) -> Call:
    layout, whole, n_v = kernels.layout, kernels.centroidal, kernels.layout.n_v
    places: tuple[tuple[int, tuple[int, ...]], ...]
    places = (0, (3,)), (3, (3, n_v)), (3 + 3 * n_v, (6,)), (9 + 3 * n_v, (3, 3))
    (start, shape), rates = places[PARTS.index(name)], name == "momentum"
    n = layout.n_x if rates else layout.n_q

    def find(x: Any, **raw: Any) -> Array:
        if layout.sizes.n_com == 0:  # the model has no bodies, or none with a mass
            raise UsageError(f"model {layout.name!r} has no {name}: no body of it has a mass", code="EG-NO-INERTIA")
        state = read_numbers("x", x)
        if state.shape[:1] != (n,) or state.ndim > 2:
            raise ill_shaped(f"{'x' if rates else 'q'} must have shape ({n},) or ({n}, k), not {state.shape}")
        full = np.concatenate([state, np.zeros((layout.n_x - n, *state.shape[1:]))])
        result = whole(full, **raw)[start : start + prod(shape)]
        return np.array(result.reshape(shape + state.shape[1:]))

    return kernels.derived(name, "state", find)


# -- why a kernel fails ------------------------------------------------------------------------------------------------


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
        states = {known[name]: None for name in bad if name in known}
        if bad and set(bad) <= set(layout.reaction_laws):
            return (
                f"the forces of {' and '.join(bad)} depend on reactions which they change so strongly that the motion "
                "may have several solutions or none (Painleve's paradox); give smaller coefficients"
                f"{''.join(f'; or {why}' for why in states)}"
            )
        switches = [name for name in bad if name in layout.switches]
        if switches:
            return f"the equations of {' and '.join(switches)} are not (outside their domain, or a wheel lies flat)"
        loads = [name for name in bad if name not in layout.reaction_laws]
        if loads:
            ends = [] if known.keys() >= {*loads} else ["its ends meet or lie inside the cylinder"]
            why = ", or ".join([*states, *ends, "its law is outside its domain"])
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


Bound = Array | None  #: p or u of a call; None for those that are bound
LISTED = 8  #: coordinates listed in a message

CAUSES = {
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

    def trouble(self, x: Array, t: float = 0.0, p: Bound = None) -> tuple[str, str] | None:
        """What is wrong at a state with a rolling disc or with how a rotation is described, and the remedy."""
        return flat_disc(self.kernels, x, t, p) or rotation_trouble(self.layout, x)

    def __call__(self, name: str, status: int, t: float, x: Array, p: Bound = None, u: Bound = None) -> None:
        raise self.exception(name, status, t, x, p, u)

    def exception(
        self, name: str, status: int, t: float, x: Array, p: Bound = None, u: Bound = None
    ) -> EvaluationError:
        """The exception, not raised."""
        what, remedy = CAUSES.get(status, (f"the kernel returned status {status}", "this is a defect of eomgen"))
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
            blame, remedy = f": squares of {', '.join(large[:LISTED])} overflow", "check the state given"
        elif name == "resets" and (switches := self.layout.switches):
            closed = ", ".join(one for one, state in switches.items() if x[self.layout.x.index(state)] > 0.5)
            blame = (
                f": not finite, or contrary to a constraint that is closed ({closed or 'none'}), closes or never opens"
            )
            remedy = "give new values that obey it, or open it first (releases)"
        elif status == 4 and not len(self.layout.independent):
            what = "the constraints are singular here, and the mechanism has no degree of freedom"
            remedy = "start a little away from this position, or change the dimensions"
        elif names or not self.layout.n_x:
            if status == 5 and (result := self._diagnose(1, t, x, p, u)):
                status, (what, remedy) = 1, CAUSES[1]  # a solver cannot tell a law that is no number from rounding
            else:
                result = self._diagnose(status, t, x, p, u)
            blame = f": {result}" if result else ""
        if status == 1 and name == "jacobian" and not blame:
            remedy += ", or a root of 0, which has no derivative"
        error = STATUS.get(status, EvaluationError)
        return error(f"{name} at t = {t:.6g}{at}: {what}{blame}; {remedy}", t, x)

    def _diagnose(self, status: int, t: float, x: Array, p: Bound, u: Bound) -> str:
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
        normal_to_both = np.cross(turns[wheel] @ axle, turns[plane] @ normal)
        if np.linalg.norm(normal_to_both) < FLAT:
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
    listed = [f"{name} = {value:.6g}" for name, value in zip(names, x, strict=False)][:LISTED]
    return "".join(f", {item}" for item in listed) + (", ..." if len(names) > LISTED else "")


# -- constraints -------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def constraint_system(kernels: Kernels) -> ConstraintSystem:
    """The constraints of positions with the parameters of the kernels; dC/dq for C_q where q' is given."""
    layout = kernels.layout
    C = kernels.kernel("constraints", nan=True)
    slopes = "coordinate_slopes" if layout.sizes.n_coordinate_slopes else "constraint_jacobian"
    C_q, none = kernels.kernel(slopes, nan=True), np.zeros((0, layout.n_q))
    places = layout.n_h or not layout.general_rates  # rows of given velocities alone say nothing of q
    y, y_q = kernels.loop_coordinates, kernels.kernel("loop_coordinate_jacobian", nan=True)
    alignment, zero = kernels.kernel("alignment", nan=True), np.zeros(layout.n_v)

    def cut(q: Array, t: float) -> tuple[Array, Array]:
        return np.asarray(y(q, zero, zero, t=t), dtype=float)[0], y_q(q, t=t)

    joints = CutJoints(layout.loops, layout.loop_kinds, layout.loop_scales, cut)
    aligned = (lambda q, t: alignment(q, t=t)) if layout.sizes.n_alignments else None
    named = layout.place_scales, layout.q, layout.coordinate_kinds, layout.constraint_labels
    evaluate = (lambda q, t: (C(q, t=t), C_q(q, t=t))) if places else lambda q, t: (np.zeros(0), none)
    return ConstraintSystem(evaluate, *named, joints, aligned)


# -- pickles -----------------------------------------------------------------------------------------------------------

# A pickle names the file of the compiled code and holds the values bound: it is small, is read in milliseconds, and
# serves processes of one machine (or of machines that share the cache and the kind of processor), not for keeping:
# generate a package for that.

#: Names of all kernels of a module that makes some when they are called; of those made the name and file of the code.
Lazy = tuple[tuple[str, ...], dict[str, tuple[str, str]]]


def reduce(module: Any) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """What pickle stores: how to make the module again."""
    core: Any = eager(module.core)
    name, file = getattr(core, "__name__", ""), getattr(core, "__file__", None)
    if not file or _find_loaded(name) is not core:
        raise TypeError(
            f"the module of {module.name!r} cannot be pickled, because its code is not in a file of its own (a core "
            "made by hand, or target numpy with native functions); use target cython"
        )
    lazy: Lazy | None = None
    if isinstance(module.core, LazyCore):
        further: dict[str, Any] = module.core.further
        lazy = module.core.names, {group: (made.__name__, str(made.__file__)) for group, made in further.items()}
    return restore, (type(module), name, str(file), module.p, module.constant_inputs, lazy)


def restore(kind: type[Any], name: str, file: str, p: Array, u: dict[str, float], lazy: Lazy | None = None) -> Any:
    """The module of a pickle, with the rarer kernels where they had been made."""
    core: Any = find_core(name, file)
    if lazy is None:
        return kind(core, p, u)
    names, made = lazy

    def load(group: str) -> Any:
        if group not in made:
            rare = ", ".join(name for name in names if name not in core.names and str(NAMED[name].lazy) == group)
            raise cannot(f"the module was pickled without {rare}; call one of them before you pickle it")
        return find_core(*made[group])

    return kind(LazyCore(core, names, load), p, u)


def _find_loaded(name: str) -> Any:
    """The core of a name, if it is loaded: the module itself, or the model that is linked with a package's module."""
    result = find_module(name)
    return getattr(result, "model", result)


def find_core(name: str, file: str) -> Any:
    """The core of a name: loaded already, of a generated package, or in its file in the cache."""
    if (loaded := _find_loaded(name)) is not None:
        return loaded
    try:
        import_module(name)  # of a generated package
        return _find_loaded(name)
    except ModuleNotFoundError:
        pass
    return import_module("eomgen.toolchain.load").find_core(name, Path(file))
