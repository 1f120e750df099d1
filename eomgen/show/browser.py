"""A Scene over time -> a k3d plot with a bar of play and time, or a page without a network."""

from __future__ import annotations

import io
import json
import re
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.texts import html_text
from .axes import offsets_within
from .draw import k3d, matplotlib
from .frames import ShownColumn, ShownMotion, by_unit, draw_curves
from .scene import Item, Scene, color_of, page_axes, style_of
from .solids import Triangles

# -- the bar of a page -------------------------------------------------------------------------------------------------


WIDE = 0.55  #: height over width of the window for which the camera is set
BAR = 40  #: height of the bar (dots)
PLOT = 190  #: of the curves of one unit above it
LOWER = 90  #: and of each further unit
#: What a page says where a browser cannot draw it.
NO_WEBGL = (
    "This animation needs WebGL 2, which this browser does not offer here. Switch on hardware acceleration, open the "
    "page in another browser, or write the animation as .gif."
)
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


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
        return f'<iframe style="{style}" srcdoc="{escape(self.text, quote=True)}"></iframe>'


class InlineFilm:
    """A GIF or a film that a notebook shows.

    Attributes
    ----------
    data : bytes
        The file, as it would be written.
    format : {'gif', 'mp4'}
    """

    def __init__(self, data: bytes, format: str) -> None:
        self.data, self.format = data, format

    def __bytes__(self) -> bytes:
        return self.data

    def __repr__(self) -> str:
        return f"<InlineFilm: {self.format} of {len(self.data) / 1e6:.2f} MB>"

    def _repr_html_(self) -> str:
        text = b64encode(self.data).decode()
        if self.format == "gif":
            return f'<img alt="animation" src="data:image/gif;base64,{text}">'
        return f'<video controls loop autoplay muted src="data:video/{self.format};base64,{text}"></video>'


def plots_height(curves: Sequence[ShownColumn]) -> int:
    """Height of the curves of all units (dots)."""
    return PLOT + LOWER * (len(by_unit(curves)) - 1) if curves else 0


def curves_html(motion: ShownMotion, curves: Sequence[ShownColumn]) -> str:
    """The curves as one picture, with a line over it; the ends of its axes stand in its data."""
    panels = by_unit(curves)
    size = (9.0, plots_height(curves) / 100)
    figure = matplotlib("figure", "curves beside an animation").Figure(size, dpi=200, layout="constrained")
    axes = figure.subplots(len(panels), squeeze=False)[:, 0]
    draw_curves(axes, panels, motion)
    for ax in axes:
        ax.set_xlim(float(motion.over.min()), float(motion.over.max()))
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    box, top = axes[-1].get_position(), axes[0].get_position().y1
    data = b64encode(buffer.getvalue()).decode()
    return (
        f'<div id="curves" data-left="{box.x0:.5f}" data-right="{box.x1:.5f}" data-low="{float(motion.over.min())!r}" '
        f'data-high="{float(motion.over.max())!r}"><img alt="curves" src="data:image/png;base64,{data}">'
        f'<div id="cursor" style="top: {1.0 - top:.3%}; bottom: {box.y0:.3%}"></div></div>'
    )


def player_html(motion: ShownMotion, curves: Sequence[ShownColumn], title: str) -> str:
    """Style and elements, to stand at the beginning of a page's body."""
    plot = curves_html(motion, curves) if curves else ""
    high = plots_height(curves)
    below = BAR + high
    # the values are seconds of the animation in one of the clock; what is read: seconds of the mechanism in one of it
    speeds = "".join(
        f'<option value="{s}"{" selected" if s == 1.0 else ""}>x{s * motion.speed:.2g}</option>' for s in SPEEDS
    )
    clock = motion.clock
    return f"""<style>
#canvasTarget {{ height: calc(100% - {below}px) !important; top: 0; }}
#player {{ position: fixed; left: 0; right: 0; bottom: 0; height: {BAR}px; display: flex; gap: 10px; padding: 0 14px;
  align-items: center; background: #fff; font: 14px sans-serif; box-sizing: border-box; border-top: 1px solid #ddd; }}
#player button {{ width: 34px; height: 28px; }} #player input {{ flex: 1; }} #words {{ min-width: 9em; }}
#curves {{ position: fixed; bottom: {BAR}px; height: {high}px; left: 50%; transform: translateX(-50%); }}
#curves {{ box-shadow: 0 0 0 100vmax #fff; clip-path: inset(0 -100vmax); }}
#curves img {{ height: 100%; }}
#missing {{ position: fixed; top: 40%; left: 10%; right: 10%; font: 16px sans-serif; text-align: center; z-index: 6; }}
#cursor {{ position: absolute; width: 1px; background: #333; }}
#title {{ position: fixed; left: 14px; top: 10px; font: 15px sans-serif; white-space: pre; z-index: 5;
  pointer-events: none; }}
</style>
<div id="title">{html_text(title)}</div>{plot}
<script>(function () {{
  if (document.createElement("canvas").getContext("webgl2")) return;
  const words = document.createElement("div");
  words.id = "missing";
  words.textContent = "{NO_WEBGL}";
  document.body.appendChild(words);
}})();</script>
<div id="player"><button id="play" title="play or pause">&#10074;&#10074;</button>
<input id="time" type="range" min="0" max="{float(clock[-1])!r}" step="any" value="0" aria-label="time">
<span id="words"></span><select id="speed" title="speed; x1 is that of the mechanism">{speeds}</select></div>
"""


def player_script(motion: ShownMotion, extent: tuple[float, float] = (1.0, 1.0)) -> str:
    """What moves a page; ``K3DInstance`` is k3d's.

    Parameters
    ----------
    motion : ShownMotion
    extent : (float, float)
        Width and height of what is shown: in a window that is too narrow for it the camera stands further away.
    """
    data = {"clock": motion.clock.tolist(), "over": motion.over.tolist(), "words": motion.words, "extent": extent}
    return _SCRIPT.replace("WIDE", f"{WIDE:g}").replace("DATA", json.dumps(data).replace("<", "\\u003c"))


_SCRIPT = """(function (k3d) {
  const data = DATA, end = data.clock[data.clock.length - 1];
  const get = (id) => document.getElementById(id);
  const slider = get("time"), button = get("play"), words = get("words"), speed = get("speed");
  const curves = get("curves"), cursor = get("cursor");
  let now = 0, playing = true, last = null, frames = 0;
  function show(t) {
    now = t;
    slider.value = t;
    let k = 0;
    while (k + 1 < data.clock.length && data.clock[k + 1] <= t) k += 1;
    words.textContent = data.words[k];
    if (curves) {
      const part = (data.over[k] - curves.dataset.low) / (curves.dataset.high - curves.dataset.low || 1);
      cursor.style.left = 100 * (+curves.dataset.left + part * (curves.dataset.right - curves.dataset.left)) + "%";
    }
    k3d.setTime(t);
  }
  function play(on) {
    playing = on;
    last = null;
    button.textContent = on ? "\\u275a\\u275a" : "\\u25b6";
  }
  function step(stamp) {
    if (frames < 3) k3d.setCamera(camera);  // k3d sets its own once more when all is loaded
    frames += 1;
    if (playing) {
      if (last !== null) {
        const t = now + (stamp - last) / 1000 * speed.value;
        show(t > end ? 0 : t);
      }
      last = stamp;
    }
    requestAnimationFrame(step);
  }
  button.onclick = () => play(!playing);
  slider.oninput = () => { play(false); show(+slider.value); };
  window.onresize = () => k3d.resizeHelper && k3d.resizeHelper();
  show(0);
  const camera = k3d.parameters.camera.slice(), target = get("canvasTarget");
  const aspect = target.clientWidth / target.clientHeight || 1, [wide, high] = data.extent;
  const away = Math.max(1, Math.max(high, wide / aspect) / Math.max(high, WIDE * wide));
  for (let k = 0; k < 3; k += 1) camera[k] = camera[k + 3] + away * (camera[k] - camera[k + 3]);
  k3d.setCamera(camera);  // or k3d believes that all names are out of sight
  requestAnimationFrame(step);
})(K3DInstance);"""


# -- plots and pages ---------------------------------------------------------------------------------------------------


NAMES = "#222222"  #: colour of names
GROUND = "background: rgba(255, 255, 255, 0.75); padding: 0 2px"  #: what they stand on, so that bars cut nothing off
PAGE = 500.0  #: width of a planar mechanism in a window (points of type)
LAYER = 0.15  #: by which roles of a planar mechanism stand before each other (sizes of a symbol)
WIDE_ANGLE, NARROW_ANGLE = 35.0, 10.0  #: of the camera (degrees), in space and before a page, where no side shows
FARTHER = float(np.tan(np.radians(WIDE_ANGLE / 2)) / np.tan(np.radians(NARROW_ANGLE / 2)))  #: it stands before a page
RIM, BEHIND = 1.3, 0.98  #: size of the dark edge of a joint in the page, and thickness, of the joint's
BLUNT = 0.7  #: cosine of the greatest angle between neighbouring faces of what looks round


def _number(color: str) -> int:
    """``#RRGGBB`` as a number."""
    named = {"white": "#FFFFFF"}
    return int(named.get(color, color).lstrip("#"), 16)


def scene_plot(scene: Scene, motion: ShownMotion | None = None, height: int = 600) -> Any:
    """A k3d plot of a scene; with a motion it moves, and displays itself in a notebook."""
    viewer = k3d("a picture in a browser")
    low, high = scene.low, scene.high
    if scene.view is None:  # a grid of round numbers
        step = 10.0 ** np.floor(np.log10(float((high - low).max()) / 3.0))
        low, high = step * np.floor(low / step), step * np.ceil(high / step)
    span = high - low
    plot = viewer.plot(
        height=height,
        name=html_text(scene.name),
        camera_auto_fit=False,
        camera_mode="trackball" if scene.view is None else "orbit",
        grid_visible=scene.view is None,
        grid_auto_fit=False,
        grid=[*low.tolist(), *high.tolist()],
        menu_visibility=True,
        axes_helper=0.8,
        camera_fov=WIDE_ANGLE if scene.view is None else NARROW_ANGLE,
        axes=["x", "y", "z"],
    )
    times = [0.0] if motion is None else motion.clock.tolist()
    for one in _objects(viewer, scene, times):
        plot += one
    middle = 0.5 * (low + high)
    if scene.view is not None:
        middle, toward, up = middle @ scene.view, scene.view[2], scene.view[1]
        reach = float(max(span[1], WIDE * span[0])) * FARTHER * 1.75
    else:
        up = scene.up
        depth = np.cross(np.eye(3)[page_axes(up)[1]], up)
        depth = depth / np.linalg.norm(depth)
        toward = 0.75 * depth + 0.45 * np.cross(up, depth) + 0.4 * up
        toward = toward / np.linalg.norm(toward)
        reach = float(np.linalg.norm(span)) * 1.7
    plot.camera = [*(middle + reach * toward), *middle, *up]
    if motion is not None:
        plot.fps = motion.fps
    return plot


def _objects(viewer: Any, scene: Scene, times: list[float]) -> list[Any]:
    """What k3d shows of a scene: items, then names."""
    found = []
    for item in scene.items:
        found.append(
            _solid(viewer, scene, item, times) if item.faces is not None else _line(viewer, scene, item, times)
        )
        if scene.view is not None and item.role == "joint" and item.faces is not None and item.follow is None:
            found.append(_rim(viewer, scene, item, times))
    for label, offset in zip(scene.labels, _offsets(scene), strict=True):
        found.append(
            viewer.text(
                f'<span style="{GROUND}">{html_text(label.text)}</span>',
                is_html=True,  # else underscores would be read as TeX
                position=_over_time(times, [label.at(scene.frames[k]) + offset for k in range(len(times))]),
                reference_point="cc",
                color=_number(NAMES),  # the body's colour would be lost on the body
                size=0.7,
                label_box=False,
                name=f"name {label.text}",
            )
        )
    return found


def _offsets(scene: Scene) -> list[Array]:
    """From what is named to the middles of the names (m, ground axes): beside it, where the least is covered."""
    if scene.view is None:
        return [3.0 * scene.symbol * scene.up for _ in scene.labels]
    across = scene.view[:2]
    low, high = scene.low[:2], scene.high[:2]
    scale = PAGE / max(high[0] - low[0], (high[1] - low[1]) / WIDE)
    offsets = offsets_within(scene, lambda points: scale * points @ across.T, scale * low, scale * high)
    return [offset @ across / scale for offset in offsets]


def move_objects(plot: Any, scene: Scene) -> None:
    """Show another position of a scene on a plot that shows one; what has changed is sent, and no more."""
    made = _objects(k3d("a picture in a browser"), scene, [0.0])
    if [one.name for one in made] != [one.name for one in plot.objects]:
        for one in plot.objects:
            plot -= one
        for one in made:
            plot += one
        return
    for old, new in zip(plot.objects, made, strict=True):
        for trait in ("vertices", "indices", "model_matrix", "position"):
            value = getattr(new, trait, None)
            if value is not None and not np.array_equal(getattr(old, trait), value, equal_nan=True):
                setattr(old, trait, value)


def _over_time(times: list[float], values: list[Array]) -> Any:
    """Values by time where they change, else the first."""
    first = np.asarray(values[0], dtype=np.float32)
    if all(np.array_equal(np.asarray(value, dtype=np.float32), first, equal_nan=True) for value in values[1:]):
        return first
    return {f"{t:.6f}": np.asarray(value, dtype=np.float32) for t, value in zip(times, values, strict=True)}


def _layer(scene: Scene, item: Item) -> Array:
    """By how much an item is drawn nearer to the reader of a page (m, ground axes).

    Parts of a planar mechanism lie in one plane, and where two surfaces coincide a browser shows either by turns.
    """
    if scene.view is None:
        return np.zeros(3)
    bodies = scene.frames.shape[1]
    place = item.layer + (item.body + 1) % bodies / bodies
    nearer: Array = LAYER * scene.symbol * place * scene.view[2]
    return nearer


def _looks_round(points: Array, faces: Triangles) -> bool:
    """Whether a solid has no edges: no two neighbouring faces meet at a sharp angle."""
    normals = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    lengths = np.linalg.norm(normals, axis=1)
    edges: dict[tuple[int, int], Array] = {}
    for face, normal, length in zip(faces, normals, lengths, strict=True):
        if length > 0.0:
            for k in range(3):
                edges[int(face[k]), int(face[k - 1])] = normal / length
    return all(float(n @ edges[b, a]) > BLUNT for (a, b), n in edges.items() if (b, a) in edges)


def _solid(viewer: Any, scene: Scene, item: Item, times: list[float]) -> Any:
    style, color = style_of(item.role), color_of(item)
    look = {
        "color": _number(style.face or color),
        "opacity": style.alpha if item.role in ("wheel", "shape") else 1.0,
        "side": "double",
        "flat_shading": item.role != "joint" or item.faces is None or not _looks_round(item.points, item.faces),
        "name": f"{item.role} {item.name}",
    }
    faces = item.faces.astype(np.uint32) if item.faces is not None else None
    if item.follow is not None:
        points = [item.follow(scene.frames[k]) + _layer(scene, item) for k in range(len(times))]
        return viewer.mesh(_over_time(times, points), faces, **look)
    return _carried(viewer.mesh(item.points.astype(np.float32), faces, **look), scene, item, times)


def _rim(viewer: Any, scene: Scene, item: Item, times: list[float]) -> Any:
    """A dark edge about the symbol of a joint as a page shows it, which is white as the paper."""
    assert scene.view is not None and item.faces is not None
    normal = scene.frames[0, item.body, :3, :3].T @ scene.view[2]
    middle = item.points.mean(axis=0)
    way = item.points - middle
    depth = np.outer(way @ normal, normal)
    points = middle + RIM * (way - depth) + BEHIND * depth
    look = {"color": _number(color_of(item)), "flat_shading": True, "name": f"rim {item.name}"}
    mesh = viewer.mesh(points.astype(np.float32), item.faces.astype(np.uint32), **look)
    return _carried(mesh, scene, item, times)


def _line(viewer: Any, scene: Scene, item: Item, times: list[float]) -> Any:
    width = (0.12 if item.role in ("trace", "hatch") else 0.2) * scene.symbol
    look = {"color": _number(color_of(item)), "shader": "mesh", "width": width, "name": f"{item.role} {item.name}"}
    there = np.asarray(np.isfinite(item.points).all(axis=1))
    places = np.cumsum(there) - 1
    pairs = [(places[k], places[k + 1]) for k in range(len(item.points) - 1) if there[k] and there[k + 1]]
    look |= {"indices": np.array(pairs, dtype=np.uint32), "indices_type": "segment"}
    if item.follow is not None or item.path is not None:
        points = [item.at(scene.frames[k], k)[there] + _layer(scene, item) for k in range(len(times))]
        return viewer.lines(_over_time(times, points), **look)
    return _carried(viewer.lines(item.points[there].astype(np.float32), **look), scene, item, times)


def _carried(shape: Any, scene: Scene, item: Item, times: list[float]) -> Any:
    """A shape that its body carries along."""
    nearer = np.eye(4)
    nearer[:3, 3] = _layer(scene, item)
    shape.model_matrix = _over_time(times, [nearer @ scene.frames[k, item.body] for k in range(len(times))])
    return shape


def page(scene: Scene, motion: ShownMotion, curves: Sequence[Any] = ()) -> str:
    """One HTML page that holds all it needs; it asks nothing of a network."""
    plot = scene_plot(scene, motion)
    plot.snapshot_type, plot.menu_visibility = "full", False
    wide, high = (scene.high - scene.low)[:2].tolist() if scene.view is not None else (1.0, 1.0)
    text: str = plot.get_snapshot(9, additional_js_code=player_script(motion, (wide, high)))
    title = f"{scene.name}   {scene.note}" if scene.note else scene.name
    text = text.replace("<body>", f"<body>{player_html(motion, curves, title)}", 1)
    return re.sub(r"<title>.*?</title>", lambda _: f"<title>{html_text(scene.name)}</title>", text, count=1)
