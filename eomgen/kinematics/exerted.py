"""Stage kinematics, what force elements exert: the force and moment of one on the body of a marker, and its parts."""

from __future__ import annotations

from ..describe.mechanism import WrenchQuantity
from ..forces.branches import beyond_zero
from ..forces.force import Force, MarkerLoad, View
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt


def part_exerted(view: View, force: Force, quantity: WrenchQuantity) -> Expr | str:
    """The part: forces add up, moments are taken about the origin of the marker; or why there is none."""
    total, moment, acts = vec.zero(view.graph), vec.zero(view.graph), False
    here = view.position(quantity.on)
    for load in force.loads(view):
        if not isinstance(load, MarkerLoad):
            return f"acts along the coordinate {load.coordinate!r}"
        if load.marker.body == quantity.on.body:
            acts = True
            arm = vec.sub(view.position(load.marker), here)
            total = vec.add(total, load.force)
            moment = vec.add(moment, vec.add(load.torque, vec.cross(arm, load.force)))
    if not acts:
        return f"exerts nothing on {quantity.on.label.partition('.')[0]}"
    if quantity.part == "size":
        return beyond_zero(vec.dot(total, total), sqrt)
    found = moment if quantity.part.startswith("m") else total
    if quantity.axes is not None:
        found = vec.transpose_times(view.rotation(quantity.axes), found)
    return found["xyz".index(quantity.part[-1])]
