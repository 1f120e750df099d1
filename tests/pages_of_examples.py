"""Makes, opens and looks at the pages of the examples: ``python tests/pages_of_examples.py FOLDER [NAME ...]``.

A line for each: seconds to make it, its size, work in a frame of its run, the largest residual of its loops after ten
drags by the mouse, what the console says and what it asks of the network.  FOLDER gets the pages and their pictures,
wide and narrow, light and dark.
"""

import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

from browser import Browser

import eomgen as eg
from eomgen.base.files import example_files, find_example

LOOKS = {"wide": (1200, 760), "narrow": (400, 760)}
#: Milliseconds of work in a frame, of WebAssembly and of the script, in 30 frames of the run: median, largest.
WORK = """(async () => {
  const work = [];
  for (let k = 0; k < 30; k += 1) {
    await new Promise(requestAnimationFrame);
    const begun = performance.now();
    page.proceed(get('speed').value / 60);
    page.show();
    work.push(performance.now() - begun);
  }
  work.sort((a, b) => a - b);
  return [work[15], work[29]].map((x) => x.toFixed(1)).join('/');
})()"""
#: Places in the picture where a body can be taken.
GRIPS = """(() => { const { clientWidth: w, clientHeight: h } = get('over'), found = [];
for (let i = 0; i < 16; i += 1) for (let j = 0; j < 12; j += 1) {
  const at = [(i + 0.5) * w / 16, (j + 0.5) * h / 12];
  if (page.picture.pick(...at)) found.push(at);
} return found; })()"""
RESIDUAL = """(() => { const f = page.frames[page.cursor];
return f.x.every(Number.isFinite) ? page.model.residual(f.t, f.x) : Infinity; })()"""


def drag(opened: Browser, count: int = 10) -> float:
    """The largest residual after drags of bodies by the mouse."""
    worst, top = 0.0, opened.place("#over")
    for k in range(count):
        grips = opened.evaluate(GRIPS)
        if not grips:
            return worst
        x, y = grips[(37 * k) % len(grips)]
        at = {"x": top["x"] + x, "y": top["y"] + y, "button": "left", "buttons": 1, "clickCount": 1}
        opened.call("Input.dispatchMouseEvent", type="mousePressed", **at)
        for step in (1, 2, 3):
            moved = {**at, "x": at["x"] + 8 * step * (-1) ** k, "y": at["y"] + 6 * step}
            opened.call("Input.dispatchMouseEvent", type="mouseMoved", **moved)
        opened.call("Input.dispatchMouseEvent", type="mouseReleased", **at)
        worst = max(worst, float(opened.evaluate(RESIDUAL) or 0.0))
    return worst


def look(name: str, folder: Path) -> str:
    """The line of an example."""
    file, begun = find_example(name, example_files()), perf_counter()
    assert file is not None
    try:
        target = "cython" if file.parent.name == "large" else "numpy"
        page = eg.load(file).compile(target=target).page(folder / f"{name}.html")
    except eg.EomgenError as error:
        return f"refused: {str(error).splitlines()[0]}"
    made, seen = f"{perf_counter() - begun:6.1f} s {page.stat().st_size / 1000:6.0f} kB", list[Any]()
    for kind, size in LOOKS.items():
        with tempfile.TemporaryDirectory() as profile, Browser(Path(profile), size=size) as opened:
            opened.open(page.as_uri())
            opened.wait_for("window.page !== undefined && page.count > 5")
            opened.picture(folder / f"{name}_{kind}_light.png")
            opened.evaluate("get('theme').click()")
            opened.wait_for("new Promise(requestAnimationFrame).then(() => true)")
            opened.picture(folder / f"{name}_{kind}_dark.png")
            if kind == "wide":
                made += f" {opened.evaluate(WORK):>11} ms"
                opened.evaluate("page.play(false)")
                made += f" {drag(opened):8.1e}"
            seen += opened.complaints + opened.requests
    return f"{made} {seen or 'clean'}"


if __name__ == "__main__":
    where = Path(sys.argv[1])
    where.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or sorted({Path(file).stem for file in example_files() if not file.endswith(".py")}):
        print(f"{name:<22}{look(name, where)}", flush=True)
