"""The picture's part of a model's metadata and parameters -> the same with numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import cannot
from .algebra import Array
from .operations import play_arrays

GROUND = -1
_FRAME = ("rotation", "position")


class PlacedFrame(NamedTuple):
    """Placement in a body (an index, or GROUND): rotation (3, 3) takes its axes to body axes, position (m)."""

    body: int
    rotation: Array
    position: Array


class JointData(NamedTuple):
    """A joint and its symbol; ``pieces`` are (shape, sizes, axis, on), ``guide`` gives points of a curve or surface."""

    name: str
    type: str
    P: PlacedFrame
    S: PlacedFrame
    pieces: list[tuple[str, list[float], str, str]]
    slides: bool
    bar: bool
    coordinates: list[str]
    guide: Callable[..., Array] | None
    running: int


class PictureData(NamedTuple):
    """All that a picture of a mechanism needs besides the poses of its bodies."""

    name: str
    bodies: list[str]
    com: Array  #: (n, 3), body axes (m)
    mass: Array  #: (n,)
    inertia: Array  #: (n, 3), diagonal (kg m^2)
    gravity: Array
    shapes: list[dict[str, Any]]  #: body, kind, sizes, frame, file, color
    markers: dict[str, PlacedFrame]
    joints: list[JointData]
    elements: list[dict[str, Any]]
    hidden: frozenset[int]  #: bodies that the model does not name


def read_picture(metadata: Mapping[str, Any], p: Any) -> PictureData:
    """The data of a picture at the parameters p.

    Raises
    ------
    UsageError
        The model has no bodies, or was compiled by an earlier version.
    """
    data = metadata.get("picture")
    if data is None:
        why = (
            "it is given by equations without bodies"
            if "picture" in metadata
            else "it was compiled by an earlier version of eomgen; compile it again"
        )
        raise cannot(f"there is nothing to draw of model {metadata['name']!r}: {why}")
    tape = data["tape"]
    values = [float(x) for x in play_arrays(tape, p, (0.0, 0.0))]

    def plain(x: Any) -> Any:
        if isinstance(x, dict):
            return values[x["at"]] if x.keys() == {"at"} else {key: plain(one) for key, one in x.items()}
        return [plain(one) for one in x] if isinstance(x, list) else x

    def frame(raw: Mapping[str, Any]) -> PlacedFrame:
        return PlacedFrame(raw["body"], np.array(plain(raw["rotation"])), np.array(plain(raw["position"])))

    def along(point: Sequence[Any]) -> Callable[..., Array]:
        """Points (n, 3) at values of what runs."""

        def points(s0: Array, s1: Array | float = 0.0) -> Array:
            result = np.empty((len(s0), 3))
            for axis, x in enumerate(point):
                if isinstance(x, dict) and "samples" in x:
                    at = np.linspace(x["low"], x["high"], len(x["samples"]))
                    result[:, axis] = np.interp(s0, at, x["samples"])
                elif isinstance(x, dict):
                    result[:, axis] = play_arrays(tape, p, (s0, s1))[x["at"]]
                else:
                    result[:, axis] = x
            return result

        return points

    hidden = data["hidden"]
    joints = []
    for one in data["joints"]:
        if one["P"]["body"] in hidden or one["S"]["body"] in hidden:
            one = {**one, "pieces": [], "slides": False}
        guide = one.get("guide")
        joints.append(
            JointData(
                one["name"],
                one["type"],
                frame(one["P"]),
                frame(one["S"]),
                [(shape, sizes, axis, on) for shape, sizes, axis, on in one["pieces"]],
                one["slides"],
                one["bar"],
                one["coordinates"],
                None if guide is None else along(guide["point"]),
                0 if guide is None else guide["running"],
            )
        )
    elements = []
    for one in data["elements"]:
        element = {key: plain(x) for key, x in one.items() if key not in ("marker", "stops", "point")}
        if "marker" in one:
            element["marker"] = frame(one["marker"])
        if "stops" in one:
            element["stops"] = [(frame(stop), plain(stop.get("radius")), stop.get("sense")) for stop in one["stops"]]
        if "point" in one:
            element["points"] = along(one["point"])
        elements.append(element)
    bodies = plain(data["bodies"])
    return PictureData(
        str(metadata["name"]),
        list(metadata["body_names"]),
        np.array([b["com"] for b in bodies]),
        np.array([b["mass"] for b in bodies]),
        np.array([b["inertia"] for b in bodies]),
        np.array(plain(data["gravity"])),
        [{**{k: plain(x) for k, x in s.items() if k not in _FRAME}, "frame": frame(s)} for s in data["shapes"]],
        {one["name"]: frame(one) for one in data["markers"]},
        joints,
        elements,
        frozenset(data["hidden"]),
    )
