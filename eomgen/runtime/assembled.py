"""The calls of a Module that close its loops: values by name, of outputs too -> positions and states."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.analyses import MOST_ANGLE
from ..base.limits.constraints import CHOSEN
from ..base.texts import angle_in_degrees
from ..errors import calls_within, ill_placed, ill_shaped, no_number
from .argument_checks import read_number, read_numbers, require_mapping
from .argument_names import both_names
from .initial import Given, Initial
from .kernels import Kernels
from .layout import Layout


class Assembled:
    """What a :class:`~.bound_model.BoundModel` can say about the positions that its loops allow."""

    kernels: Kernels
    layout: Layout
    x_names: tuple[str, ...]
    n_q: int
    n_x: int

    if TYPE_CHECKING:

        def bind(self, p: Any = None, u: Any = None) -> Self:
            """See :meth:`~.bound_model.BoundModel.bind`."""

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
        initial, given = self._given(values, named, t, p, u)
        q = initial.assembled(given.positions)
        v = initial.velocities(q, given.rates if given.positions or given.rates else None)
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
        initial, given = self._given(guess, named, t, p, u)
        if given.rates:
            raise ill_placed(f"assemble takes positions only, not {', '.join(given.rates)}; use x0 for rates")
        return initial.from_guess(given.positions) if given.positions else initial.assembled({})

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
        initial, given = self._given(values, named, t, p, u)
        first = initial.assembled(given.positions, rough=True)
        return initial.branches(given.positions, first)

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

    def _given(self, values: Any, named: Any, t: float, p: Any, u: Any) -> tuple[Initial, Given]:
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
        """The assembly of this model with other parameters and inputs, if given, to values of these names.

        Raises
        ------
        UsageError
            A number where parameters or inputs are meant, since a coordinate bears the name p or u.
        """
        layout = self.layout
        for name, given, what in (("p", p, "parameters"), ("u", u, "inputs")):
            scalar = isinstance(given, (float, int, np.number)) or (isinstance(given, np.ndarray) and not given.ndim)
            if scalar and name in layout.q + layout.loops + layout.v:
                kind = "state" if name in layout.states else "velocity" if name in layout.v else "coordinate"
                raise ill_placed(f"{name}= gives the {what}; give the {kind} {name!r} in a dict: {{{name!r}: ...}}")
        kernels = (self if p is None and u is None else self.bind(p, u)).kernels
        return Initial(kernels, read_number("t", t), map(str, names))
