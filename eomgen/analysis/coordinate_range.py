"""A Module and a coordinate -> the range in which it can move the mechanism from a position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.results import Result, plain, same_keys
from ..base.texts import shown
from ..errors import ill_typed, off_range
from ..runtime.argument_checks import read_number, read_numbers, unknown
from ..runtime.refusals import require_support
from ..runtime.runs.followed_path import DrivenCoordinates, DrivenPath, FollowedPath, Singular
from ..runtime.runs.kinematic import complete, describe_gap, start_from
from ..runtime.trajectory import Start

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

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
    if parameters is not None or inputs is not None:
        module = module.bind(parameters, inputs)
    with np.errstate(all="ignore"):
        return _follow_both_ways(module, name, initial, t, within)


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
    y = driven.led_values(q, t)
    k = names.index(name) if name in names else -1
    here = t if name == "t" else float(y[k])
    turns = name != "t" and driven.led_scales[k] == 1.0 and not _is_length(module, name)
    reach = 2 * np.pi if turns else FAR * (1.0 if name == "t" else layout.length)
    low, high = here - reach, here + reach
    if within is not None:
        bounds = read_numbers("within", within)
        if bounds.shape != (2,):
            raise ill_typed(f"within must be (lowest, highest), not {shown(within)}")
        low, high = bounds.tolist()
    if not low <= here <= high:
        raise off_range(f"{name} is {here:.6g} at the start, which is not within {low:.6g} .. {high:.6g}")
    found: list[tuple[float, Singular | None, str]] = []
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
        found.append((float(limit), followed.stop, gap))
        if turns and whole:
            found.append((-np.inf, None, ""))
            break
    (upper, top, above), (lower, bottom, below) = found
    return MotionRange(name, lower, upper, (bottom, top), (below, above), tuple(singular))


def _is_length(module: BoundModel, name: str) -> bool:
    layout = module.layout
    kinds = dict(zip((*layout.q, *layout.loops), (*layout.coordinate_kinds, *layout.loop_kinds), strict=True))
    return kinds[name] == "length"
