"""Stage runtime: the calls of a Module that analyse its motion without forces; each loads its part of analysis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .analyses import require_velocities

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from ..analysis.motions import KinematicAnalysis
    from ..analysis.reaching import MotionRange
    from ..analysis.workspace import Workspace


class KinematicAnalyses:
    """Part of :class:`~.module.Module`: motion that follows from constraints and given coordinates alone."""

    def kinematic_analysis(
        self,
        t: ArrayLike | None = None,
        initial: Mapping[str, float] | ArrayLike | None = None,
        parameters: Any = None,
        inputs: Any = None,
        *,
        partial: bool = False,
        **led: ArrayLike,
    ) -> KinematicAnalysis:
        """Positions, velocities and accelerations over a range of time or of coordinates, without forces.

        The range is walked from the initial position in small steps, so the mechanism stays on its branch, also through
        change points, where others meet it.

        Parameters
        ----------
        t : (n,) array or float, optional
            Times (s), for drivers; 0 by default.
        initial : mapping of str to float, or (n_q,) or (n_x,) array, optional
            Where to start, at the first time: named coordinates, or a position such as one of ``branches()``.  The
            declared initial position at t = 0 by default, from where it is walked to the first point; if that is a
            dead centre of the led coordinates, the branch is the one found next to it.
        parameters, inputs : optional
            As for :meth:`bind`.
        partial : bool
            Return the part of the range that can be reached instead of raising an error.
        **led : (n,) arrays or floats
            Values of coordinates, of the tree or of cut joints, at most as many as degrees of freedom; those left
            over stand still.  ``theta_dot=`` and ``theta_ddot=`` give their rates over time (0 by default).

        Returns
        -------
        KinematicAnalysis

        Raises
        ------
        PartitionError
            The range cannot be followed to its end (``.reached`` holds the part before), or its start is singular.
        AssemblyError
            The initial values do not fit the loops and drivers.
        UsageError
            Unknown names, wrong shapes, too many coordinates led.
        """
        from ..analysis.kinematic import analyse, read_range

        module: Any = self
        require_velocities(module.layout)
        asked = read_range(module, t, led)
        if parameters is not None or inputs is not None:
            module = module.bind(parameters, inputs)
        return analyse(module, asked, initial, partial)

    @np.errstate(all="ignore")
    def motion_range(
        self,
        name: str,
        initial: Mapping[str, float] | ArrayLike | None = None,
        parameters: Any = None,
        inputs: Any = None,
        *,
        t: float = 0.0,
        within: tuple[float, float] | None = None,
    ) -> MotionRange:
        """The limits between which a coordinate can move the mechanism, found by walking both ways.

        Parameters
        ----------
        name : str
            A coordinate of the tree or of a cut joint, or ``t`` for a mechanism that drivers move.
        initial : mapping or array, optional
            Position to start from, as for :meth:`kinematic_analysis`.
        parameters, inputs : optional
            As for :meth:`bind`.
        t : float
            Time (s); stands still unless ``name`` is ``t``.
        within : (float, float), optional
            Where to look; a full turn both ways for an angle, a hundred length scales or seconds else.

        Returns
        -------
        MotionRange

        Raises
        ------
        PartitionError, AssemblyError, UsageError
            As :meth:`kinematic_analysis`.
        """
        from ..analysis.reaching import find_range

        module: Any = self
        require_velocities(module.layout)
        if parameters is not None or inputs is not None:
            module = module.bind(parameters, inputs)
        return find_range(module, name, initial, t, within)

    @np.errstate(all="ignore")
    def workspace(
        self,
        over: Mapping[str, Any],
        of: str | Sequence[str],
        initial: Mapping[str, float] | ArrayLike | None = None,
        parameters: Any = None,
        inputs: Any = None,
        *,
        t: float = 0.0,
        limits: bool | Mapping[str, tuple[float | None, float | None]] = False,
        points: int = 100_000,
    ) -> Workspace:
        """What outputs can reach over a grid of independent coordinates, and how well conditioned it is there.

        The grid is walked from the initial position, neighbour to neighbour, so that the mechanism stays on its branch.

        Parameters
        ----------
        over : mapping of str to (float, float, int) or (n,) array
            One to three coordinates, of the tree or of cut joints, each with (low, high, count) or rising or falling
            values; ``t`` for drivers.  Coordinates not named, as far as they are free, stand still.
        of : str or sequence of str
            Outputs that are functions of position, such as coordinates of a marker, and coordinates.
        initial : mapping or array, optional
            Position to start from, as for :meth:`kinematic_analysis`.
        parameters, inputs : optional
            As for :meth:`bind`.
        t : float
            Time (s), unless it is varied.
        limits : bool, or mapping of str to (lower, upper)
            Whether to stay within the limits the joints declare, or limits of coordinates; None for none.
        points : int
            Most points a grid may have.

        Returns
        -------
        Workspace
            ``ws["tip_x"]``, ``status``, ``jacobian``, ``manipulability``, ``quality``, ``singularities``, ``area()``.

        Raises
        ------
        PartitionError
            No point of the grid can be reached, or the start is singular.
        AssemblyError
            The initial values do not fit the loops and drivers.
        UsageError
            Unknown names, too many coordinates, too many points, outputs that are not functions of position.
        """
        from ..analysis.workspace import find_workspace

        module: Any = self
        require_velocities(module.layout)
        if parameters is not None or inputs is not None:
            module = module.bind(parameters, inputs)
        return find_workspace(module, over, of, initial, t, limits, points)
