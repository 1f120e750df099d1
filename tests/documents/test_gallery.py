"""docs/gallery.md: every example is there with its picture, and the commands that it gives are right."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image
from ruamel.yaml import YAML

import eomgen as eg
from eomgen.cli.verb_view import view
from eomgen.shipped import example_files, find_example
from eomgen.show.data import read_picture

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "gallery.md"
PNG, GIF = 60_000, 300_000  #: bytes of a picture, so that the page stays quick and the repository small


def load_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_gallery", ROOT / "docs" / "make_gallery.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SCRIPT = load_script()
ENTRIES = SCRIPT.entries(PAGE.read_text(encoding="utf-8"))


def test_every_example_is_shown() -> None:
    text = PAGE.read_text(encoding="utf-8")
    files = {file.name for file in example_files().values()}
    assert {entry.example for entry in ENTRIES} == {name for name in files if not name.endswith(".py")}
    assert all(f"`{name}`" in text for name in files if name.endswith(".py"))


@pytest.mark.parametrize("section", PAGE.read_text(encoding="utf-8").split("\n### ")[1:], ids=lambda s: s.split()[0])
def test_an_entry_says_what_is_checked(section: str) -> None:
    assert " Checked: " in section.replace("\n", " ")
    assert section.split()[0].removesuffix(".urdf") in section.split("](pictures/gallery/")[1].split(")")[0]


def test_pictures_are_there_and_small() -> None:
    named = {ROOT / "docs" / entry.picture for entry in ENTRIES}
    assert named == set((ROOT / "docs" / "pictures" / "gallery").iterdir())
    for file in named:
        assert file.stat().st_size < (GIF if file.suffix == ".gif" else PNG), file.name
        with Image.open(file) as image:
            frames = getattr(image, "n_frames", 1)
            assert (frames > 20) == (file.suffix == ".gif")
            assert min(image.size) > 130


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.example)
def test_its_command_can_be_given(entry: Any) -> None:
    file = find_example(entry.example, example_files())
    assert file is not None
    words = [str(file), *(f"--trace={name}" for name in entry.options.trace)]
    words += [f"--plot={name}" for name in entry.options.plot]
    words += [] if entry.options.end is None else [f"--end={entry.options.end}"]
    view.make_context("view", words)  # the parser of the command line takes it
    if entry.options.trace or entry.options.plot:
        module = eg.load(file).compile(target="numpy")
        data = read_picture(module.metadata, module.p)
        assert set(entry.options.trace) <= {*data.markers, *data.bodies}
        assert set(entry.options.plot) <= {*module.x_names, *module.y_names}


@pytest.mark.parametrize("name", ["hoecken", "half_car"])
def test_the_script_makes_what_is_stored(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """But for the fonts and the smoothing of another version of matplotlib."""
    (entry,) = [entry for entry in ENTRIES if Path(entry.picture).stem == name]
    monkeypatch.setattr(SCRIPT, "DOCS", tmp_path)
    (tmp_path / entry.picture).parent.mkdir(parents=True)
    with Image.open(SCRIPT.draw(entry)) as made, Image.open(ROOT / "docs" / entry.picture) as stored:
        assert made.size == stored.size
        assert getattr(made, "n_frames", 1) == getattr(stored, "n_frames", 1)
        a, b = (np.asarray(image.convert("L"), dtype=float) for image in (made, stored))
    assert np.abs(a - b).mean() < 5.0  # of 255
    assert b.std() > 10.0  # something is drawn


def test_an_entry_without_a_command_is_told() -> None:
    with pytest.raises(ValueError, match="engine lacks a picture or its command"):
        SCRIPT.entries("### engine\n\n![x](pictures/gallery/engine.png)\n")


#: What the description of an example says of its motion -> whether a run does so.
CLAIMS: list[tuple[str, str, Callable[[Any], bool]]] = [
    ("cart_pendulum", "falls over", lambda run: run["phi"].max() > np.pi / 2),
    ("four_bar", "coasting", lambda run: run["theta_dot"].min() > 0),
    ("gear_train", "lifts a load", lambda run: run["height"][-1] > 0.1),
    ("kapitza_pendulum", "upside down, held there", lambda run: np.abs(run["theta"] - np.pi).max() < 0.3),
    ("pendulum", "released from the horizontal", lambda run: abs(run["y"][0]) < 1e-12),
    ("planetary_gear", "load that sinks", lambda run: run["height"][-1] < -0.1),
    ("slider_crank", "that swings", lambda run: np.ptp(run["theta"]) < np.pi + 1),
    ("slider_crank", "at 10 rad/s at first", lambda run: run["theta_dot"][0] == 10),
    ("spherical_pendulum", "swinging round", lambda run: run["phi"][-1] > 2 * np.pi),
    ("watt_six_bar", "output swings less", lambda run: np.ptp(run["swing_out"]) < np.ptp(run["swing_in"])),
]


@pytest.mark.parametrize(("name", "text", "does"), CLAIMS, ids=[f"{name}: {text}" for name, text, _ in CLAIMS])
def test_examples_move_as_they_are_described(name: str, text: str, does: Callable[[Any], bool]) -> None:
    model = eg.load_example(name)
    assert text in str(load_yaml(name)["doc"])
    assert does(model.compile(target="numpy").simulate())


def test_the_winch_of_the_page_on_constraints_lifts_its_load(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "constraints.md").read_text(encoding="utf-8")
    (tmp_path / "winch.yaml").write_text(text.partition("```yaml\n")[2].partition("```")[0])
    module = eg.load(tmp_path / "winch.yaml").compile(target="numpy")
    assert "lifts a load" in text
    assert module.simulate(1.0)["height"][-1] > 0.5


def load_yaml(name: str) -> Any:
    return YAML(typ="safe").load(example_files()[name].read_text(encoding="utf-8"))
