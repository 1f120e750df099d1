"""A Module and prescribed coordinates -> its motion over a range of them or of time; how far a coordinate can move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.constraints import EXACT, UNMOVED
from ..base.limits.positions import ALIGNED
from ..base.results import Result, plain, same_keys
from ..base.scales import largest
from ..base.texts import quote
from ..errors import (
    PartitionError,
    ill_shaped,
    ill_typed,
    incomplete,
    no_number,
    off_range,
    too_large,
)
from ..runtime.argument_checks import check_names, read_flag, read_number, read_numbers, require_size, unknown
from ..runtime.prescribed.followed_path import DrivenCoordinates, DrivenPath, FollowedPath, Singular
from ..runtime.prescribed.kinematic import KinematicAnalysis, complete, describe_gap, follow_to_start, keep, start_from
from ..runtime.refusals import require_support
from ..runtime.trajectory import Start

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- a range -----------------------------------------------------------------------------------------------------------


LONGEST = 4000.0 * np.pi  #: radians or length scales followed at most, 2000 turns


class Range(NamedTuple):
    """The requested positions: n points."""

    t: Array  #: (n,)
    names: tuple[str, ...]  #: of the led coordinates
    y: Array  #: (n_led, n)
    y1: Array  #: their rates
    y2: Array


def read_range(module: BoundModel, t: ArrayLike | None, named: Mapping[str, Any]) -> Range:
    """Sort names into led coordinates, their rates and accelerations."""
    layout = module.layout
    coordinates = layout.q + layout.loops
    known = [name + suffix for name in coordinates for suffix in ("", "_dot", "_ddot")]
    check_names("coordinate or rate", named, known, ("t",))
    names = tuple(name for name in named if name in coordinates)
    for name in named:
        base = next((c for c in coordinates if name in (c + "_dot", c + "_ddot")), None)
        if name not in names and base not in names:
            raise incomplete(f"{name} is given without values of {base}; give both")
    arrays = {name: _column(name, value) for name, value in named.items()}
    if t is not None:
        arrays["t"] = _column("t", t)
    sizes = {name: x.size for name, x in arrays.items() if x.ndim}
    if not sizes:
        raise incomplete("there is no range: give times t, or values of a coordinate, as an array")
    if len(set(sizes.values())) > 1:
        raise ill_shaped(f"all arrays must have one length, not {', '.join(f'{n}: {k}' for n, k in sizes.items())}")
    n = next(iter(sizes.values()))
    require_size(f"a range of {n} points", n * (3.0 * layout.n_x + len(known)), "give fewer points")

    def stack(suffix: str) -> Array:
        rows = [np.broadcast_to(arrays.get(name + suffix, np.zeros(())), n) for name in names]
        return np.array(rows, dtype=float).reshape(len(names), n)

    times = np.broadcast_to(arrays.get("t", np.zeros(())), n)
    y, y1 = stack(""), stack("_dot")
    for k, name in enumerate(names):
        if np.ptp(times) and np.ptp(y[k]) and name + "_dot" not in named:
            raise incomplete(f"{name} varies with t: give {name}_dot too (and {name}_ddot, unless it is 0)")
    return Range(np.array(times), names, y, y1, stack("_ddot"))


def _column(name: str, value: Any) -> Array:
    array = read_numbers(name, value)
    require_size(f"a range of {array.size} points", 3.0 * array.size, "give fewer points")
    if array.ndim > 1 or not array.size or not np.isfinite(array).all():
        raise no_number(f"{name} must be a finite number, or an array (n,) of them, not {quote(value)}")
    return array


def kinematic_analysis(
    module: BoundModel,
    /,
    t: ArrayLike | None = None,
    initial: Start = None,
    parameters: Any = None,
    inputs: Any = None,
    *,
    partial: bool = False,
    **led: ArrayLike,
) -> KinematicAnalysis:
    """Compute positions, velocities and accelerations over a range of time or of coordinates, without forces.

    The range is followed from the initial position in small steps, so the mechanism stays on its branch, even through
    change points, where branches meet.

    Parameters
    ----------
    t : (n,) array or float, optional
        Times (s), for drivers; 0 by default.
    initial : mapping of str to float, or (n_q,) or (n_x,) array, optional
        Where to start, at the first time: named coordinates, or a position such as one of ``branches()``.  The
        declared initial position at t = 0 by default, from where it is followed to the first point; if that is a
        dead centre of the led coordinates, the branch is the one found next to it.
    parameters, inputs : optional
        As for :meth:`bind`.
    partial : bool
        Return the part of the range that can be reached instead of raising an error.
    **led : (n,) arrays or floats
        Values of the prescribed coordinates, of the tree or of cut joints, at most as many as degrees of freedom;
        the others stand still.  ``theta_dot=`` and ``theta_ddot=`` give their rates over time (0 by default).

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
    require_support(module.layout, "kinematic_analysis")
    requested = read_range(module, t, led)
    return analyse(module.bind(parameters, inputs), requested, initial, partial)


def analyse(module: BoundModel, requested: Range, initial: Start, partial: bool) -> KinematicAnalysis:
    """Follow the range from the initial position."""
    if module.layout.n_h < module.layout.n_c:
        module.layout.require_minimal_form()
    partial = read_flag("partial", partial)
    t0, y0 = float(requested.t[0]), requested.y[:, 0]
    start_t, q = start_from(module, initial, t0)
    try:
        names = complete(module, q, start_t, requested.names)
    except PartitionError:
        if initial is not None or not requested.names:
            raise
        # the declared position is a dead centre of theirs: begin at the first point, on whichever branch is next to it
        start_t, q = start_from(module, dict(zip(requested.names, y0.tolist(), strict=True)), t0)
        names = complete(module, q, start_t, requested.names)
    driven = DrivenCoordinates(module, names)
    further = driven.prescribed_values(q, start_t)[len(requested.names) :]
    start_y = driven.prescribed_values(q, start_t)
    count = len(requested.names)
    for k in np.flatnonzero(driven.wraps[:count]):  # the same angle, counted as requested
        start_y[k] += 2 * np.pi * np.round((y0[k] - start_y[k]) / (2 * np.pi))
    rest = np.repeat(further[:, None], len(requested.t), axis=1)
    still = np.zeros_like(rest)
    requested = Range(
        requested.t,
        names,
        np.concatenate([requested.y, rest]),
        np.concatenate([requested.y1, still]),
        np.concatenate([requested.y2, still]),
    )
    _refuse_long_ways(driven, names, np.column_stack([start_y, requested.y]))
    q = follow_to_start(driven, q, (start_t, start_y), (t0, requested.y[:, 0]))
    return follow_range(driven, requested, q, partial, count)


def _refuse_long_ways(driven: DrivenCoordinates, names: Sequence[str], y: Array) -> None:
    """Ways of more than LONGEST are not followed: they take hours, and positions repeat."""
    ways = np.abs(np.diff(y, axis=1)).sum(axis=1) / driven.led_scales
    k = int(ways.argmax()) if ways.size else 0
    if ways.size and ways[k] > LONGEST:
        raise too_large(
            f"the path of {names[k]} from the initial position to the end of the range is {ways[k]:.6g} rad or length "
            f"scales long ({ways[k] / (2 * np.pi):.6g} turns), and at most {LONGEST:.6g} are allowed; positions repeat "
            "after a turn, so give angles within one turn, or an initial position near the first point"
        )


def follow_range(driven: DrivenCoordinates, requested: Range, q: Array, partial: bool, size: int) -> KinematicAnalysis:
    """Straight pieces one after the other."""
    n = len(requested.t)
    pieces = _pieces(driven, requested)
    columns: list[tuple[Array, Array, Array]] = []
    collected: list[Singular] = []
    stop: Singular | None = None
    extents = float(np.ptp(requested.t)), largest(np.ptp(requested.y, axis=1) / driven.led_scales)
    count, done, points, places = 0, 0.0, list[tuple[float, float, Array]](), list[Array]()
    for first, last in pieces:
        t, y = float(requested.t[first]), requested.y[:, first]
        dt, dy = requested.t[first : last + 1] - t, requested.y[:, first : last + 1] - y[:, None]
        length = abs(float(dt[-1])) or largest(dy[:, -1] / driven.led_scales)
        path = DrivenPath(driven, t, y, float(dt[-1]) / length if length else 0.0, dy[:, -1] / (length or 1.0))
        along = np.abs(dt) if dt[-1] else np.abs(dy / driven.led_scales[:, None]).max(axis=0, initial=0.0)
        extent = extents[0] if dt[-1] else extents[1]
        followed = FollowedPath(path, q, length, extent)
        new = slice(0, None) if not columns else slice(1, None)  # a piece starts where the last one ended
        reach = np.array([followed.holds(s) for s in along])
        taken = np.arange(len(along))[new][reach[new]]
        index = first + taken
        columns.append(followed.motion(along[taken], (requested.y1[:, index], requested.y2[:, index])))
        count += len(taken)
        points += [(done + p.s, path.at(p.s)[0], p.q) for p in followed.continuation.points if followed.holds(p.s)]
        places.append(done + along[taken])
        done += length
        collected += followed.singular
        if followed.stop is not None:
            stop = followed.stop
            collected.append(followed.stop)
            break
        q = columns[-1][0][:, -1] if len(taken) else q
    along_all, times, positions = (np.array(part) for part in zip(*points, strict=True))
    x = np.vstack([positions.T, np.zeros((driven.layout.n_v, len(times)))])
    order = np.argsort(np.concatenate([along_all, *places]), kind="stable")
    passed = times, x, np.repeat(driven.module.u[:, None], len(times), axis=1), order
    result = keep(driven, requested.t[:count], columns, collected, stop, n, requested.names[:size], passed=passed)
    if count < n and not partial:
        gap = (
            ""
            if stop is None
            else describe_gap(driven, float(requested.t[count]), requested.y[:, count], stop.q) + "; "
        )
        error = PartitionError(
            f"the range cannot be followed to its end: {stop}; {gap}give partial=True for the part that can be reached "
            f"({count} of {n} points)",
            None if stop is None else stop.t,
            None if stop is None else stop.q,
        )
        error.reached = result  # type: ignore[attr-defined]
        raise error
    return result


def _pieces(driven: DrivenCoordinates, requested: Range) -> list[tuple[int, int]]:
    """First and last indices of straight pieces of the range."""
    scaled = np.concatenate([requested.t[None, :], requested.y / driven.led_scales[:, None]])
    steps = np.diff(scaled, axis=1)
    sizes = np.abs(steps).max(axis=0) if steps.size else np.empty(0)
    pieces: list[tuple[int, int]] = []
    first, direction = 0, None
    for k in range(len(sizes)):
        if sizes[k] <= UNMOVED:
            continue
        here = steps[:, k] / sizes[k]
        if (
            direction is not None
            and np.abs(here - direction).max() > ALIGNED + EXACT * np.abs(scaled[:, k]).max() / sizes[k]
        ):
            pieces.append((first, k))
            first = k
            direction = here
        elif direction is None:
            direction = here
    pieces.append((first, len(requested.t) - 1))
    return pieces


# -- how far a coordinate can move -------------------------------------------------------------------------------------


BEYOND = 0.05  #: of a length scale, a radian or a second past a limit, where the gap is told
FAR = 100.0  #: length scales to search for a limit of a length


@dataclass(frozen=True, repr=False)
class MotionRange(Result):
    """The range of a coordinate from a position, on the same branch, with all other prescribed coordinates at rest.

    Attributes
    ----------
    name : str
    lower, upper : float
        Its limits; infinite if the coordinate turns fully or no limit was found, or the bounds of the search if given.
    stops : (Singular or None, Singular or None)
        The singular positions at the limits.
    gaps : (str, str)
        For each limit a text that names the joint that would open beyond it.
    singular : tuple of Singular
        Change points between the limits.
    """

    KEYS = same_keys("name", "lower", "upper", "gaps")
    name: str
    lower: float
    upper: float
    stops: tuple[Singular | None, Singular | None]
    gaps: tuple[str, str]
    singular: tuple[Singular, ...]

    @property
    def unlimited(self) -> bool:
        """Whether no limit was found on either side."""
        return self.stops == (None, None)

    def to_dict(self) -> dict[str, Any]:
        stops = [None if stop is None else plain(stop.facts) for stop in self.stops]
        return super().to_dict() | {"stops": stops}

    @property
    def title(self) -> str:
        return f"range of {self.name}"

    @property
    def facts(self) -> list[tuple[str, str]]:
        sides = zip(("lower", "upper"), (self.lower, self.upper), self.stops, self.gaps, strict=True)
        return [(side, f"{x:.9g}" + (f"   {stop}; {gap}" if stop else "")) for side, x, stop, gap in sides]


def motion_range(
    module: BoundModel,
    /,
    name: str,
    initial: Start = None,
    parameters: Any = None,
    inputs: Any = None,
    *,
    t: float = 0.0,
    within: tuple[float, float] | None = None,
) -> MotionRange:
    """Find the limits between which a coordinate can move, by following it in both directions.

    Parameters
    ----------
    name : str
        A coordinate of the tree or of a cut joint, or ``t`` for a mechanism that drivers move.
    initial : mapping or array, optional
        Position to start from, as for :meth:`kinematic_analysis`.
    parameters, inputs : optional
        As for :meth:`bind`.
    t : float
        Time (s), constant unless ``name`` is ``t``.
    within : (float, float), optional
        Bounds of the search; by default a full turn in both directions for an angle, else a hundred length scales or
        seconds.

    Returns
    -------
    MotionRange

    Raises
    ------
    PartitionError, AssemblyError, UsageError
        As :meth:`kinematic_analysis`.
    """
    require_support(module.layout, "motion_range")
    with np.errstate(all="ignore"):
        return _follow_both_ways(module.bind(parameters, inputs), name, initial, t, within)


def _follow_both_ways(
    module: BoundModel,
    name: str,
    initial: Start,
    t: float,
    within: tuple[float, float] | None,
) -> MotionRange:
    layout, t = module.layout, read_number("t", t)
    if layout.n_h < layout.n_c:
        layout.require_minimal_form()
    known = (*layout.q, *layout.loops, "t")
    if not isinstance(name, str) or name not in known:
        raise unknown("coordinate", name, known)
    start_t, q = start_from(module, initial, t)
    if start_t != t:
        q = start_from(module, q, t)[1]
    names = complete(module, q, t, () if name == "t" else (name,))
    driven = DrivenCoordinates(module, names)
    y = driven.prescribed_values(q, t)
    k = names.index(name) if name in names else -1
    here = t if name == "t" else float(y[k])
    kinds = dict(zip((*layout.q, *layout.loops), (*layout.coordinate_kinds, *layout.loop_kinds), strict=True))
    turns = name != "t" and driven.led_scales[k] == 1.0 and kinds[name] != "length"
    reach = 2 * np.pi if turns else FAR * (1.0 if name == "t" else layout.length)
    low, high = here - reach, here + reach
    if within is not None:
        bounds = read_numbers("within", within)
        if bounds.shape != (2,):
            raise ill_typed(f"within must be (lowest, highest), not {quote(within)}")
        low, high = bounds.tolist()
    if not low <= here <= high:
        raise off_range(f"{name} is {here:.6g} at the start, which is not within {low:.6g} .. {high:.6g}")
    result: list[tuple[float, Singular | None, str]] = []
    singular: list[Singular] = []
    for sign, bound in ((1.0, high), (-1.0, low)):
        y1 = np.zeros(len(y))
        if k >= 0:
            y1[k] = sign
        path = DrivenPath(driven, t, y, sign if name == "t" else 0.0, y1)
        followed = FollowedPath(path, q, abs(bound - here))
        singular += followed.singular
        gap = ""
        if followed.stop is not None:
            beyond = followed.reached + BEYOND * (1.0 if name == "t" else float(driven.led_scales[k]))
            gap = describe_gap(driven, *path.at(beyond), followed.stop.q)
        whole = within is None and followed.stop is None
        limit = sign * np.inf if whole else here + sign * followed.reached
        result.append((float(limit), followed.stop, gap))
        if turns and whole:
            result.append((-np.inf, None, ""))
            break
    (upper, top, above), (lower, bottom, below) = result
    return MotionRange(name, lower, upper, (bottom, top), (below, above), tuple(singular))
