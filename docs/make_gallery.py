"""Draws the pictures of docs/gallery.md from the examples:  python docs/make_gallery.py [NAME ...]

The page says all: a picture's name, whether it moves (.gif), and by the options of ``eomgen view`` how long the run is
and which paths are drawn.
"""

from __future__ import annotations

import argparse
import re
import shlex
import sys
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image

import eomgen as eg
from eomgen.base.files import example_files, find_example
from eomgen.runtime.plotting import states_at
from eomgen.show.frames import Frames, moving_scene, sample
from eomgen.show.writers import gif_bytes, indices_in, palette_of

DOCS = Path(__file__).parent
STILL, MOVING, SPATIAL = 70.0, 42.0, 54.0  #: dots in an inch of a picture, of a film in the plane and of one in space
COLORS, FILM_COLORS = 48, 64  #: of a picture that stands still, of a film
LASTS, FPS = 4.0, 10.0  #: seconds of a film, frames in a second
SMOOTH = 6  #: times as many points for a path in a picture that stands still
QUICK = ("furuta_pendulum", "quadrotor_load")  #: films of twice as many frames, for the sake of their paths
AT = 0.3  #: part of the run after which the picture is taken
#: Pictures taken at another part of the run.
MOMENTS = {
    "bicycle": 0.1,
    "cart_pendulum": 0.45,
    "compass_gait": 0.22,
    "double_pendulum": 0.9,
    "n_four_bar": 0.1,
    "pendulum": 0.1,
    "planetary_gear": 0.05,
    "slider_crank": 0.05,
    "spherical_pendulum": 0.9,
}


class Shown(NamedTuple):
    """An entry of the page: the file of the example, the file of its picture, and the options of ``eomgen view``."""

    example: str
    picture: str
    options: argparse.Namespace


def read_options(words: list[str]) -> argparse.Namespace:
    """Options of ``eomgen view`` that the page uses."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--end", type=float)
    parser.add_argument("--trace", action="append", default=[])
    parser.add_argument("--plot", action="append", default=[])
    return parser.parse_args(words)


def entries(text: str) -> list[Shown]:
    """What the page shows, in its order."""
    found = []
    for section in re.split(r"^### ", text, flags=re.MULTILINE)[1:]:
        picture = re.search(r"\]\((pictures/gallery/[\w.]+)\)", section)
        command = re.search(r"^`eomgen view ([^`]+)`$", section, re.MULTILINE)
        if picture is None or command is None:
            raise ValueError(f"docs/gallery.md: {section.splitlines()[0]} lacks a picture or its command")
        example, *options = shlex.split(command[1])
        found.append(Shown(example, picture[1], read_options(options)))
    return found


def draw(shown: Shown) -> Path:
    """Simulate an example and write its picture or film."""
    file = DOCS / shown.picture
    moving = file.suffix == ".gif"
    robot: dict[str, Any] = {"limits": "off"} if shown.example.endswith(".urdf") else {}
    example = find_example(shown.example, example_files())
    assert example is not None
    target = "cython" if example.parent.name == "large" else "numpy"
    module = eg.load(example, **robot).compile(target=target)
    trajectory = module.simulate(shown.options.end, dense_output=True)
    rate = FPS * (2 if file.stem in QUICK else 1 if moving else SMOOTH)
    motion = sample(trajectory, lambda t: states_at(trajectory, module, t), rate, float(trajectory.t[-1]) / LASTS)
    if moving:
        scene = moving_scene(module, motion, False, False, shown.options.trace)
        dots = SPATIAL if scene.view is None else MOVING
        file.write_bytes(gif_bytes(Frames.of(scene, motion, (), dots), FILM_COLORS))
        return file
    moment = round(MOMENTS.get(file.stem, AT) * (len(motion.t) - 1))
    if not shown.options.trace:  # its surroundings alone, however far the mechanism goes
        one, inputs = slice(moment, moment + 1), None if motion.u is None else motion.u[:, moment : moment + 1]
        motion = motion._replace(t=motion.t[one], x=motion.x[:, one], u=inputs, captions=motion.captions[one])
        moment = 0
    scene = moving_scene(module, motion, False, False, shown.options.trace)
    image = Frames.of(scene, motion, (), STILL).image(moment)
    palette = palette_of([image], COLORS)
    reduced = Image.fromarray(indices_in(palette, image), "P")
    reduced.putpalette(palette.tobytes())
    reduced.save(file, optimize=True)
    return file


def main(names: list[str]) -> None:
    """Draw the pictures of the examples named, or all."""
    (DOCS / "pictures" / "gallery").mkdir(parents=True, exist_ok=True)
    for shown in entries((DOCS / "gallery.md").read_text(encoding="utf-8")):
        if not names or Path(shown.picture).stem in names:
            file = draw(shown)
            print(f"{shown.picture:<50}{file.stat().st_size / 1000:6.0f} kB", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
