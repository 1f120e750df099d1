"""Stage show, player: a bar with play, time and speed for pages, and curves with a line that follows the time."""

from __future__ import annotations

import io
import json
from base64 import b64encode
from collections.abc import Sequence
from html import escape

from ..base.texts import html_text
from .optional import matplotlib
from .shown_motion import ShownMotion
from .unit_panels import ShownColumn, by_unit, draw_curves

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
