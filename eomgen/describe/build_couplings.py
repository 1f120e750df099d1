"""Stage describe, couplings of coordinates: entries of gears, belts, racks and written relations -> elements."""

from __future__ import annotations

from collections.abc import Mapping

from ..constraints import Belt, Equation, Gear, Linear, Planetary, Rack
from ..constraints.base import POSITION, VELOCITY
from ..graph.core import Expr, sin
from ..graph.differentiate import gradient
from ..graph.substitute import symbols_of
from ..limits.descriptions import TENSOR
from .constraint_element import Element
from .coordinates import Found
from .fields_constraints import WHEELS
from .names import nearest
from .scope import ENERGIES, RATES


def coupling(e: Element) -> Linear | Equation | None:
    """A relation of coordinates, linear or any."""
    if "equation" in e.values:
        e.refuse("offset", "an equation has no offset")
        return _equation(e)
    given, path = e.values["coordinates"], f"{e.path}.coordinates"
    if not isinstance(given, Mapping) or not given:
        e.reader.wrong(path, given, "factors")
        return None
    terms: list[tuple[Found, Expr]] = []
    for key, value in sorted(given.items(), key=lambda pair: str(pair[0])):  # in one order, however given
        found = e.find(f"{path}.{key}", key)
        factor = e.reader.expression(f"{path}.{key}", value)
        if found is not None:
            if any(found.name == other.name for other, _ in terms):
                e.faults.add(f"{path}.{key}", f"{found.name!r} is named twice", "add its factors up")
            terms.append((found, factor))
    kind = "length" if any(found.kind == "length" for found, _ in terms) else "angle"
    return Linear(e.name, tuple((e.symbol(found), factor) for found, factor in terms), e.law("offset"), kind)


def _equation(e: Element) -> Equation | None:
    expression, path, names = e.law("equation"), f"{e.path}.equation", e.reader.names
    used = symbols_of([expression])
    places = {name: q for name, q in e.reader.quantities.items() if name in used}
    rates = {n for n in used if names.kinds.get(n) == "velocity"} | {n for n, q in places.items() if q.level == 1}
    for name in sorted(used):
        kind = names.kinds.get(name)
        if kind == "acceleration" or (name in places and places[name].level == 2):
            what = kind or "acceleration"
            e.faults.add(
                path, f"the {what} {name!r} cannot stand here", "a constraint knows t, inputs, coordinates, velocities"
            )
        if name in (f"{energy}()" for energy in ENERGIES):
            e.faults.add(path, f"the energy {name!r} cannot stand here", "a constraint is an equation of the motion")
    moving = {n for n in used if names.kinds.get(n) == "coordinate"} | rates | set(places)
    if not moving and not e.faults.under(path):
        e.faults.add(path, "there is no coordinate in it", f"coordinates: {', '.join(names.of('coordinate'))}")
    symbols = [e.reader.graph.symbol(n) for n in sorted(rates)]
    if rates & symbols_of(gradient(expression, symbols)):
        message = f"it is not linear in {', '.join(sorted(rates))}"
        e.faults.add(path, message, "a nonholonomic constraint is linear in the velocities")
    joints = e.around.declared
    kinds = {c: k.kind for j in joints for c, k in zip(j.coordinates, j.joint.coordinates, strict=True)}
    kinds |= {c + RATES[1]: kind for c, kind in kinds.items()}
    lengths = any(kinds.get(n) == "length" or (n in places and places[n].axis != 3) for n in moving)
    return Equation(e.name, expression, "length" if lengths else "angle", VELOCITY if rates else POSITION)


def gear(e: Element) -> Gear | None:
    """A pair of gears."""
    pair, ratio = e.pair("joints", "angle"), _ratio(e)
    if pair is None or ratio is None:
        return None
    ratio = -ratio if e.flag("internal") else ratio
    return Gear(e.name, e.symbol(pair[0]), e.symbol(pair[1]), ratio, e.law("phase"))


def belt(e: Element) -> Belt | None:
    """A belt on two pulleys."""
    pair, ratio = e.pair("joints", "angle"), _ratio(e)
    if pair is None or ratio is None:
        return None
    ratio = ratio if e.flag("crossed") else -ratio
    return Belt(e.name, e.symbol(pair[0]), e.symbol(pair[1]), ratio, e.law("phase"))


def _ratio(e: Element) -> Expr | None:
    """Second size over the first, by radii, teeth or sines of cone angles."""
    key = next(key for key in ("radii", "teeth", "cones") if key in e.values)
    sizes = e.sizes(key)
    if sizes is None or e.faults.under(f"{e.path}.{key}"):
        return None
    a, b = (sin(x) for x in sizes) if key == "cones" else sizes
    return b / a


def rack(e: Element) -> Rack | None:
    """A pinion on a rack."""
    pinion, travel = e.coordinate("pinion", "angle"), e.coordinate("rack", "length")
    if pinion is None or travel is None:
        return None
    e.same_carrier(e.path, pinion, travel)
    return Rack(e.name, e.symbol(pinion), e.symbol(travel), e.law("radius"), e.law("offset"))


def planetary(e: Element) -> Planetary | None:
    """A planetary set, its angles measured from the frame; the planet's from the frame or the carrier."""
    key = "radii" if "radii" in e.values else "teeth"
    sizes = _wheels(e, key)
    found = {part: e.coordinate(part, "angle") for part in ("sun", "ring", "carrier", "planet") if part in e.values}
    if any(x is None for x in found.values()) or sizes is None or e.faults.under(e.path):
        return None
    parts: dict[str, Found] = {part: x for part, x in found.items() if x is not None}
    for part in ("sun", "ring"):
        if part in parts and part not in sizes:
            e.faults.add(f"{e.path}.{key}", f"the {part} has a joint, and no size", f"give {key} of the {part}")
    main = [parts[part] for part in ("sun", "ring", "carrier") if part in parts]
    for other in main[1:]:
        e.same_carrier(e.path, main[0], other)
    enough = 2 if "planet" in parts else 1
    if len({"sun", "ring"} & sizes.keys()) == 0 or ("planet" not in parts and len({"sun", "ring"} & sizes.keys()) < 2):
        e.faults.add(
            f"{e.path}.{key}", "no ratio follows from these wheels", "give sun and ring, or planet and one more"
        )
    if "planet" in parts and len(sizes) < 2:
        e.faults.add(f"{e.path}.{key}", "one size gives no ratio", f"give two of {', '.join(WHEELS)}")
    if len(parts) < enough or not main:
        e.faults.add(e.path, "too few of its parts move", "give joints of sun, ring, carrier, planet")
    if e.faults.under(e.path):
        return None
    zero = e.reader.graph.zero
    sun, ring, carrier = (e.symbol(parts[p]) if p in parts else zero for p in ("sun", "ring", "carrier"))
    planet = _planet(e, parts, carrier)
    r_s, r_r, r_p = (sizes.get(wheel) for wheel in ("sun", "ring", "planet"))
    return Planetary(e.name, sun, ring, carrier, planet, r_s, r_r, r_p, e.law("phase"))


def _wheels(e: Element, key: str) -> dict[str, Expr] | None:
    given, path = e.values[key], f"{e.path}.{key}"
    if not isinstance(given, Mapping):
        e.reader.wrong(path, given, "wheels")
        return None
    for wheel in given:
        if wheel not in WHEELS:
            e.faults.add(f"{path}.{wheel}", "unknown key", nearest(str(wheel), WHEELS, "allowed"))
    sizes = {wheel: e.size(f"{path}.{wheel}", given[wheel]) for wheel in WHEELS if wheel in given}
    numbers = {wheel: size.value for wheel, size in sizes.items() if size.value is not None}
    if {"sun", "ring"} <= numbers.keys() and numbers["ring"] <= numbers["sun"]:
        message = f"ring {numbers['ring']:g} is not larger than sun {numbers['sun']:g}"
        e.faults.add(path, message, "the sun stands inside the ring")
    elif len(numbers) == 3 and abs(numbers["ring"] - numbers["sun"] - 2 * numbers["planet"]) > TENSOR * numbers["ring"]:
        message = f"ring {numbers['ring']:g} is not sun {numbers['sun']:g} + 2 planet {numbers['planet']:g}"
        e.faults.add(path, message, "the wheels of a planetary set fit into each other; leave one out")
    return sizes


def _planet(e: Element, parts: Mapping[str, Found], carrier: Expr) -> Expr | None:
    """The planet's angle from the carrier."""
    if "planet" not in parts:
        return None
    planet = e.symbol(parts["planet"])
    base = e.around.carrier(parts["planet"])
    if base is None or "carrier" not in parts:
        return planet
    if base == e.around.carried(parts["carrier"]):
        return planet
    if base == e.around.carrier(parts["carrier"]):
        return planet - carrier
    message = f"{parts['planet'].name!r} is measured neither from the carrier nor from the frame"
    e.faults.add(f"{e.path}.planet", message, "make one of them the predecessor of its joint")
    return None
