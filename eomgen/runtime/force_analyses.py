"""Stage runtime: the calls of a Module about forces in joints, drives and impacts; each loads :mod:`..analysis`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from ..analysis.drive import ActuatorForces
    from ..analysis.impact import Impact
    from ..analysis.impact_trajectory import ImpactRun
    from ..numeric.scales import Array
    from .kernels import Kernels


class ForceAnalyses:
    """Part of :class:`~.module.Module`: reactions, constrained inverse dynamics, impacts, consistent states."""

    kernels: Kernels

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of :meth:`reactions`."""
        return tuple(self.kernels.layout.metadata.get("joint_names", ()))

    @property
    def constraint_labels(self) -> tuple[str, ...]:
        """Names of all constraint rows, in the order of :meth:`multipliers`."""
        return self.kernels.layout.constraint_labels

    @np.errstate(all="ignore")
    def multipliers(self, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None) -> Array:
        """Lagrange multipliers l of all constraint rows, in ``M v' + h + C_q^T l = 0``.

        Parameters
        ----------
        t : float or (k,) array
        x : (n_x,) or (n_x, k) array
            States; projected onto the constraints first.
        p, u, out : optional
            As for every kernel; u may also be (n_u, k), inputs of each state.

        Returns
        -------
        (n_rows,) or (n_rows, k) array
            In the order of ``constraint_labels``; N where a row is in m, N m where it is in rad.  Where rows depend on
            each other, the smallest multipliers, each times the scale of its row.
        """
        from ..analysis.constrained import multipliers

        return multipliers(self, t, x, p, u, out)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def reactions(self, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None) -> Array:
        """Reaction forces and moments of all joints.

        Parameters
        ----------
        t, x, p, u, out
            As for :meth:`multipliers`.

        Returns
        -------
        (n_joints, 6) or (n_joints, 6, k) array
            Per joint of ``joint_names`` the force (N) and moment (N m) ``[Fx Fy Fz Mx My Mz]`` that the predecessor
            exerts on the successor at the successor's marker, in ground axes.  Reactions do no work in the motion the
            joint allows: forces of drives, friction, springs and couplings along its coordinates are not in them
            (they act as torques where a coordinate turns, as forces where it slides).

        Raises
        ------
        UsageError
            A wrong shape, or a model without bodies.

        Notes
        -----
        Where constraints are redundant, rigid bodies do not determine all of it: see :meth:`undetermined_reactions`.
        Returned are then the reactions with the smallest sum of squares of all joints' forces and of their moments
        divided by the model's length, wherever loops are cut.
        """
        from ..analysis.reactions import reactions

        return reactions(self, t, x, p, u, out)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def undetermined_reactions(self, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None) -> Any:
        """Which components of :meth:`reactions` redundant constraints leave undetermined.

        Returns
        -------
        (n_joints, 6) or (n_joints, 6, k) array of bool
        """
        from ..analysis.reactions import undetermined_reactions

        return undetermined_reactions(self, t, x, p, u)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def driving_forces(self, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None) -> dict[str, Any]:
        """Generalized forces that constraint elements (drivers, gears, rolling ...) exert, by name.

        Returns
        -------
        dict
            Name of the element, or ``<name>.<row>`` where it has several rows, -> force or (k,) forces: the power they
            bring in is the force times the rate of the row's left side, so that a driver that holds ``theta - f(t)``
            at 0 exerts this torque along ``theta``.
        """
        from ..analysis.reactions import driving_forces

        return driving_forces(self, t, x, p, u)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def actuator_forces(
        self,
        t: ArrayLike,
        x: ArrayLike,
        a: Mapping[str, ArrayLike] | ArrayLike | None = None,
        *,
        actuated: Sequence[str] | None = None,
        p: Any = None,
        u: Any = None,
    ) -> ActuatorForces:
        """Constrained inverse dynamics: the forces of chosen drives that make a motion, loops closed.

        Parameters
        ----------
        t : float or (k,) array
        x : (n_x,) or (n_x, k) array
            States; projected onto the constraints first.
        a : mapping of str to float or (k,) array, or (n_v,) or (n_v, k) array, optional
            Accelerations: those of the independent coordinates by name (others 0), from which the rest follows, or all
            of them, which must obey the constraints.  By default the independent accelerations are 0.
        actuated : sequence of str, optional
            What is driven: coordinates of the tree or of cut joints, whose forces come on top of the model's own, or
            inputs in which forces are linear, whose whole values are found.  By default the independent coordinates.
        p, u : optional
            As for ``bind``.

        Returns
        -------
        ActuatorForces
            ``forces["theta"]``, ``forces.forces`` (n,) or (n, k), ``multipliers``, ``reactions``.  With more drives
            than freedoms the smallest sum of squares (torques, and forces times the model's length).

        Raises
        ------
        UsageError
            An unknown name; accelerations that break the constraints; drives that cannot make the motion.
        """
        from ..analysis.drive import find_forces

        return find_forces(self, t, x, a, actuated=actuated, p=p, u=u)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def impact(
        self,
        t: float,
        x: ArrayLike,
        gaps: Mapping[str, float] | None = None,
        *,
        lock: Sequence[str] = (),
        closed: bool = False,
        p: Any = None,
        u: Any = None,
    ) -> Impact:
        """The state after an impact without friction, or after coordinates are locked at once.

        Parameters
        ----------
        t : float
        x : (n_x,) array
            The state right before; projected onto the constraints first.
        gaps : mapping of str to float
            Coordinates or outputs (functions of positions) that must not become negative and are 0 now -> coefficient
            of restitution, 0 to 1.  Gaps that open are left alone.
        lock : sequence of str
            Coordinates that stop (plastic, whatever the sign of the impulse).
        closed : bool
            Take the gaps as closed whatever their values, as at a stop that is put where a coordinate is now.
        p, u : optional
            As for ``bind``.

        Returns
        -------
        Impact
            ``x`` after it, ``impulses`` by name, ``rates_before``, ``rates_after``, ``constraint_impulses``,
            ``energy_lost``.

        Raises
        ------
        UsageError
            An unknown name; a gap that is not 0 (within 1e-6 lengths of the model, or rad); impulses that cannot do
            it; a gap that drivers close.

        Notes
        -----
        Newton's law of restitution with complementarity, for all gaps at once that close or are at rest: each impulse
        is 0 or positive, rate+ + e min(rate-, 0) too, and one of the two is 0 (Moreau 1988; Pfeiffer and Glocker,
        Multibody Dynamics with Unilateral Contacts, ch. 8; Brogliato, Nonsmooth Mechanics, ch. 5).  A gap that was
        opening and is closing after that makes a further impact at the same instant.  No energy is ever gained, but
        from gaps that move in time.  Springs, dampers and other finite forces have no part in it.  Velocities after
        the impact are unique; impulses are not where gaps depend on each other, and the law itself is a choice:
        momentum and energy alone do not determine what several bodies that touch do.
        """
        from ..analysis.impact import strike

        return strike(self, t, x, gaps, lock=lock, closed=closed, p=p, u=u)  # type: ignore[arg-type]

    def simulate_impacts(
        self,
        span: float | tuple[float, float] | None,
        gaps: Mapping[str, float],
        initial: Mapping[str, float] | ArrayLike | None = None,
        parameters: Any = None,
        inputs: Mapping[str, Any] | None = None,
        *,
        most: int = 1000,
        **options: Any,
    ) -> ImpactRun:
        """Integrate, with an impact whenever a gap closes.

        Parameters
        ----------
        span : (float, float) or float
            Start and end (s), forward in time.
        gaps : mapping of str to float
            As for :meth:`impact`.
        initial, parameters, inputs : optional
            As for ``simulate``.
        most : int
            Impacts after which the run is given up: they accumulate as a body comes to rest.
        **options
            method, rtol, atol, max_step, first_step, as for ``simulate``.

        Returns
        -------
        ImpactRun
            A trajectory (``run["theta"]``, ``run.at(t)``, ``run.save(path)`` ...) with both states at each impact, and
            ``impacts`` (time, Impact), ``pieces``, the trajectories between impacts, and ``ended``: 'end'; 'rest', a
            closed gap is pressed together; 'impacts', there were ``most``; 'event', an event of the model.

        Raises
        ------
        UsageError
            A gap is negative at the start, an unknown name, or a mechanism without freedom.
        SimulationError, AssemblyError, MissingDependencyError
            As for ``simulate``; also where a gap is found negative without an impact before.
        """
        from ..analysis.impact_run import run_with_impacts

        return run_with_impacts(self, span, gaps, initial, parameters, inputs, most=most, **options)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def consistent(
        self,
        x: ArrayLike,
        t: float = 0.0,
        *,
        weights: Mapping[str, float] | str | None = None,
        hold: Sequence[str] = (),
        p: Any = None,
        u: Any = None,
    ) -> Array:
        """The state on the constraints that differs least from a given one, positions first, then velocities.

        Parameters
        ----------
        x : (n_x,) array
            Any state.
        t : float
        weights : mapping of str to float, or 'mass', optional
            What a change costs: weight times the square of the change, in radians or lengths of the model; 1 where
            nothing is said.  The weight of a coordinate is that of its rate too, unless the rate is named.  ``'mass'``
            takes the mass matrix of the tree as the metric.
        hold : sequence of str
            Coordinates and rates that keep their values exactly.
        p, u : optional
            As for ``bind``.

        Returns
        -------
        (n_x,) array

        Raises
        ------
        ProjectionError
            The constraints cannot be met near the state, or not with these values held.
        UsageError
            An unknown name, or a weight that is not positive.

        Notes
        -----
        ``project(x)`` is the same with weights 1 to first order in the change; ``x0`` starts from named values.
        """
        from ..analysis.consistent import find_consistent

        return find_consistent(self, x, t, weights=weights, hold=hold, p=p, u=u)  # type: ignore[arg-type]
