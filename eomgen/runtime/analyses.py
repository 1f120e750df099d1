"""Stage runtime: the calls of a Module that analyse it; each loads its part of :mod:`..analysis` when called."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UnavailableError
from .force_analyses import ForceAnalyses

if TYPE_CHECKING:
    from ..analysis.balanced import Equilibrium
    from ..analysis.linearisation import Linearisation
    from ..analysis.modes import Modes
    from ..analysis.sensitivity_result import Sensitivities
    from ..numeric.scales import Array
    from ..verification.finding import Verification
    from .kernels import Kernels
    from .layout import Layout
    from .protocols import Timed


def require_velocities(layout: Layout) -> None:
    """Refuse a model whose q' is given as functions of other velocities.

    Raises
    ------
    UnavailableError
    """
    if getattr(layout, "given_rates", False):
        raise UnavailableError(
            f"the rates of the coordinates of model {layout.name!r} are given as functions of its velocities, and its "
            "other analyses are not derived; rhs, jacobian, simulate and linearise are there"
        )


def require_projection(layout: Layout) -> None:
    """Refuse a model whose right-hand side holds constraints by Baumgarte's stabilisation.

    Raises
    ------
    UnavailableError
    """
    if not layout.projects:
        raise UnavailableError(
            f"model {layout.name!r} was derived with baumgarte=, so its right-hand side does not project, and its "
            "derivatives by inputs and parameters are not derived; derive without baumgarte for analyses"
        )


class Refusal:
    """In place of a kernel that a model cannot have: says why when it is called."""

    failure: tuple[int, float, Array] | None = None

    def __init__(self, layout: Layout) -> None:
        self.layout = layout

    def __call__(self, *args: Any, **options: Any) -> Any:
        """Refuse.

        Raises
        ------
        UsageError
        """
        require_velocities(self.layout)
        require_projection(self.layout)


class Analyses(ForceAnalyses):
    """Part of :class:`~.module.Module`: one call for each analysis."""

    kernels: Kernels

    @cached_property
    def input_jacobian(self) -> Timed:
        """``input_jacobian(t, x)`` -> (n_x, n_u), the derivative of the complete rhs by the inputs."""
        return self._derivative("input_jacobian")

    @cached_property
    def parameter_jacobian(self) -> Timed:
        """``parameter_jacobian(t, x)`` -> (n_x, n_p), the derivative of the complete rhs by the parameters.

        The projection is part of the rhs: where parameters move the constraints, the state is taken along to the
        nearest one on them.  Exact at states on the constraints; others are projected first.
        """
        return self._derivative("parameter_jacobian")

    @np.errstate(all="ignore")
    def verify(self, *, states: int = 6, seed: int = 0, seconds: float = 12.0) -> Verification:
        """Compare this module with several independent calculations.

        Parameters
        ----------
        states : int
            Number of random states on the constraints, near the declared initial position.
        seed : int
            Of the states.
        seconds : float
            Time for all of it.  Variants of the model, the same mechanism described differently, have what is left, and
            at least 2 s; those that are not reached are left out and counted.

        Returns
        -------
        Verification
            ``ok``, ``table``, ``findings``, ``breaches``; printed, it is a table of the worst figures, their limits and
            where they are.

        Raises
        ------
        AssemblyError
            The loops do not close at the declared initial values.
        MissingDependencyError
            mpmath or SciPy is not installed.

        Notes
        -----
        A module that was compiled here is compared with its graph, with the graph in 50 digits, with Newton's and
        Euler's equations of every body and with SciPy.  Where ``Model.compile`` made it, variants of the model are
        compiled and compared with it too; with ``Equations.compile`` the model is not known, and they are left out.
        One of an exported package is compared with the figures that came with it, and with itself.
        """
        from ..verification.verify import verify

        return verify(self, states=states, seed=seed, seconds=seconds)  # type: ignore[arg-type]

    def _derivative(self, name: str) -> Timed:
        layout = self.kernels.layout
        refused = layout.given_rates or not layout.projects
        return cast("Timed", Refusal(layout)) if refused else self.kernels.timed(name)

    @np.errstate(all="ignore")
    def linearise(
        self,
        x: Mapping[str, float] | ArrayLike | None = None,
        t: float = 0.0,
        *,
        p: Any = None,
        u: Any = None,
        form: str = "minimal",
        independent: Sequence[str] | None = None,
    ) -> Linearisation:
        """Linearise the equations of motion about any state.

        Parameters
        ----------
        x : mapping of str to float, or (n_x,) array, optional
            A state: initial values by name, as :meth:`x0` takes them, or all of it, projected onto the constraints; by
            default the declared initial values, assembled.
        t : float
            Time (s), held fixed.
        p, u : optional
            As for ``bind``.
        form : {'minimal', 'full'}
            ``minimal``: states are the independent displacements and velocities along the constraints, nonholonomic
            ones included, so that constraints add no eigenvalues.  ``full``: A is ``jacobian(t, x)``.
        independent : sequence of str, optional
            Coordinates of the tree to take as the n_dof independent ones; where rates of coordinates are given, all
            independent coordinates, all independent velocities or both.

        Returns
        -------
        Linearisation
            A, B, C, D, names, eigenvalues, ``mass``, ``damping``, ``stiffness``, ``drift``, ``state_space()``.

        Raises
        ------
        UsageError
            Unknown names or a wrong shape.
        PartitionError
            The rank of the constraints drops here, or the chosen coordinates are not independent.

        Notes
        -----
        All matrices are exact derivatives of the complete right-hand side (implicit differentiation; no differences).
        """
        from ..analysis.linear import linearise

        return linearise(self, x, t, p=p, u=u, form=form, independent=independent)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def modes(
        self,
        x: Mapping[str, float] | ArrayLike | None = None,
        t: float = 0.0,
        *,
        p: Any = None,
        u: Any = None,
        independent: Sequence[str] | None = None,
    ) -> Modes:
        """Natural frequencies, mode shapes and damping ratios of small motions about an equilibrium.

        Parameters
        ----------
        x : mapping of str to float, or (n_x,) or (n_q,) array, optional
            The equilibrium, at rest where only coordinates are given; by default the one that :meth:`equilibrium` finds
            from the declared initial position.
        t : float
        p, u : optional
            As for ``bind``.
        independent : sequence of str, optional
            Coordinates to give the shapes in.

        Returns
        -------
        Modes
            ``frequencies`` (rad/s), ``hertz``, ``shapes``, ``motions``, ``rigid``, ``damped``.

        Raises
        ------
        UsageError
            The state is no equilibrium.
        EquilibriumError
            None was found.
        """
        from ..analysis.modes import find_modes

        return find_modes(self, x, t, p=p, u=u, independent=independent)  # type: ignore[arg-type]

    @np.errstate(all="ignore")
    def equilibrium(
        self,
        guess: Mapping[str, float] | ArrayLike | None = None,
        t: float = 0.0,
        *,
        p: Any = None,
        u: Any = None,
        hold: Mapping[str, float | None] | Sequence[str] = (),
        unknowns: Sequence[str] = (),
    ) -> Equilibrium:
        """Find a position at rest in which all forces are in balance (virtual work) and nonholonomic rows allow rest.

        Newton's iteration, then the motion in a viscous fluid, then Levenberg's and Marquardt's steps.

        Parameters
        ----------
        guess : mapping of str to float, or (n_q,) array, optional
            Where to start: coordinates by name, or all of them; the declared initial position by default.
        t : float
            Time (s), held fixed.  Constraints that move in time move with the velocities they have then.
        p, u : optional
            As for ``bind``.
        hold : mapping of str to float or None, or sequence of str
            Coordinates, of the tree or of cut joints, and where they are held; None: where the guess is.  With
            ``unknowns`` the parameters balance them, without they are supported (``supports`` says by what force).
        unknowns : sequence of str
            Parameters or inputs to solve for, such as a spring's free length: at least as many as held coordinates.

        Returns
        -------
        Equilibrium
            ``x``, ``q``, ``eq["theta"]``, ``unknowns``, ``supports``, ``eigenvalues``, ``stability``, ``linear``.

        Raises
        ------
        EquilibriumError
            None was found from the guess; the message names the coordinate with the largest force left, or one that
            nonholonomic constraints move even at rest.
        AssemblyError
            The loops do not close with the held values.
        UsageError
            An unknown name, or too few unknowns.
        """
        from ..analysis.equilibrium import find_equilibrium

        return find_equilibrium(self, guess, t, p=p, u=u, hold=hold, unknowns=unknowns)  # type: ignore[arg-type]

    def sensitivities(
        self,
        names: Sequence[str],
        span: float | tuple[float, float] | None = None,
        initial: Mapping[str, float] | ArrayLike | None = None,
        parameters: Any = None,
        inputs: Mapping[str, Any] | None = None,
        *,
        hold: Sequence[str] | None = None,
        **options: Any,
    ) -> Sensitivities:
        """Integrate a run together with its derivatives by parameters, inputs and initial values.

        Parameters
        ----------
        names : sequence of str
            What to differentiate by: parameters, inputs (a constant added to each) and initial values that are held.
        span, initial, parameters, inputs : optional
            As for ``simulate``.
        hold : sequence of str, optional
            Coordinates and rates that keep their initial values when something else changes; the constraints give the
            rest, by the smallest change where they leave a choice.  By default those given in ``initial``, then the
            declared ones, then the independent ones, while they leave each other room.
        **options
            method (of SciPy, DOP853), rtol (1e-9), atol (1e-11), t_eval, max_step, first_step.

        Returns
        -------
        Sensitivities
            ``s["theta", "k"]``, ``s.dx`` (n_x, k, n_t), ``s.dy`` (n_y, k, n_t), ``s.trajectory``.

        Raises
        ------
        UsageError
            An unknown name, or one that is not held.
        SimulationError, AssemblyError, MissingDependencyError
            As for ``simulate``.
        """
        from ..analysis.sensitivities import differentiate_run

        return differentiate_run(self, names, span, initial, parameters, inputs, hold=hold, **options)  # type: ignore[arg-type]
