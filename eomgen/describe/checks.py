"""Stage describe, checks without kinematics: keys by the table of fields, masses, inertias, connection to ground."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..frames import GROUND
from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..graph.substitute import symbols_of
from .description import Entry, Faults
from .fields import KINDS, Fields
from .mechanism import Body, JointSpec
from .names import fault_of_name, nearest

#: A moment may exceed the sum of the other two by this part of it before it counts as wrong: published inertias of real
#: machines, measured or rounded, exceed it by up to a tenth (PUMA 560, link 3).
TRIANGLE = 0.2


def check_keys(path: str, values: Mapping[str, Any], fields: Fields, faults: Faults) -> None:
    """Note keys that a table does not know, and required ones that are missing."""
    for key in values:
        if key not in fields:
            faults.add(f"{path}.{key}", "unknown key", unknown_key(key, fields))
    for key, field in fields.items():
        if field.required and key not in values:
            faults.add(f"{path}.{key}", "is missing", f"give {KINDS[field.kind]}")


def unknown_key(key: object, fields: Iterable[str]) -> str:
    """The remedy for a key that a table does not know."""
    remedy = nearest(str(key), fields, "allowed")
    if fault_of_name(key):  # the tail of a text that a comma cut
        remedy += "; inside { } a text with a comma needs quotes"
    return remedy


def check_names(entries: Sequence[Entry], what: str, faults: Faults, reserved: Sequence[str] = ()) -> list[Entry]:
    """Note names that are no identifiers, reserved or used twice; returns the entries whose names can be used."""
    usable: list[Entry] = []
    seen: set[Any] = set()
    for entry in entries:
        fault = fault_of_name(entry.name)
        if fault:
            faults.add(entry.path, *fault)
        elif entry.name in reserved:
            faults.add(entry.path, f"{entry.name!r} is a name of its own", f"choose another name for the {what}")
        elif entry.name in seen:
            faults.add(entry.path, f"the name is given to two {_PLURAL.get(what, what + 's')}", "rename one")
        else:
            usable.append(entry)
        seen.add(entry.name)
    return usable


_PLURAL = {"body": "bodies"}


def check_bodies(bodies: Sequence[Body], values: Mapping[str, float], faults: Faults) -> None:
    """Note masses and inertias that no body can have, as far as the declared values of parameters tell."""
    for body in bodies:
        path = f"bodies.{body.name}"
        mass = _numbers([body.mass], values)
        if mass is not None and mass[0] < 0:
            how = "" if body.mass.value is not None else " at the declared values"
            faults.add(f"{path}.mass", f"is {mass[0]:g}{how}", "a mass is 0 or positive")
        entries = [entry for row in body.inertia for entry in row]
        tensor = _numbers(entries, values)
        if not _symmetric(body, tensor):
            faults.add(f"{path}.inertia", "the tensor is not symmetric", "entries [i][j] and [j][i] must be equal")
        elif tensor is not None:
            fault = _unphysical(np.reshape(tensor, (3, 3)))
            if fault:
                faults.add(f"{path}.inertia", *fault)


def _numbers(expressions: Sequence[Expr], values: Mapping[str, float]) -> list[float] | None:
    if not symbols_of(expressions) <= values.keys():
        return None
    result = [float(x) for x in evaluate(expressions, values)]
    return result if np.all(np.isfinite(result)) else None


def _symmetric(body: Body, tensor: Sequence[float] | None) -> bool:
    pairs = [(body.inertia[i][j], body.inertia[j][i]) for i, j in ((0, 1), (0, 2), (1, 2))]
    if all(a == b for a, b in pairs):
        return True
    if tensor is not None:
        full = np.reshape(tensor, (3, 3))
        return bool(np.allclose(full, full.T, rtol=1e-9, atol=1e-12 * float(np.max(np.abs(full), initial=0.0))))
    # written differently above and below the diagonal: equal if they agree wherever one looks
    flat = [x for pair in pairs for x in pair]
    names = sorted(symbols_of(flat))
    for seed in (1, 2, 3):
        draws = np.random.default_rng(seed).uniform(0.5, 1.5, len(names))
        result = np.asarray(evaluate(flat, dict(zip(names, draws.tolist(), strict=True))), dtype=float)
        if not np.allclose(result[::2], result[1::2], rtol=1e-9, atol=1e-12):
            return False
    return True


def _unphysical(tensor: np.ndarray) -> tuple[str, str] | None:
    """Message and remedy if no distribution of mass has this inertia.

    Two zero moments pass: whoever moves in a plane gives one moment only.
    """
    a, b, c = np.linalg.eigvalsh(tensor)
    size = max(abs(a), abs(c))
    if a < -1e-6 * size:
        return (
            f"has a negative principal moment {a:.6g}",
            "check the products: xy, xz, yz bear the tensor's own sign (minus the integral of x y dm)",
        )
    if b > 1e-9 * size and c > (1 + TRIANGLE) * (a + b):
        return (
            f"principal moments {a:.6g}, {b:.6g}, {c:.6g}: one exceeds the sum of the others",
            "no body has such an inertia; it is taken about the centre of mass, in kg m^2",
        )
    return None


#: Message and remedy for a body that only pure constraints (rods and the like) connect to ground.
UNHELD = (
    "only constraints without coordinates connect it to ground",
    "add a joint that gives it coordinates; a body that otherwise moves freely has a joint of type free",
)


def check_connected(bodies: Sequence[Body], joints: Sequence[JointSpec], faults: Faults) -> None:
    """Note bodies that no chain of joints connects to ground."""
    reached = _reached([joint for joint in joints if joint.joint.role != "loop"])
    touched = _reached(joints)
    for k, body in enumerate(bodies):
        if k not in touched:
            faults.add(
                f"bodies.{body.name}",
                "no chain of joints connects it to ground",
                "add a joint; a body that moves freely has a joint of type free",
            )
        elif k not in reached:
            faults.add(f"bodies.{body.name}", *UNHELD)


def _reached(joints: Sequence[JointSpec]) -> set[int]:
    """Bodies that these joints connect to ground."""
    neighbours: dict[int, list[int]] = {}
    for joint in joints:
        a, b = joint.predecessor.body, joint.successor.body
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    reached, waiting = {GROUND}, [GROUND]
    while waiting:
        for near in neighbours.get(waiting.pop(), ()):
            if near not in reached:
                reached.add(near)
                waiting.append(near)
    return reached
