"""A Scene over time, and a model in WebAssembly where there is one -> one HTML page without a network."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from html import escape
from typing import Any
from zlib import compress

import numpy as np

from ..base.algebra import Array
from ..base.files import shipped
from ..base.picture_data import PlacedFrame, read_picture
from ..base.texts import html_text
from ..errors import EomgenError
from .build_scene import build_scene
from .frames import FrameColumn, MotionFrames
from .limits import SAME
from .scene import Item, Scene, color_of, style_of
from .symbols import Rope, Shifted, Stretched

LAYER = 0.15  #: by which items of a planar mechanism lie before each other: the last digits of their order
RIM, BEHIND = 1.3, 0.98  #: size of the dark edge of a joint in the page, and thickness, of the joint's
MESHES = 24  #: of the grid under a spatial mechanism, along its longer side, at most
MARKERS = 200  #: whose ways a page offers to draw


class InlinePage:
    """A page that a notebook shows in a frame; ``str`` of it is the page."""

    def __init__(self, text: str, height: int = 620) -> None:
        self.text, self.height = text, height

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<InlinePage of {len(self.text) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{self.height}px;border:0"
        text = escape(self.text, quote=True).replace("\n", "&#10;")  # one line of a stored notebook
        return f'<iframe style="{style}" srcdoc="{text}"></iframe>'


@dataclass
class Numbers:
    """All numbers of a page one after the other."""

    parts: list[Array] = field(default_factory=list)
    length: int = 0

    def add(self, values: Any) -> list[int]:
        """Where values are put: the first, and how many."""
        flat = np.asarray(values, dtype="<f4").ravel()
        self.parts.append(flat)
        self.length += len(flat)
        return [self.length - len(flat), len(flat)]

    def text(self) -> str:
        return packed(np.concatenate([*self.parts, np.empty(0, "<f4")]).tobytes())


def packed(content: bytes) -> str:
    """Bytes as a page holds them."""
    return b64encode(compress(content, 9)).decode()


def _stops(item: Item) -> list[tuple[PlacedFrame, float, int]]:
    """The frames between which an item reaches."""
    match item.follow:
        case Stretched(start, end):
            return [(start, 0.0, 1), (end, 0.0, 1)]
        case Shifted(frame):
            return [(frame, 0.0, 1)]
        case Rope(stops):
            return [(frame, float(radius or 0.0), int(sense or 1)) for frame, radius, sense in stops]
    return []


def _shapes(scene: Scene, module: Any) -> list[Array]:
    """The points of all items, then those of the names, then the markers: what changes with parameters."""
    result = []
    for item in _drawn(scene):
        shape = item.points if item.follow is None else getattr(item.follow, "shape", np.empty((0, 3)))
        result.append(np.vstack([*(frame.position[None] for frame, _, _ in _stops(item)), shape]))
    markers = [frame.position for _, frame in _markers(module)]
    return [*result, np.array([label.point for label in scene.labels]).reshape(-1, 3), *markers]


def _markers(module: Any) -> list[tuple[str, PlacedFrame]]:
    data = read_picture(module.metadata, module.p)
    return list(data.markers.items())[:MARKERS]


def _drawn(scene: Scene) -> list[Item]:
    """The items; in a plane the symbols of joints stand on a dark edge, as they are white as the paper."""
    if scene.view is None:
        return scene.items
    result = []
    for item in scene.items:
        if item.role == "joint" and item.faces is not None and item.follow is None:
            normal = scene.frames[0, item.body, :3, :3].T @ scene.view[2]
            middle = item.points.mean(axis=0)
            depth = np.outer((item.points - middle) @ normal, normal)
            points = middle + RIM * (item.points - middle - depth) + BEHIND * depth
            result.append(item._replace(points=points, color=color_of(item)))
        result.append(item)
    return result


def _floor(scene: Scene) -> Array:
    """Lines of a grid under a spatial mechanism."""
    k = int(np.abs(scene.up).argmax())
    sides = [axis for axis in range(3) if axis != k]
    reach = float((scene.high - scene.low)[sides].max())
    step = 10.0 ** np.floor(np.log10(reach / 2.0)) / 2.0
    low, high = np.floor(scene.low / step), np.ceil(scene.high / step)
    apart, lines = int(np.ceil((high - low)[sides].max() / MESHES)), []
    for along, lateral in (sides, sides[::-1]):
        for at in np.arange(low[lateral], high[lateral] + 1.0, apart):
            line = np.full((3, 3), np.nan)
            line[:2, k] = (scene.low if scene.up[k] > 0.0 else scene.high)[k]
            line[:2, lateral], line[:2, along] = at * step, (low[along] * step, high[along] * step)
            lines.append(line)
    return np.concatenate(lines)


def _item(scene: Scene, item: Item, shape: int, numbers: Numbers) -> dict[str, Any]:
    style, bodies = style_of(item.role), scene.frames.shape[1]
    color = item.color or (style.face if item.faces is not None else None) or color_of(item)
    result: dict[str, Any] = {
        "role": item.role, "name": item.name, "body": item.body, "shape": shape, "width": style.width,
        "color": {"white": "#ffffff"}.get(color, color), "layer": item.layer + LAYER * (item.body + 1) / bodies,
        "alpha": style.alpha if item.faces is not None and item.role in ("wheel", "shape") else 1.0,
    }  # fmt: skip
    if item.faces is not None:
        result["faces"] = numbers.add(item.faces)
    if item.path is not None:
        result |= {"frames": numbers.add(item.path)[0], "size": item.path[0].size}
    elif item.follow is not None:
        stops = [
            {"body": frame.body, "radius": radius, "sense": sense, "rotation": frame.rotation.tolist()}
            for frame, radius, sense in _stops(item)
        ]
        result |= {
            "follow": type(item.follow).__name__,
            "stops": stops,
            "flat": getattr(item.follow, "view", None) is not None,
        }
    return result


def _morphs(module: Any, scene: Scene, shapes: list[Array], ranges: Mapping[str, Any], numbers: Numbers) -> list[Any]:
    """How the shapes change from a parameter's value to the ends of its range, for those that they depend on."""
    code = module.metadata["picture"]["tape"][0]
    result = []
    for place in sorted({a for kind, a, _, _ in code if kind == "p"}):
        name, ends = module.p_names[place], []
        for end in ranges[name]:
            try:
                other = module.bind(p={name: end})
                ends.append(_shapes(build_scene(other, scene_position(module), like=scene, quiet=True), other))
            except (EomgenError, np.linalg.LinAlgError):
                ends.append(shapes)  # nothing to be seen there
        moved = []
        for k, here in enumerate(shapes):
            ways = [
                end[k] - here if len(end) == len(shapes) and end[k].shape == here.shape else 0.0 * here for end in ends
            ]
            if any(np.nanmax(np.abs(way), initial=0.0) > SAME * scene.symbol for way in ways):
                moved.append([k, *(numbers.add(np.nan_to_num(way)) for way in ways)])
        if moved:
            low, high = ranges[name]
            result.append({"name": name, "at": float(module.p[place]), "low": low, "high": high, "moved": moved})
    return result


def scene_position(module: Any) -> Array:
    """The start, as one frame."""
    start: Array = np.asarray(module.x0())[: module.n_q, None]
    return start


def page_html(
    module: Any,
    scene: Scene,
    motion: MotionFrames | None = None,
    curves: Sequence[FrameColumn] = (),
    model: Mapping[str, Any] | None = None,
    wasm: bytes = b"",
    equations: str = "",
) -> str:
    """One HTML page that holds all it needs; it asks nothing of a network.

    Parameters
    ----------
    module : Module
    scene : Scene
    motion : MotionFrames, optional
        A run that is shown; needed without a model.
    curves : sequence of FrameColumn
        Of the run, where there is no model.
    model, wasm : mapping, bytes, optional
        What the script knows of the model, and its WebAssembly.
    equations : str
        HTML of the equations of motion.
    """
    numbers, items = Numbers(), _drawn(scene)
    shapes, markers = _shapes(scene, module), _markers(module)
    data: dict[str, Any] = {
        "bodies": list(module.body_names), "units": dict(module.info.units), "up": scene.up.tolist(),
        "view": None if scene.view is None else scene.view.tolist(),
        "low": scene.low.tolist(), "high": scene.high.tolist(),
        "shapes": [numbers.add(shape) for shape in shapes],
        "items": [_item(scene, item, k, numbers) for k, item in enumerate(items)],
        "labels": [{"text": label.text, "body": label.body} for label in scene.labels], "labelShape": len(items),
        "markers": [[name, frame.body, len(items) + 1 + k] for k, (name, frame) in enumerate(markers)],
        "morphs": [] if model is None else _morphs(module, scene, shapes, model["ranges"], numbers),
        "floor": numbers.add(_floor(scene) if scene.view is None else []),
        "curves": [
            {"name": one.plain, "over": one.over.tolist(), "values": one.values.tolist()} for one in curves
        ],
        "motion": None, "model": model, "wasm": packed(wasm) if wasm else "",
    }  # fmt: skip
    if motion is not None:
        data["motion"] = {
            "t": motion.t.tolist(), "clock": motion.clock.tolist(), "over": motion.over.tolist(),
            "words": motion.captions,
            "pace": motion.speed, "states": numbers.add(motion.x.T)[0] if model else 0,
            "poses": 0 if model else numbers.add(scene.frames[:, :-1, :3, :])[0],
        }  # fmt: skip
    data["numbers"] = numbers.text()
    picture, script, style, page = (
        (shipped("templates") / "web" / name).read_text("utf-8")
        for name in ("picture.js", "page.js", "page.css", "page.html")
    )
    texts = {"script": picture + script, "style": style}
    hashes = {f"{k}_hash": f"sha256-{b64encode(sha256(v.encode()).digest()).decode()}" for k, v in texts.items()}
    captions = {
        "title": html_text(scene.name), "doc": html_text(module.doc or ""), "note": html_text(scene.note),
        "equations": equations and "<details id='equations'><summary>Equations of motion</summary>"
        + re.sub(r" style=(\"[^\"]*\"|'[^']*')", "", equations)
        + "</details>",
        "data": re.sub("[<>&]", lambda result: f"\\u{ord(result[0]):04x}", json.dumps(data, allow_nan=False)),
    }  # fmt: skip
    fill = {**texts, **hashes, **captions}
    return re.sub(r"{{ (\w+) }}", lambda result: fill[result[1]], page)
