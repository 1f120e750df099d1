"""Stage verification, rotations: spherical and free joints in other Euler angles, or in Euler parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...describe.description import Description, Entry
from ...joints.base import SEQUENCES
from ...numeric import algebra
from .turns import matrix_of
from .variant import NotApplicable, References, States, Variant, coordinates_of, drop
from .visit import copied

_UNIT = dict(zip("xyz", np.eye(3), strict=True))


def _about(axis: str, angle: float) -> Any:
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = np.cos(angle)
    turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
    return turn


def of_angles(sequence: str, angles: Sequence[float]) -> tuple[Any, Any]:
    """Rotation of intrinsic Euler angles, and the columns of the angular velocity in the turned axes."""
    a, b, c = (_about(axis, angle) for axis, angle in zip(sequence, angles, strict=True))
    columns = [(b @ c).T @ _UNIT[sequence[0]], c.T @ _UNIT[sequence[1]], _UNIT[sequence[2]]]
    return a @ b @ c, np.array(columns).T


def angles_of(sequence: str, turn: Any) -> Any:
    """Intrinsic Euler angles of a rotation.

    The axis i of the first turn comes off: with m = +1 for cyclic sequences, the angles follow from single entries.
    """
    i, j, k = ("xyz".index(axis) for axis in sequence)
    if i == k:
        other = 3 - i - j
        sign = 1.0 if (j - i) % 3 == 1 else -1.0
        first = np.arctan2(turn[j, i], -sign * turn[other, i])
    else:
        sign = 1.0 if (j - i) % 3 == 1 else -1.0
        first = np.arctan2(-sign * turn[j, k], turn[k, k])
    rest = _about(sequence[0], first).T @ turn
    turned = rest @ _UNIT[sequence[2]] if i != k else rest @ _UNIT[sequence[0]]
    if i == k:
        side = 3 - i - j
        second = np.arctan2((-1.0 if (j - i) % 3 == 1 else 1.0) * turned[side], turned[i])
    else:
        second = np.arctan2((1.0 if (j - i) % 3 == 1 else -1.0) * turned[i], turned[k])
    last = _about(sequence[1], second).T @ rest
    m, n = (k + 1) % 3, (k + 2) % 3
    return np.array([first, second, np.arctan2(last[n, m], last[m, m])])


def parameters_of(turn: Any) -> Any:
    """Euler parameters of a rotation, by the largest of the four (Shepperd, 1978)."""
    trace = np.trace(turn)
    squares = np.array([trace, *np.diag(turn)])
    k = int(np.argmax(squares))
    if k == 0:
        e = np.array([1 + trace, turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    else:
        i = k - 1
        j, n = (i + 1) % 3, (i + 2) % 3
        e = np.zeros(4)
        e[0], e[1 + i] = turn[n, j] - turn[j, n], 1 + turn[i, i] - turn[j, j] - turn[n, n]
        e[1 + j], e[1 + n] = turn[j, i] + turn[i, j], turn[n, i] + turn[i, n]
    return e / np.linalg.norm(e)


def redescribe(description: Description, random: Any) -> Variant:
    """Each spherical and free joint that nothing refers to in the other description, or in another sequence."""
    made, references, names = copied(description), References(description), coordinates_of(description)
    parts: list[States] = []
    chosen: list[str] = []
    for entry in made.sections["joints"]:
        if entry.values["type"] not in ("spherical", "free"):
            continue
        place = 3 if entry.values["type"] == "free" else 0
        own = names[entry.name][place:]
        if references.to((entry.name, *own)):
            continue
        chosen.append(entry.name)
        parts.append(_change(made, entry, names[entry.name], place, random))
    if not chosen:
        raise NotApplicable("there is no spherical or free joint that nothing refers to")

    def state(values: Mapping[str, float]) -> dict[str, float]:
        result = dict(values)
        for part in parts:
            result |= part(values)
        return result

    return Variant(made, state)


def _change(made: Description, entry: Entry, names: Sequence[str], place: int, random: Any) -> States:
    """Change one joint; returns how its coordinates follow."""
    values, joint, own = entry.values, entry.name, names[place:]
    was = values.pop("rotation", "euler_angles")
    before = values.pop("sequence", "xyz")
    spins = [f"{joint}_w{axis}" for axis in "xyz"]
    after = ""
    if was == "euler_angles" and random.random() < 0.5:
        values["rotation"] = "euler_parameters"
        new = [f"{joint}_e{k}" for k in range(4)]
    else:
        after = values["sequence"] = _sequence(made, entry, own, before if was == "euler_angles" else "", random)
        new = [f"{joint}_new_{k}" for k in (1, 2, 3)]
    values["coordinates"] = [*names[:place], *new]
    start = made.values.get("guess", {})
    known = all(name in start and not isinstance(start[name], str) for name in own)

    def follow(given: Mapping[str, float]) -> dict[str, float]:
        if was == "euler_angles":
            turn, columns = of_angles(before, [given[name] for name in own])
            spin = columns @ np.array([given.get(name + "_dot", 0.0) for name in own])
        else:
            turn, spin = matrix_of([given[name] for name in own]), np.array([given.get(name, 0.0) for name in spins])
        if not after:
            return dict(zip([*new, *spins], [*parameters_of(turn), *spin], strict=True))
        angles = angles_of(after, turn)
        rates = algebra.solve(of_angles(after, angles)[1], spin)
        return dict(zip([*new, *(name + "_dot" for name in new)], [*angles, *rates], strict=True))

    rough = {name: float(x) for name, x in follow(start).items() if name in new} if known else {}
    fixed = any(name in made.values.get("initial", {}) for name in own)
    drop(made, [*own, *spins])
    made.values["guess"] |= rough
    if fixed:
        made.values["initial"] |= rough
    return follow


def _sequence(made: Description, entry: Entry, own: Sequence[str], before: str, random: Any) -> str:
    """Another sequence, far from its singular position at the initial state."""
    start = made.values.get("guess", {})
    if not all(name in start for name in own):
        raise NotApplicable("the initial state is not known")
    angles = [float(start[name]) for name in own]
    turn = of_angles(before, angles)[0] if before else matrix_of(angles)
    for number in random.permutation(len(SEQUENCES)):
        found = SEQUENCES[int(number)]
        if found != before and abs(np.linalg.det(of_angles(found, angles_of(found, turn))[1])) > 0.5:
            return found
    raise NotApplicable("no other sequence is far from its singular position")
