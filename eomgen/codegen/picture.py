"""Pictures: Mechanism -> what a picture of it needs, as plain data for model.json.

Numbers that depend on parameters stand as ``{"at": k}``, the k-th result of a tape over the parameters; so a compiled
module is drawn with the values it is bound to, without the description it was made from.  ``eomgen.show`` reads it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..elements.forces.force import Force
from ..elements.frames import Frame, Marker, WrapCylinder
from ..elements.glyphs import (
    ARROW,
    ROUND_ARROW,
    Contour,
    Drawn,
    Glyph,
    LiftCurve,
    PitchCircles,
    Pull,
    RackAndPinion,
    Wheel,
)
from ..errors import UsageError
from ..expr.core import Expr, substitute, symbols_of
from ..expr.evaluate import evaluate
from ..expr.functions import Curve
from ..expr.schedule import record_tape
from ..model.mechanism import JointSpec, Mechanism

#: Symbols that stand for the parameters of a curve or a surface.
RUNNING = ("$0", "$1")
SAMPLES = 361  #: points of a curve that calls a table


class _Numbers:
    """Expressions -> numbers, or places on a tape."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.graph = mechanism.graph
        self.places = {p.name: ("p", k) for k, p in enumerate(mechanism.parameters)}
        self.places |= {name: ("x", k) for k, name in enumerate(RUNNING)}
        self.declared = {p.name: p.value for p in mechanism.parameters if p.value is not None}
        coordinates = [spec.joint.coordinates for spec in mechanism.joints]
        #: joints whose first coordinate is a length
        self.sliding = {k for k, result in enumerate(coordinates) if result and result[0].kind == "length"}
        self.kept: list[Expr] = []

    def number(self, x: Expr) -> Any:
        """One number, or its place on the tape."""
        if x.value is not None:
            return x.value
        try:
            record_tape([x], self.places.__getitem__)
        except UsageError:  # it calls a function of the model, which a tape does not know
            return float(evaluate([x], self.declared)[0])
        self.kept.append(x)
        return {"at": len(self.kept) - 1}

    def numbers(self, several: Sequence[Expr]) -> list[Any]:
        """A list of them."""
        return [self.number(x) for x in several]

    def known(self, several: Sequence[Expr]) -> bool:
        """Whether they depend on nothing but parameters."""
        return symbols_of(several) <= self.places.keys()

    def curve(self, point: Sequence[Expr], low: float | None = None, high: float | None = None) -> list[Any] | None:
        """Numbers of a point that runs along a curve; None where it depends on more than parameters.

        Where it calls a table, which a tape does not know, ``{"samples": ...}``: its coordinates over even values of
        what runs, from low to high, with the declared parameters.
        """
        if not self.known(point):
            return None
        try:
            record_tape(list(point), self.places.__getitem__)
        except UsageError:
            return self._sampled(point, low, high)
        return self.numbers(point)

    def _sampled(self, point: Sequence[Expr], low: float | None, high: float | None) -> list[Any] | None:
        if RUNNING[1] in symbols_of(point):
            return None  # a surface
        if low is None or high is None:
            tables = [f.evaluator for f, _ in self.graph.calls.values() if isinstance(f.evaluator, Curve)]
            spans = [(table.knots[0], table.knots[-1]) for table in tables]
            if not spans:
                return None
            low, high = max(a for a, _ in spans), min(b for _, b in spans)
        s = np.linspace(low, high, SAMPLES)
        try:
            rows = evaluate(point, self.declared | {RUNNING[0]: s})
        except UsageError:  # C code without a Python fallback
            return None
        values = [np.broadcast_to(np.asarray(row, dtype=float), s.shape) for row in rows]
        if not np.isfinite(values).all():
            return None
        return [{"samples": row.tolist(), "low": float(low), "high": float(high)} for row in values]

    def frame(self, frame: Frame) -> dict[str, Any]:
        """A placement: rotation (3, 3) by rows, and position."""
        return {"rotation": [self.numbers(row) for row in frame.rotation], "position": self.numbers(frame.position)}

    def marker(self, marker: Marker) -> dict[str, Any]:
        """A marker; its body is an index, -1 for ground."""
        return {"body": marker.body, **self.frame(marker.frame)}


def describe_picture(mechanism: Mechanism) -> dict[str, Any] | None:
    """What a picture of the mechanism needs; None without bodies."""
    if mechanism.bare or not mechanism.bodies:
        return None
    n = _Numbers(mechanism)
    joints = [_joint(n, spec) for spec in mechanism.joints]
    owners = {name: k for k, spec in enumerate(mechanism.joints) for name in spec.coordinates}
    things = [(f.name, f.glyphs(), _push(n, f)) for f in mechanism.forces]
    switched = [s.constraint for s in mechanism.switched if s.constraint is not None]
    things += [(c.name, c.glyphs(), {}) for c in (*mechanism.constraints, *switched)]
    elements = [
        {"name": name, **result, **(push if len(result.get("stops", ())) > 1 else {})}
        for name, every, push in things
        for seen in every
        if (result := _element(n, seen, owners)) is not None
    ]
    data = {
        "gravity": n.numbers(mechanism.gravity) if n.known(mechanism.gravity) else [0.0, 0.0, 0.0],
        "bodies": [
            {
                "com": n.numbers(b.com),
                "mass": n.number(b.mass),
                "inertia": n.numbers([row[k] for k, row in enumerate(b.inertia)]),
            }
            for b in mechanism.bodies
        ],
        "shapes": [
            {"body": s.body, "kind": s.kind, "sizes": n.numbers(s.sizes), "file": s.file, "color": s.color}
            | n.frame(s.frame)
            for s in mechanism.presentation.body_shapes
        ],
        "markers": [{"name": marker.label, **n.marker(marker)} for marker in mechanism.presentation.named_markers],
        "joints": joints,
        "elements": elements,
        "hidden": list(mechanism.presentation.added_bodies),
    }
    return {**data, "tape": list(record_tape(n.kept, n.places.__getitem__))}


def _joint(n: _Numbers, spec: JointSpec) -> dict[str, Any]:
    look = spec.joint.look
    result: dict[str, Any] = {
        "name": spec.name,
        "type": spec.joint.type_name,
        "P": n.marker(spec.predecessor),
        "S": n.marker(spec.successor),
        "pieces": [[piece.shape, list(piece.size), piece.axis, piece.on] for piece in look.pieces],
        "slides": look.slides,
        "bar": look.bar,
        "coordinates": list(spec.coordinates),
    }
    shape = getattr(spec.joint, "shape", None)
    if shape is not None:
        running = {s: n.graph.symbol(name) for s, name in zip(shape.parameters, RUNNING, strict=False)}
        point = substitute(list(shape.point), running)
        curve = n.curve(point)
        if curve is not None:
            result["guide"] = {"point": curve, "running": len(shape.parameters)}
    return result


def _push(n: _Numbers, force: Force) -> dict[str, Any]:
    """The force along a way over its length and rate, where it depends on these and parameters alone."""
    law = force.push(*(n.graph.symbol(name) for name in RUNNING))
    result = None if law is None else n.curve([law])
    return {} if result is None else {"point": [*result, 0.0, 0.0]}


def _element(n: _Numbers, seen: Glyph, owners: Mapping[str, int]) -> dict[str, Any] | None:
    """One thing to be seen; None where it depends on more than parameters."""
    if isinstance(seen, Drawn):
        stops = [_stop(n, stop) for stop in seen.stops]
        lines: dict[str, Any] = {"along": seen.along, "about": seen.about}
        if seen.walls:
            lines |= {"walls": n.numbers([x for x in seen.walls if n.known([x])])}
        return {"kind": "lines", "stops": stops, "joint": owners.get(seen.coordinate), **lines}
    if isinstance(seen, Pull):
        # a component that is not known before the run counts as positive
        way = [n.number(x) if n.known([x]) else 1.0 for x in seen.value]
        looks = {"turns": seen.turns, "lines": ROUND_ARROW if seen.turns else ARROW}
        return {"kind": "pull", "marker": n.marker(seen.marker), "way": way, "own": seen.own, **looks}
    if isinstance(seen, Wheel):
        return {"kind": "wheel", "marker": n.marker(seen.marker), "radius": n.number(seen.radius)}
    if isinstance(seen, PitchCircles):
        a, b, beside = (_owner(x, owners) for x in (seen.a, seen.b, seen.beside))
        if (a is None and beside is None) or b is None or not n.known([seen.ratio]):
            return None
        joints = {"a": a, "b": b, "beside": beside}
        radius = n.number(seen.radius) if seen.radius is not None and n.known([seen.radius]) else 0.0
        return {"kind": "circles", **joints, "ratio": n.number(seen.ratio), "belt": seen.belt, "radius": radius}
    if isinstance(seen, RackAndPinion):
        pinion, rack = _owner(seen.pinion, owners), _owner(seen.rack, owners)
        if pinion is None or rack is None or not n.known([seen.radius]):
            return None
        return {"kind": "rack", "a": pinion, "b": rack, "radius": n.number(seen.radius)}
    if isinstance(seen, LiftCurve):
        cam, follower = _owner(seen.cam, owners), _owner(seen.follower, owners)
        if cam is None or follower is None or not n.known([seen.phase]):
            return None
        span = (None, None) if cam in n.sliding else (0.0, 2.0 * math.pi)
        lift = n.curve(substitute([seen.lift], {seen.parameter: n.graph.symbol(RUNNING[0])}), *span)
        if lift is None:
            return None
        return {"kind": "lift", "a": cam, "b": follower, "phase": n.number(seen.phase), "point": [*lift, 0.0, 0.0]}
    assert isinstance(seen, Contour)
    point = substitute(list(seen.point), {seen.parameter: n.graph.symbol(RUNNING[0])})
    curve = n.curve(point, seen.low, seen.high)
    if curve is None:
        return None
    ends = {"low": seen.low, "high": seen.high}
    following = {} if seen.follower is None else {"stops": [_stop(n, seen.follower)], "face": seen.face}
    return {"kind": "contour", "marker": n.marker(seen.marker), "point": curve, **ends, **following}


def _owner(x: Expr | None, owners: Mapping[str, int]) -> int | None:
    """The joint whose coordinate an expression is."""
    return owners.get(str(x.node[1])) if x is not None and x.node[0] == "sym" else None


def _stop(n: _Numbers, stop: Marker | WrapCylinder) -> dict[str, Any]:
    if isinstance(stop, WrapCylinder):
        return {**n.marker(stop.marker), "radius": n.number(stop.radius), "sense": stop.sense}
    return n.marker(stop)
