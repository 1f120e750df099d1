"""Stage verification, frames: every body's own frame, and ground, turned and shifted at random.

The old frame of a body stays as a marker of it, so that references keep their meaning; what is given in body axes
(centre of mass, inertia, solids, points, markers) is written in the new axes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ...describe.description import GROUND_NAME, DescribedEntry, Description, items
from ...describe.fields import INERTIA
from ...describe.marker_quantities import ElementQuantity, MarkerQuantity
from ...describe.rewritten_texts import is_zero, motions_of, number_of, product, rewritten, scaled, total
from ...describe.visit import Slot, Visitor, bodies_of, copied, visit
from ...numeric.rotation_matrices import from_quaternion, from_roll_pitch_yaw, roll_pitch_yaw
from .plain import values_of
from .variant import NotApplicable, Variant, kinds_of

WAS = "old_frame"  #: the marker that a body's former frame becomes
_PAIRS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
_KINDS = (
    *(("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az")),
    *(("wx", "wy", "wz"), ("wx_dot", "wy_dot", "wz_dot")),
    ("angular_momentum_x", "angular_momentum_y", "angular_momentum_z"),
)
_MOMENTA = ("momentum_x", "momentum_y", "momentum_z")
_TENSOR = "inertia_"  #: of all bodies, in ground axes: inertia_xx, ...


def random_turn(random: Any) -> Any:
    """A turn (3, 3) of any angle about any axis."""
    return from_quaternion(*random.normal(size=4))


class MovedBodyFrame:
    """The new frame of one body: new coordinates = turn old + shift."""

    def __init__(self, turn: Any, shift: Any, parameters: Mapping[str, float]) -> None:
        self.turn, self.shift, self.parameters = (
            np.asarray(turn, dtype=float),
            np.asarray(shift, dtype=float),
            parameters,
        )

    def point(self, at: Sequence[Any]) -> list[Any]:
        """A point, entries numbers or texts."""
        return [total([*row, 1.0], [*at, float(d)]) for row, d in zip(self.turn.tolist(), self.shift, strict=True)]

    def vector(self, value: Sequence[Any]) -> list[Any]:
        """A direction or a vector."""
        return [total(row, value) for row in self.turn.tolist()]

    def angles(self, rpy: Sequence[Any]) -> list[float]:
        """Roll, pitch, yaw; parameters in them are taken at their declared values."""
        turn = from_roll_pitch_yaw([number_of(x, self.parameters) for x in rpy])
        return [float(x) for x in roll_pitch_yaw(self.turn @ turn)]

    def tensor(self, rows: Sequence[Sequence[Any]]) -> list[list[Any]]:
        """A symmetric tensor, R I R^T; the lower triangle is the mirror image of the upper."""
        flat = [x for row in rows for x in row]
        made = [[total([*np.outer(a, b).ravel().tolist()], flat) for b in self.turn] for a in self.turn]
        return [[made[min(i, j)][max(i, j)] for j in range(3)] for i in range(3)]


class _Moved(Visitor):
    """References and placements of bodies whose frames have moved."""

    def __init__(self, places: Mapping[str, MovedBodyFrame]) -> None:
        self.places = places

    def scalar(self, value: Any, slot: Slot) -> Any:
        return rewritten(value, str, lambda quantity: str(quantity.renamed(self.moved)), self.element)

    def element(self, quantity: ElementQuantity) -> str:
        """What an element does, or what a joint carries along the axes of a marker."""
        return str(quantity.renamed(str, self.moved))

    def moved(self, label: str) -> str:
        """The marker that is where a body's own frame was."""
        return f"{label}.{WAS}" if label in self.places else label

    def marker(self, reference: Any, slot: Slot) -> Any:
        if isinstance(reference, str):
            return self.moved(reference)
        return super().marker(reference, slot)

    def placement(self, body: str, placed: Mapping[str, Any], slot: Slot) -> dict[str, Any]:
        place = self.places.get(body)
        if place is None:
            return dict(placed)
        at, rpy = placed.get("at", [0, 0, 0]), placed.get("rpy", [0, 0, 0])
        moved = {"at": place.point(at), "rpy": place.angles(rpy)}
        return moved if "rpy" in placed else {"at": moved["at"]}


def turn_bodies(description: Description, random: Any) -> Variant:
    """Every body's frame turned and shifted."""
    _require_bodies(description)
    parameters, size = values_of(description), length_of(description)
    places = {
        entry.name: MovedBodyFrame(random_turn(random), size * random.uniform(-0.5, 0.5, 3), parameters)
        for entry in bodies_of(description)
    }
    made = visit(description, _Moved(places))
    for entry in bodies_of(made):
        _turn_body(entry, places[entry.name])
    return Variant(made)


def _turn_body(entry: DescribedEntry, place: MovedBodyFrame) -> None:
    values = entry.values
    values["markers"][WAS] = {"at": place.point([0, 0, 0]), "rpy": place.angles([0, 0, 0])}
    solids = "solids" in values or ("points" in values and "mass" not in values)
    if "first_moment" in values:
        moved = [product(values["mass"], float(d)) for d in place.shift]
        values["first_moment"] = [
            total([1.0, 1.0], pair) for pair in zip(place.vector(values["first_moment"]), moved, strict=True)
        ]
    elif not solids:
        values["com"] = place.point(values.get("com", [0, 0, 0]))
    about = values.get("about", "com")
    if isinstance(about, str) and about not in ("com", "origin"):
        return  # a marker, whose axes count
    if not isinstance(about, str):
        values["about"] = place.point(about)
    elif about == "origin":
        values["about"] = place.point([0, 0, 0])
    if "principal" in values or "axes" in values or _one_moment(values.get("inertia")):
        if "principal" in values or "inertia" in values:
            values["axes"] = place.angles(values.get("axes", [0, 0, 0]))
    elif "inertia" in values:
        values["inertia"] = place.tensor(tensor_of(values["inertia"]))


def _one_moment(inertia: Any) -> bool:
    """Whether a moment about one axis alone is given, as of a planar body: no tensor of a body has but one."""
    return inertia is not None and sum(not is_zero(x) for row in tensor_of(inertia) for x in row) == 1


def tensor_of(given: Any) -> list[list[Any]]:
    """An inertia as a full tensor."""
    if isinstance(given, Mapping):
        full = [[0.0] * 3 for _ in range(3)]
        for name in INERTIA:
            i, j = _PAIRS[name]
            full[i][j] = full[j][i] = given.get(name, 0.0)
        return full
    if any(items(row) is not None for row in given):
        return [list(row) for row in given]
    return [[given[i] if i == j else 0.0 for j in range(3)] for i in range(3)]


def _require_bodies(description: Description) -> None:
    if not bodies_of(description):
        raise NotApplicable("there are no bodies")


def turn_ground(description: Description, random: Any) -> Variant:
    """Ground turned and shifted: gravity, markers of ground, and whatever is written in ground axes follow.

    Where an angle about z of ground is measured, ground is shifted only.
    """
    _require_bodies(description)
    texts: set[MarkerQuantity] = set()

    class Seen(Visitor):
        def scalar(self, value: Any, slot: Slot) -> Any:
            if isinstance(value, str):
                texts.update(motions_of(value))
            return value

    visit(description, Seen())
    angles = any(q.name in ("angle", "angle_rate") and not q.origin for q in texts)
    turn = np.eye(3) if angles else random_turn(random)
    place = MovedBodyFrame(turn, length_of(description) * random.uniform(-0.5, 0.5, 3), values_of(description))
    declared = {entry.name for entries in description.sections.values() for entry in entries} | {*kinds_of(description)}
    made = visit(copied(description), _Ground(place, declared))
    ground = next((entry for entry in made.sections["bodies"] if entry.name == GROUND_NAME), None)
    if ground is not None:
        ground.values["markers"][WAS] = {"at": place.point([0, 0, 0]), "rpy": place.angles([0, 0, 0])}
    return Variant(made, turn=place.turn)


class _Ground(_Moved):
    """What refers to ground, or is written in its axes."""

    def __init__(self, place: MovedBodyFrame, declared: Collection[str]) -> None:
        super().__init__({GROUND_NAME: place})
        self.place = place
        self.declared = declared  #: names of the model's own, which come before the words for sums over all bodies

    def vector(self, value: Any, slot: Slot) -> Any:
        result = super().vector(value, slot)
        if not isinstance(value, list):
            return result
        load = slot.section == "forces" and slot.key == "value" and slot.entry is not None
        if load and slot.entry is not None and slot.entry.values.get("axes", "ground") == "ground":
            return self.place.vector(result)
        return self.place.vector(result) if slot.key == "gravity" else result

    def scalar(self, value: Any, slot: Slot) -> Any:
        def locate(given: MarkerQuantity) -> str:
            quantity = given.renamed(self.moved)
            if quantity.axes:
                return str(quantity if quantity.origin else quantity._replace(origin=f"{GROUND_NAME}.{WAS}"))
            for names in _KINDS:
                if quantity.name in names:
                    column = self.place.turn[:, names.index(quantity.name)]
                    shift = self.place.shift if quantity.name in _KINDS[0] and not quantity.origin else np.zeros(3)
                    parts = [
                        scaled(str(quantity._replace(name=name)), float(c))
                        for name, c in zip(names, column, strict=True)
                    ]
                    return "(" + " + ".join([*parts, repr(-float(column @ shift))]) + ")"
            return self._tensor_entry(quantity) if quantity.name.startswith(_TENSOR) else str(quantity)

        return rewritten(value, self._momentum, locate, self.element)

    def _momentum(self, name: str) -> str:
        """The linear momentum along an old axis; other names stay."""
        if name not in _MOMENTA or name in self.declared:
            return name
        return f"({total(self.place.turn[:, _MOMENTA.index(name)].tolist(), _MOMENTA)})"

    def _tensor_entry(self, quantity: MarkerQuantity) -> str:
        """The inertia of all bodies about old axes: a^T I b of their directions a, b."""
        i, j = _PAIRS[quantity.name.removeprefix(_TENSOR)]
        products = np.outer(self.place.turn[:, i], self.place.turn[:, j])
        factors = [products[k, l] + (products[l, k] if k != l else 0.0) for k, l in _PAIRS.values()]
        entries = [str(quantity._replace(name=_TENSOR + pair)) for pair in _PAIRS]
        return f"({total([float(x) for x in factors], entries)})"

    def element(self, quantity: ElementQuantity) -> str:
        if quantity.part and not quantity.axes and quantity.part not in ("size", "normal"):
            quantity = quantity._replace(axes=GROUND_NAME)
        return super().element(quantity)


def length_of(description: Description) -> float:
    """A length of the order of the mechanism's: the largest distance of a marker from its body's origin."""
    parameters, found = values_of(description), [0.0]

    class Note(Visitor):
        def placement(self, body: str, placed: Mapping[str, Any], slot: Slot) -> dict[str, Any]:
            found.append(float(np.linalg.norm([number_of(x, parameters) for x in placed.get("at", (0, 0, 0))])))
            return dict(placed)

    visit(description, Note())
    return max(found) or 1.0
