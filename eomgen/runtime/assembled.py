"""The calls of a Module that close its loops: values by name, of outputs too -> positions and states."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.analyses import MOST_ANGLE
from ..base.limits.constraints import CHOSEN
from ..base.limits.runs import DIFFERENCE, WIDE_DIFFERENCE
from ..base.names import place_of_marker
from ..base.picture_data import read_picture
from ..base.texts import angle_in_degrees
from ..errors import calls_within, cannot, ill_placed, ill_shaped, no_number
from ..numeric.assembly import ConstraintSystem, CutJoints
from .argument_checks import UnknownNameError, read_number, read_numbers, require_mapping, unknown, without_dots
from .argument_names import both_names
from .initial import Given, Initial
from .kernels import Kernels
from .layout import Layout

# -- values of outputs -------------------------------------------------------------------------------------------------

# An output of q and t alone, and a place such as ``x(rod.tip)``, is wanted of a position; an output that is linear in
# the velocities, and a velocity such as ``vx(rod.tip)``, of the velocities.


class WantedPosition(NamedTuple):
    """A function of q and t."""

    name: str
    scale: float  #: typical size
    evaluate: Callable[[Array, float], tuple[float, Array]]  #: (q, t) -> y, dy/dq (n_q,)


class WantedRate(NamedTuple):
    """An output that is linear in the velocities: y = y_v v + y_0."""

    name: str
    scale: float
    evaluate: Callable[[Array, float], tuple[Array, float]]  #: (q, t) -> y_v (n,), y_0


class WantedInitial(Initial):
    """Assembly that can also hold the outputs and places of markers among some names, and the outputs declared.

    Parameters
    ----------
    kernels : Kernels
    t : float
        Time (s).
    names : iterable of str

    Raises
    ------
    UsageError
        An output that depends on accelerations, or on velocities otherwise than linearly; no such marker.
    """

    def __init__(self, kernels: Kernels, t: float, names: Iterable[str]) -> None:
        super().__init__(kernels, t)
        self.layout = copy(kernels.layout)
        self.layout.initial = {**kernels.layout.initial, **kernels.layout.initial_outputs}
        wanted = dict.fromkeys([*names, *self.layout.initial])
        found = [one for one in (find_wanted(kernels, name, t) for name in wanted) if one is not None]
        self.wanted_rates = {one.name: one for one in found if isinstance(one, WantedRate)}
        positions = [one for one in found if isinstance(one, WantedPosition)]
        self.wanted_positions = frozenset(one.name for one in positions)
        self.system = with_wanted(self.system, positions)

    def sort(self, values: Mapping[str, float]) -> Given:
        places = {name: value for name, value in values.items() if place_of_marker(name)}
        others = {n: x for n, x in without_dots(values, self.layout.instances).items() if n not in places}
        rates = {name: value for name, value in (places | others).items() if name in self.wanted_rates}
        places = {name: value for name, value in places.items() if name not in rates}
        positions = places | {name: value for name, value in others.items() if name in self.wanted_positions}
        given = super().sort({n: x for n, x in others.items() if n not in positions and n not in rates})
        return Given(given.positions | positions, given.rates | rates)

    def rate_equation(self, q: Array, name: str) -> tuple[Array, float, float]:
        wanted = self.wanted_rates.get(name)
        return super().rate_equation(q, name) if wanted is None else (*wanted.evaluate(q, self.t), wanted.scale)

    def gradients(self, q: Array, name: str) -> list[Array]:
        if name not in self.wanted_rates:
            return super().gradients(q, name)
        row, _, scale = self.rate_equation(q, name)
        return [row * self.scales.q / scale]


def find_wanted(kernels: Kernels, name: str, t: float) -> WantedPosition | WantedRate | None:
    """The function that an output or a place of a marker is; None if the name is neither.

    Raises
    ------
    UsageError
        An output that depends on accelerations, or on velocities otherwise than linearly; no such marker.
    """
    if found := place_of_marker(name):
        return _marker(kernels, name, *found)
    plain = kernels.layout.plain(name)  # tip_x of an instance leg is leg.tip_x too
    return _output(kernels, plain, t) if plain in kernels.layout.y else None


def with_wanted(system: ConstraintSystem, wanted: Sequence[WantedPosition]) -> ConstraintSystem:
    """The constraints with these functions among the coordinates that can be held."""
    cut, space = system.cut, system.scales

    def evaluate(q: Array, t: float) -> tuple[Array, Array]:
        y, y_q = cut.evaluate(q, t)
        moves = np.stack([space.rates(q, unit) for unit in np.eye(len(space.q))], axis=1)
        found = [function.evaluate(q, t) for function in wanted]
        rows = np.array([slope @ moves for _, slope in found])
        return np.concatenate([y, [value for value, _ in found]]), np.vstack([y_q.reshape(-1, len(space.q)), rows])

    names = tuple(function.name for function in wanted)
    scales = np.concatenate([cut.scales, [function.scale for function in wanted]])
    extended = CutJoints(cut.names + names, cut.kinds + ("turn",) * len(names), scales, evaluate)
    return system._replace(cut=extended)


def _output(kernels: Kernels, name: str, t: float) -> WantedPosition | WantedRate:
    layout = kernels.layout
    n_q, n_v, k = layout.n_q, layout.n_v, layout.y.index(name)
    outputs, slopes = kernels.motion("motion_outputs"), kernels.motion("output_derivatives")
    zero = np.zeros(n_v)
    # at one position a slope may vanish that counts elsewhere, as sin(q) does at 0
    places = [layout.q_reference + turn * np.linspace(0.7, 1.3, n_q) for turn in (0.0, 0.3, -0.2)]
    found = np.array([[slopes(q, v, zero, t=t)[k] for v in (zero, np.linspace(0.3, 1.1, n_v))] for q in places])
    by_q, by_v, by_a = (np.nan_to_num(part) for part in np.split(found, (n_q, n_q + n_v, n_q + 2 * n_v), axis=-1)[:3])
    if by_a.any() or not np.allclose(by_v[:, 0], by_v[:, 1]):
        on = "accelerations" if by_a.any() else "velocities, and not linearly"
        raise cannot(
            f"the output {name!r} depends on {on}, so it cannot be given as an initial value; give coordinates"
        )

    def position(q: Array, t: float) -> tuple[float, Array]:
        return float(outputs(q, zero, zero, t=t)[k]), np.asarray(slopes(q, zero, zero, t=t)[k, :n_q])

    def rate(q: Array, t: float) -> tuple[Array, float]:
        return np.asarray(slopes(q, zero, zero, t=t)[k, n_q : n_q + n_v]), float(outputs(q, zero, zero, t=t)[k])

    scale = _scale(layout, layout.unit(name).removesuffix("/s"), by_v if by_v.any() else by_q)
    return WantedRate(name, scale, rate) if by_v.any() else WantedPosition(name, scale, position)


def _slope(function: Callable[[float], float]) -> float:
    """The derivative at 0 by the central formula of sixth order."""
    h = WIDE_DIFFERENCE
    one, two, three = (function(k * h) - function(-k * h) for k in (1, 2, 3))
    return (45.0 * one - 9.0 * two + three) / (60.0 * h)


def _scale(layout: Layout, unit: str, slopes: Array) -> float:
    known = {"m": layout.length, "rad": 1.0}
    return known.get(unit) or float(np.abs(slopes).max(initial=0.0)) or 1.0


def _marker(kernels: Kernels, name: str, what: str, marker: str) -> WantedPosition | WantedRate:
    """A coordinate of the place of a marker or of a body's origin, or of its velocity."""
    layout, poses, axis = kernels.layout, kernels.state("poses"), "xyz".index(what[-1])
    data = read_picture(layout.metadata, kernels.context.p)
    marker = layout.plain(marker)  # leg.thigh.knee of an instance leg
    if marker not in data.markers and marker not in layout.bodies:
        raise unknown("marker or body", marker, (*data.markers, *layout.bodies))
    own = marker in data.markers
    body = data.markers[marker].body if own else layout.bodies.index(marker)
    place = data.markers[marker].position if own else np.zeros(3)
    if body < 0:
        kind = "velocity" if what.startswith("v") else "position"
        raise UnknownNameError(f"{name!r} is a {kind} on the ground, which does not move")

    def value(q: Array, t: float) -> float:
        pose = poses(q, t=t)[body]
        return float(pose[axis, :3] @ place + pose[axis, 3])

    sizes = np.where([kind == "length" for kind in layout.coordinate_kinds], layout.length, 1.0)

    def moved(q: Array, step: Array, t: float, h: float) -> float:
        return value(q + h * step, t)

    def rate(q: Array, t: float) -> tuple[Array, float]:
        by_q = [_slope(partial(moved, q, step, t)) for step in np.diag(sizes)]
        moves = np.stack([layout.scales.rates(q, unit) for unit in np.eye(layout.n_v)], axis=1)
        return np.array(by_q) / sizes @ moves, 0.0  # places depend on time by coordinates alone

    if what.startswith("v"):
        return WantedRate(name, layout.length, rate)

    def evaluate(q: Array, t: float) -> tuple[float, Array]:
        steps = DIFFERENCE * sizes
        moves = np.diag(steps)
        slope = [(value(q + dq, t) - value(q - dq, t)) / (2.0 * h) for dq, h in zip(moves, steps, strict=True)]
        return value(q, t), np.array(slope)

    return WantedPosition(name, layout.length, evaluate)


# -- calls -------------------------------------------------------------------------------------------------------------


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
        return initial_of(kernels, read_number("t", t), names)


def initial_of(kernels: Kernels, t: float, names: Iterable[str]) -> Initial:
    """The assembly of a model to values of these names; outputs and places of markers may be among them."""
    names = [*map(str, names), *kernels.layout.initial_outputs]
    if not any("(" in name or name in kernels.layout.y for name in map(kernels.layout.plain, names)):
        return Initial(kernels, t)

    return WantedInitial(kernels, t, names)
