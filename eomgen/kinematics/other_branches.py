"""Stage kinematics: Mobility -> closed positions that fit the initial values and the guess as well as the one taken."""

from __future__ import annotations

from itertools import islice

import numpy as np

from ..base.limits.analyses import BESIDE
from ..numeric.closure import close, closed
from ..numeric.projection import largest
from ..numeric.starts import starts
from .constraint_functions import Array, ConstraintFunctions
from .kinematics import Kinematics
from .mobility import Mobility, initial_values

TRIES = 36  #: starts of the search, of which the farther half is taken
MANY = 3  #: branches to tell of


@np.errstate(all="ignore")
def other_branches(kinematics: Kinematics, mobility: Mobility) -> list[dict[str, float]]:
    """One coordinate of each such position, with its value there.

    The independent coordinates and those of the guess are held where they are.  Of a rotation by several angles, which
    describe it twice, nothing is told: only joints of one degree of freedom count.
    """
    mechanism = kinematics.mechanism
    joints = sorted((j for j in mechanism.joints if len(j.coordinates) == 1), key=lambda j: not j.named)
    single = [j.coordinates[0] for j in joints]  # those that the user named first, as words for a branch
    if mobility.assumed or not kinematics.constraints.labels or not single:
        return []
    numbers = {p.name: float(p.value or 0.0) for p in mechanism.parameters}
    numbers |= {u.name: float(u.value or 0.0) for u in mechanism.inputs}
    functions = ConstraintFunctions(kinematics, numbers)
    system, here = functions.system, np.array(mobility.q_reference)
    known = {*kinematics.names, *kinematics.loop_coordinates.names}
    given = {name: x for name, x in initial_values(kinematics, numbers).items() if name in known}
    kinds = dict(zip(kinematics.names, kinematics.kinds, strict=True))
    guessed = [name for name in mechanism.guess if name in known and kinds.get(name) != "parameter"]
    held = dict(zip(guessed, system.measure(guessed, here)[0].tolist(), strict=True))
    at = dict(zip(kinematics.names, mobility.q_reference, strict=True))
    held |= {name: at[name] for name in mobility.independent if name in at}
    equations, names = system.closure(system.settle({**held, **given})), [n for n in single if n in known]
    values, _ = system.measure(names, here)
    sizes, angles = _sizes(functions, names)
    found: list[Array] = []
    told: list[dict[str, float]] = []
    for start in islice(starts(here, equations.free, system.scales, TRIES), TRIES // 2 + 1, None):  # those far away
        q, residual = close(equations, start)
        if not closed(residual) or not system.aligned(q):
            continue
        turned = system.measure(names, q)[0] - values
        gaps = np.where(angles, np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi, turned)
        if largest(gaps / sizes) > BESIDE and all(largest((gaps - other) / sizes) > BESIDE for other in found):
            k = int((np.abs(gaps / sizes) > BESIDE).argmax())
            found.append(gaps)
            told.append({names[k]: float(values[k] + gaps[k])})
        if len(found) == MANY:
            break
    return told


def _sizes(functions: ConstraintFunctions, names: list[str]) -> tuple[Array, Array]:
    """Typical size of each coordinate, and whether it is an angle."""
    kinematics, loop = functions.kinematics, functions.kinematics.loop_coordinates
    kinds = dict(zip((*kinematics.names, *loop.names), (*kinematics.kinds, *loop.kinds), strict=True))
    lengths = np.array([kinds[name] == "length" for name in names])
    return np.where(lengths, functions.length_scale, 1.0), ~lengths
