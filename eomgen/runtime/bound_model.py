"""A core (compiled extension or NumPy) with parameters and inputs bound -> BoundModel, its own calls.

What every analysis and every run takes.  :class:`~..module.Module` is the same with the calls that load those.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.constraints import CHOSEN
from ..base.limits.positions import MOST_ANGLE
from ..base.texts import angle_in_degrees
from ..errors import calls_within, ill_placed, ill_shaped, no_number
from .argument_checks import both_names, read_number, read_numbers, require_mapping
from .initial import Initial, NamedValues
from .kernels import Kernels, public_call, reduce
from .layout import Layout
from .refusals import require_support

if TYPE_CHECKING:
    from .protocols import Core, Motion, Projection, Rows, State, Timed


class InverseDynamicsDerivatives(NamedTuple):
    """Derivatives of the generalized forces of the inverse dynamics, each at fixed other arguments."""

    dtau_dq: Array  #: (n_v, n_q)
    dtau_dv: Array  #: (n_v, n_v)
    dtau_da: Array  #: (n_v, n_v), the mass matrix


class BoundModel:
    """A model with parameters and inputs bound, and the calls that need no analysis and no run.

    What its attributes and calls are, :class:`~..module.Module` says, whose parameters it has too.
    """

    #: what it was made from; None for a module of an exported package, or from a pickle
    equations: Any = None

    rhs: Timed
    jacobian: Timed
    input_jacobian: Timed
    parameter_jacobian: Timed
    bias: Timed
    outputs: Timed
    mass_matrix: State
    embedded_mass_matrix: State
    energy: State
    project: Projection
    poses: State
    inverse_dynamics: Motion
    constraints: Rows
    constraint_jacobian: Rows
    velocity_constraints: Rows
    center_of_mass: State
    com_jacobian: State
    momentum: State
    centroidal_inertia: State

    def __init__(self, core: Core, p: Any = None, u: Any = None) -> None:
        self.core = core
        self.layout = layout = Layout(core.metadata)
        self._setup(core, layout.without_signals(u), self._declared("parameter", p), self._declared("input", u))

    def _declared(self, what: str, raw: Any) -> Any:
        layout = self.layout
        names, key = (layout.p, "p_values") if what == "parameter" else (layout.u, "u_values")
        if not isinstance(raw, Mapping):
            return raw
        current = np.array([np.nan if value is None else value for value in getattr(layout.info, key)], dtype=float)
        return layout.values(what, names, raw, current)

    def _setup(self, core: Core, layout: Layout, p: Any, u: Any) -> None:
        self.kernels = kernels = Kernels(core, layout, p, u)
        self.layout = layout = kernels.layout
        self.metadata, self.info = layout.metadata, layout.info
        self.name, self.doc, self.limits = layout.name, layout.info.doc, layout.limits
        moving = layout.n_v - len(layout.states)
        self.q_names, self.v_names, self.s_names, self.x_names = layout.q, layout.v[:moving], layout.states, layout.x
        self.u_names, self.p_names, self.y_names = layout.u, layout.p, layout.y
        self.body_names, self.loop_names = layout.bodies, layout.loops
        self.n_q, self.n_v, self.n_s, self.n_x = layout.n_q, moving, len(layout.states), layout.n_x
        self.n_u, self.n_p, self.n_y, self.n_bodies = layout.n_u, layout.n_p, layout.n_y, layout.n_bodies
        self.n_dof, self.n_c, self.n_rows = layout.n_dof - self.n_s, len(layout.rows), layout.n_c

    @property
    def p(self) -> Array:
        """A copy of the parameters bound, (n_p,)."""
        return np.array(self.kernels.context.p)

    @cached_property
    def _plans(self) -> dict[tuple[Any, ...], Any]:
        """Plans of runs by method and tolerances; see :mod:`.runs.simulate`."""
        return {}

    @cached_property
    def _running_start(self) -> Array:
        """The state of the declared initial values at t = 0, from which the right-hand side can be evaluated."""
        self.rhs(0.0, self._declared_start)
        return self._declared_start

    @cached_property
    def _parameters(self) -> Mapping[str, float]:
        """The parameters bound, by name; they never change."""
        return MappingProxyType(dict(zip(self.p_names, self.p.tolist(), strict=True)))

    @property
    def u(self) -> Array:
        """A copy of the inputs bound, (n_u,)."""
        return np.array(self.kernels.context.u)

    @both_names
    def bind(self, p: Any = None, u: Any = None) -> Self:
        """Make the same model with other parameters and inputs.

        Parameters
        ----------
        p, u : mapping of str to float, or arrays (n_p,), (n_u,), optional
            A mapping changes those it names; None keeps what is bound here.  Inputs bound stay constant in runs, in
            place of declared signals.

        Returns
        -------
        Module

        Raises
        ------
        UsageError
            An unknown name or a wrong shape.
        """
        if p is None and u is None:
            return self
        layout = self.layout
        p, values = layout.values("parameter", layout.p, p, self.p), layout.values("input", layout.u, u, self.u)
        return self.rebound(p, values, layout.without_signals(u))

    def rebound(self, p: Array, u: Array, layout: Layout | None = None) -> Self:
        """The same model with other parameters (n_p,), which are allowed, and inputs (n_u,)."""
        other = object.__new__(type(self))
        other.core, other.equations = self.core, self.equations
        other._setup(self.core, layout or self.layout, p, u)
        return other

    @property
    def constant_inputs(self) -> dict[str, float]:
        """The inputs without a declared signal, with which a copy of the model is made."""
        return {
            name: x for name, x in zip(self.u_names, self.u.tolist(), strict=True) if name not in self.layout.signals
        }

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles hold where the compiled code lies and the values bound, not the code."""
        return reduce(self)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of :meth:`reactions`."""
        return tuple(self.kernels.layout.info.joint_names)

    @property
    def constraint_labels(self) -> tuple[str, ...]:
        """Names of all constraint rows, in the order of :meth:`multipliers`."""
        return self.kernels.layout.constraint_labels

    # derivatives

    _inverse_slopes = cached_property["Motion"](lambda self: self.kernels.inverse_dynamics_derivatives)

    @both_names
    def inverse_dynamics_derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
        t: ArrayLike = 0.0,
    ) -> InverseDynamicsDerivatives:
        """Differentiate the generalized forces ``inverse_dynamics(q, v, a)`` by q, by v and by a, each at fixed others.

        Parameters
        ----------
        q, v, a : (n_q,), (n_v,), (n_v,) arrays, or with a last axis k
            Coordinates, velocities and accelerations of the spanning tree.
        p, u : arrays, optional
        out : (n_v, n_q + 2 n_v) array, optional
            Where all three are written side by side; the results are views of it.
        t : float or (k,) array

        Returns
        -------
        InverseDynamicsDerivatives
            ``dtau_dq`` (n_v, n_q), ``dtau_dv`` and ``dtau_da`` (n_v, n_v); the last is the mass matrix.  Columns of
            Euler parameters are partial derivatives by the four numbers: along a rotation with angular velocity w they
            combine as ``dtau_dq @ dq`` with the change dq = N(q) w of q at that velocity.

        Raises
        ------
        UnavailableError
            The model has first-order states.
        """
        require_support(self.layout, "inverse_dynamics_derivatives")
        n_q, n_v, every = self.n_q, self.n_v, self._inverse_slopes(q, v, a, p, u, out, t)
        return InverseDynamicsDerivatives(every[:, :n_q], every[:, n_q : n_q + n_v], every[:, n_q + n_v :])

    # positions that loops allow

    @both_names
    @np.errstate(all="ignore")
    def x0(
        self,
        values: Mapping[str, float | str] | None = None,
        /,
        *,
        t: float = 0.0,
        p: Any = None,
        u: Any = None,
        **named: float | str,
    ) -> Array:
        """Find an initial state: loops closed and velocities consistent.

        Parameters
        ----------
        values, **named : float
            Coordinates and velocities (``theta``, ``theta_dot``) of the tree or of cut joints, outputs of positions or
            velocities (``tip_x``), places and velocities of markers (``"x(rod.tip)"``, ``"vx(rod.tip)"``), held
            exactly; the rest is solved.  Without any, the declared initial values are held; else they are kept where
            they leave room.
        t : float
            Time (s); matters for driven constraints only.
        p, u : optional
            As for :meth:`bind`.

        Returns
        -------
        (n_x,) array

        Raises
        ------
        AssemblyError
            The loops do not close with these values, or the values contradict each other.
        UsageError
            An unknown name.

        Warns
        -----
        UserWarning
            The values are not reached from the declared position without leaving its branch; the loops are then closed
            from the nearest guess; or an angle of more than two turns is given, as degrees would be.
        """
        initial, raw = self._initial_values(values, named, t, p, u)
        q = initial.assembled(raw.positions)
        v = initial.velocities(q, raw.rates if raw.positions or raw.rates else None)
        return np.concatenate([q, v])

    _declared_start = cached_property[Array](lambda self: self.x0())  # of the declared initial values at t = 0

    @both_names
    @np.errstate(all="ignore")
    def assemble(
        self,
        guess: Mapping[str, float | str] | None = None,
        /,
        *,
        t: float = 0.0,
        p: Any = None,
        u: Any = None,
        **named: float | str,
    ) -> Array:
        """Find a position with closed loops near a guess.

        Parameters
        ----------
        guess, **named : float
            Coordinates of the tree or of cut joints.  They are kept as far as the loops allow, the independent ones
            first; the others tell the branches apart.  What is not named starts from the declared initial position.
        t, p, u
            As for :meth:`x0`.

        Returns
        -------
        (n_q,) array

        Raises
        ------
        AssemblyError
            The loops do not close.
        """
        initial, raw = self._initial_values(guess, named, t, p, u)
        if raw.rates:
            raise ill_placed(f"assemble takes positions only, not {', '.join(raw.rates)}; use x0 for rates")
        return initial.from_guess(raw.positions) if raw.positions else initial.assembled({})

    @both_names
    @np.errstate(all="ignore")
    def branches(
        self,
        values: Mapping[str, float | str] | None = None,
        /,
        *,
        t: float = 0.0,
        p: Any = None,
        u: Any = None,
        **named: float | str,
    ) -> list[Array]:
        """Find all positions (n_q,) with the given values; the first is that of :meth:`x0`.

        Without any, the declared initial values are held.  Where the held values leave freedom, the independent
        coordinates keep the values of the first position.  The search is bounded and repeats exactly; it may miss a
        branch.
        """
        initial, raw = self._initial_values(values, named, t, p, u)
        first = initial.assembled(raw.positions, rough=True)
        return initial.branches(raw.positions, first)

    @both_names
    @np.errstate(all="ignore")
    def branch(self, x: ArrayLike, t: float = 0.0) -> int:
        """Tell on which side of the dead centres a state or position lies.

        Parameters
        ----------
        x : (n_x,) or (n_q,) array

        Returns
        -------
        int
            1 for the side of the declared initial position, -1 for the other, 0 at a dead centre of the independent
            coordinates.
        """
        state = read_numbers("x", x)
        if state.shape not in ((self.n_q,), (self.n_x,)):
            raise ill_shaped(f"x must be of shape ({self.n_q},) or ({self.n_x},), not {state.shape}")
        if not np.isfinite(state).all():
            raise no_number(f"x must be finite, not {state}")
        initial = self._initial(t, None, None)
        here = initial.side(state[: self.n_q])
        there = initial.side(initial.reference())
        return 0 if abs(here) < CHOSEN else int(np.sign(here * (np.sign(there) or 1.0)))

    def _initial_values(self, values: Any, named: Any, t: float, p: Any, u: Any) -> tuple[Initial, NamedValues]:
        """The assembly to these values, and the values as positions and rates."""
        if values is not None:
            require_mapping("initial values", values)
        numbers = {name: read_number(name, value) for name, value in {**(values or {}), **named}.items()}
        layout = self.layout
        for name, kind in zip(layout.q + layout.loops, layout.coordinate_kinds + layout.loop_kinds, strict=True):
            if kind in ("angle", "turn") and abs(numbers.get(name, 0.0)) > MOST_ANGLE:
                warnings.warn(angle_in_degrees(name, numbers[name]), stacklevel=calls_within() + 1)
        initial = self._initial(t, p, u, numbers)
        return initial, initial.sort(numbers)

    def _initial(self, t: float, p: Any, u: Any, names: Iterable[str] = ()) -> Initial:
        """The assembly of this model with other parameters and inputs, if given, to values of these names."""
        layout = self.layout
        for name, raw, what in (("p", p, "parameters"), ("u", u, "inputs")):
            scalar = isinstance(raw, (float, int, np.number)) or (isinstance(raw, np.ndarray) and not raw.ndim)
            if scalar and name in layout.q + layout.loops + layout.v:
                kind = "state" if name in layout.states else "velocity" if name in layout.v else "coordinate"
                raise ill_placed(f"{name}= gives the {what}; give the {kind} {name!r} in a dict: {{{name!r}: ...}}")
        return Initial(self.bind(p, u).kernels, read_number("t", t), map(str, names))

    # kinematics

    @cached_property
    def _path(self) -> tuple[Any, Callable[[float], Array]]:
        from .minimal import DependentMotion

        return DependentMotion(self.kernels), lru_cache(lambda t: self._initial(t, None, None).reference())

    @both_names
    def kinematics(
        self,
        q_i: ArrayLike,
        v_i: ArrayLike | None = None,
        a_i: ArrayLike | None = None,
        guess: ArrayLike | None = None,
        t: ArrayLike = 0.0,
        p: Any = None,
        u: Any = None,
    ) -> tuple[Array, Array, Array]:
        """Compute the motion of the whole tree from that of the independent coordinates.

        A pure function: the dependent coordinates are found by leading the independent ones from the declared initial
        position in small steps along a straight line, so that the branch is that of this position.  Each column of a
        batch is found for itself.

        Parameters
        ----------
        q_i, v_i, a_i : (n_dof,) or (n_dof, k) arrays
            Independent coordinates (``minimal.q_names``), velocities and accelerations; zero by default.
        guess : (n_q,) array, optional
            Start Newton's iteration here instead, and take the branch it leads to.
        t : float or (k,) array
        p, u : optional
            As for :meth:`bind`.

        Returns
        -------
        q, v, a : (n,) or (n, k) arrays

        Raises
        ------
        ProjectionError, PartitionError, UsageError
            The position is out of reach, or the way to it leads through a dead centre; or there is no minimal form
            (nonholonomic constraints, an independent angular velocity).
        """
        self.layout.require_minimal_form()
        if p is not None or u is not None:
            return self.bind(p, u).kinematics(q_i, v_i, a_i, guess, t)
        from .minimal import motions

        path, reference = self._path
        start = None if guess is None else read_numbers("guess", guess)
        return motions(path, reference, (q_i, v_i, a_i), start, read_numbers("t", t))


def _called(name: str) -> Any:
    """A call of a module as an attribute, made when it is first requested."""
    made = cached_property[Any](lambda self: public_call(self.kernels, name))
    made.__set_name__(BoundModel, name)
    return made


for _name in BoundModel.__annotations__.keys() - {"equations"}:
    setattr(BoundModel, _name, _called(_name))
