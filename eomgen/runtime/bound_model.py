"""A core (compiled extension or NumPy) with parameters and inputs bound -> BoundModel, its own calls.

What every analysis and every run takes.  :class:`~..module.Module` is the same with the calls that load those.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from .argument_checks import read_numbers
from .argument_names import both_names
from .assembled import Assembled
from .kernels import Kernels, Projection, Refused, Rows, mechanical
from .layout import Layout
from .momenta import Momenta
from .refusals import refuse_reaction_laws

if TYPE_CHECKING:
    from .protocols import Core, Motion, State, Timed
    from .tree_motion import DependentMotion


class BoundModel(Assembled, Momenta):
    """A model with parameters and inputs bound, and the calls that need no analysis and no run.

    What its attributes and calls are, :class:`~..module.Module` says, whose parameters it has too.
    """

    #: what it was made from; None for a module of an exported package, or from a pickle
    equations: Any = None

    rhs: Timed
    jacobian: Timed
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

    def __init__(self, core: Core, p: Any = None, u: Any = None) -> None:
        self.core = core
        self.layout = layout = Layout(core.metadata)
        self._setup(core, layout, self._declared("parameter", p), self._declared("input", u))

    def _declared(self, what: str, given: Any) -> Any:
        layout = self.layout
        names, key = (layout.p, "p_values") if what == "parameter" else (layout.u, "u_values")
        if not isinstance(given, Mapping):
            return given
        current = np.array([np.nan if value is None else value for value in layout.metadata[key]], dtype=float)
        return layout.values(what, names, given, current)

    def _setup(self, core: Core, layout: Layout, p: Any, u: Any) -> None:
        self.kernels = kernels = Kernels(core, layout, p, u)
        self.layout = layout = kernels.layout
        self.metadata = layout.metadata
        self.name, self.doc, self.limits = layout.name, str(layout.metadata.get("doc") or ""), layout.limits
        moving = layout.n_v - len(layout.states)
        self.q_names, self.v_names, self.s_names, self.x_names = layout.q, layout.v[:moving], layout.states, layout.x
        self.u_names, self.p_names, self.y_names = layout.u, layout.p, layout.y
        self.body_names, self.loop_names = layout.bodies, layout.loops
        self.n_q, self.n_v, self.n_s, self.n_x = layout.n_q, moving, len(layout.states), layout.n_x
        self.n_u, self.n_p, self.n_y, self.n_bodies = layout.n_u, layout.n_p, layout.n_y, layout.n_bodies
        self.n_dof, self.n_c, self.n_rows = layout.n_dof - self.n_s, len(layout.rows), layout.n_c
        jacobian: Any = kernels.timed("jacobian")
        self.rhs, self.jacobian, jacobian.others = kernels.timed("rhs"), jacobian, kernels.derivative
        self.outputs = kernels.timed("outputs")
        self.energy, self.poses = kernels.state("energy"), kernels.state("poses")
        self.project = Projection(kernels.state("project"))
        self.constraints = kernels.constraints
        names = ("mass_matrix", "embedded_mass_matrix", "bias", "inverse_dynamics", "constraint_jacobian")
        vars(self).update(mechanical(kernels) if self.n_s else {name: getattr(kernels, name) for name in names})
        if layout.reaction_laws:
            refused = Refused(lambda: refuse_reaction_laws(layout, "inverse_dynamics"))
            self.inverse_dynamics = cast("Motion", refused)
        self.velocity_constraints = kernels.velocity_constraints

    @property
    def p(self) -> Array:
        """A copy of the parameters bound, (n_p,)."""
        return np.array(self.kernels.context.p)

    @cached_property
    def _settled(self) -> dict[tuple[Any, ...], Any]:
        """What runs with the same arguments have in common; see :mod:`..simulation.compiled`."""
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
            A mapping changes those it names; None keeps what is bound here.

        Returns
        -------
        Module

        Raises
        ------
        UsageError
            An unknown name or a wrong shape.
        """
        layout = self.layout
        return self.rebound(
            layout.values("parameter", layout.p, p, self.p), layout.values("input", layout.u, u, self.u)
        )

    def rebound(self, p: Array, u: Array) -> Self:
        """The same model with other parameters (n_p,), which are allowed, and inputs (n_u,)."""
        other = object.__new__(type(self))
        other.core, other.layout, other.equations = self.core, self.layout, self.equations
        other._setup(self.core, self.layout, p, u)
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles hold where the compiled code lies and the values bound, not the code: see :mod:`.pickling`."""
        from .pickling import reduce

        return reduce(self)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of :meth:`reactions`."""
        return tuple(self.kernels.layout.metadata.get("joint_names", ()))

    @property
    def constraint_labels(self) -> tuple[str, ...]:
        """Names of all constraint rows, in the order of :meth:`multipliers`."""
        return self.kernels.layout.constraint_labels

    # derivatives

    @cached_property
    def input_jacobian(self) -> Timed:
        """``input_jacobian(t, x)`` -> (n_x, n_u), the derivative of the complete rhs by the inputs."""
        return self.kernels.derivative("input_jacobian")

    @cached_property
    def parameter_jacobian(self) -> Timed:
        """``parameter_jacobian(t, x)`` -> (n_x, n_p), the derivative of the complete rhs by the parameters.

        The projection is part of the rhs: where parameters move the constraints, the state is taken along to the
        nearest one on them.  Exact at states on the constraints; others are projected first.
        """
        return self.kernels.derivative("parameter_jacobian")

    # kinematics

    @cached_property
    def _path(self) -> tuple[DependentMotion, Callable[[float], Array]]:
        from .tree_motion import DependentMotion

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
        from .tree_motion import motions

        path, reference = self._path
        start = None if guess is None else read_numbers("guess", guess)
        return motions(path, reference, (q_i, v_i, a_i), start, read_numbers("t", t))
