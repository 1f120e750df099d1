"""Stage verification, rotations: spherical and free joints in other Euler angles, or in Euler parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...describe.description import DescribedEntry, Description
from ...describe.visit import copied
from ...joints.joint import SEQUENCES
from ...numeric import algebra
from ...rotations import (
    euler_angles_from_matrix,
    euler_parameters_from_matrix,
    matrix_from_euler_angles,
    matrix_from_euler_parameters,
    velocity_matrix,
)
from .variant import NotApplicable, References, States, Variant, coordinates_of, drop

EULER = "euler_angles"


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
        raise NotApplicable("there is no spherical or free joint, or other elements name its coordinates")

    def state(values: Mapping[str, float]) -> dict[str, float]:
        result = dict(values)
        for part in parts:
            result |= part(values)
        return result

    return Variant(made, state)


def _change(made: Description, entry: DescribedEntry, names: Sequence[str], place: int, random: Any) -> States:
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
            angles = np.array([given[name] for name in own])
            turn = matrix_from_euler_angles(before, angles)
            spin = velocity_matrix(EULER, angles, sequence=before) @ [given.get(name + "_dot", 0.0) for name in own]
        else:
            turn = matrix_from_euler_parameters(np.array([given[name] for name in own]))
            spin = np.array([given.get(name, 0.0) for name in spins])
        if not after:
            return dict(zip([*new, *spins], [*euler_parameters_from_matrix(turn), *spin], strict=True))
        angles = euler_angles_from_matrix(after, turn)
        rates = algebra.solve(velocity_matrix(EULER, angles, sequence=after), spin)
        return dict(zip([*new, *(name + "_dot" for name in new)], [*angles, *rates], strict=True))

    rough = {name: float(x) for name, x in follow(start).items() if name in new} if known else {}
    fixed = any(name in made.values.get("initial", {}) for name in own)
    drop(made, [*own, *spins])
    made.values["guess"] |= rough
    if fixed:
        made.values["initial"] |= rough
    return follow


def _sequence(made: Description, entry: DescribedEntry, own: Sequence[str], before: str, random: Any) -> str:
    """Another sequence, far from its singular position at the initial state."""
    start = made.values.get("guess", {})
    if not all(name in start for name in own):
        raise NotApplicable("the initial state is not known")
    values = np.array([float(start[name]) for name in own])
    turn = matrix_from_euler_angles(before, values) if before else matrix_from_euler_parameters(values)
    for number in random.permutation(len(SEQUENCES)):
        found = SEQUENCES[int(number)]
        slopes = velocity_matrix(EULER, euler_angles_from_matrix(found, turn), sequence=found)
        if found != before and abs(np.linalg.det(slopes)) > 0.5:
            return found
    raise NotApplicable("no other sequence is far from its singular position")
