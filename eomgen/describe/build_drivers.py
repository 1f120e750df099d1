"""Stage describe, drivers: entries of type driver -> the measure that is driven, and its motion over time."""

from __future__ import annotations

from ..constraints import AngleDriver, CoordinateDriver, DistanceDriver, Driver, PlaceDriver
from ..frames import Marker
from ..graph.core import Expr
from ..graph.substitute import symbols_of
from ..graph.traverse import reachable
from .constraint_element import Element
from .placement import TURNS

#: Kinds of tables whose second derivative jumps between points.
ROUGH = ("monotone",)


def driver(e: Element) -> Driver | None:
    """A driver of a coordinate, a distance, an angle or the place of a marker."""
    value = _value(e)
    if "marker" not in e.values:
        for key in ("axis", "on"):
            e.refuse(key, "belongs to a driver of a marker")
    if "coordinate" in e.values:
        found = e.coordinate("coordinate")
        if found is None:
            return None
        if found.kind == "parameter":
            message = f"{found.name!r} is an Euler parameter, which cannot move on its own"
            e.faults.add(f"{e.path}.coordinate", message, "drive an angle or markers, or use Euler angles")
            return None
        return CoordinateDriver(e.name, value, e.symbol(found), found.kind)
    if "marker" in e.values:
        return _place(e, value)
    key = "between" if "between" in e.values else "angle"
    pair = e.reader.pair(f"{e.path}.{key}", e.values[key])
    if pair is None or not _on_two_bodies(e, key, *pair):
        return None
    return (DistanceDriver if key == "between" else AngleDriver)(e.name, value, *pair)


def _place(e: Element, value: Expr) -> PlaceDriver | None:
    marker, on = e.marker("marker"), e.marker("on")
    columns = e.reader.axis(f"{e.path}.axis", e.values["axis"]) if "axis" in e.values else TURNS["x"]
    if marker is None or on is None or not _on_two_bodies(e, "on", marker, on):
        return None
    x, y, z = (e.reader.graph.constant(component) for component in columns[2])
    return PlaceDriver(e.name, value, marker, (x, y, z), on)


def _on_two_bodies(e: Element, key: str, a: Marker, b: Marker) -> bool:
    if a.body == b.body:
        e.faults.add(f"{e.path}.{key}", f"{a.label} and {b.label} are on the same body", "choose another body")
    return a.body != b.body


def _value(e: Element) -> Expr:
    """The motion: an expression of t, parameters, inputs and functions that are smooth enough."""
    value, path, names = e.law("value"), f"{e.path}.value", e.reader.names
    for name in sorted(symbols_of([value])):
        kind = names.kinds.get(name)
        if kind not in (None, "time", "parameter", "input"):
            remedy = "a driver moves by t, parameters and inputs; a coupling relates coordinates"
            e.faults.add(path, f"the {kind} {name!r} cannot stand here", remedy)
    graph = e.reader.graph
    called = {graph.nodes[i][0] for i in reachable(graph, [value.id])} & graph.calls.keys()
    tables = {entry.name: entry.values for entry in e.reader.description.sections["functions"] if "x" in entry.values}
    for function, orders in (graph.calls[operation] for operation in sorted(called)):
        kind = tables.get(function.name, {}).get("kind", "cubic")
        if function.name in tables and (kind in ROUGH or any(orders)):
            what = (
                f"of the derivative of table {function.name!r}" if any(orders) else f"of {kind} table {function.name!r}"
            )
            remedy = "take the value of a table of kind cubic, natural or periodic, whose curvature is continuous"
            e.faults.add(path, f"the acceleration {what} jumps at its points", remedy)
    return value
