"""Animations: as many frames as the time asks for, files that others read, pages that need no network and play."""

import base64
import importlib.util
import io
import re
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from children import executed
from PIL import Image
from refusals import refuses

import eomgen as eg


@pytest.fixture(scope="module")
def module() -> Any:
    return eg.load_example("slider_crank").compile(target="numpy")


@pytest.fixture(scope="module")
def run(module: Any) -> Any:
    return module.simulate(1.0)


def test_positions_of_markers_are_those_of_outputs(run: Any, module: Any, tmp_path: Path) -> None:
    tip = run.position("rod.tip")
    assert tip[0] == pytest.approx(run["pin_x"], abs=1e-12)
    assert run.poses().shape == (module.n_bodies, 4, 4, len(run))
    assert run.position("slider") == pytest.approx(tip, abs=1e-6)
    refuses("EG-NAME-UNKNOWN rod.tap rod.tip", run.position, "rod.tap")
    loaded = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    assert loaded.poses(module) == pytest.approx(run.poses(), abs=1e-12)
    refuses("EG-MISSING model=module", loaded.animate, tmp_path / "run.gif")
    other = eg.load_example("pendulum").compile(target="numpy")
    refuses("EG-SHAPE module", loaded.poses, other)


def test_a_gif_has_a_frame_for_every_step_of_time(run: Any, module: Any, tmp_path: Path) -> None:
    file = run.animate(tmp_path / "run.gif", fps=10, speed=0.5, trace="rod.tip", plot="theta", dpi=40)
    with Image.open(file) as image:
        durations, frames = [], []
        for k in range(image.n_frames):
            image.seek(k)
            durations.append(image.info["duration"])
            frames.append(np.asarray(image.convert("L"), dtype=int))
    assert (len(frames), sum(durations)) == (21, 2100)  # 1 s at half speed, 10 in a second, both ends
    assert all((np.abs(a - b) > 40).any() for a, b in pairwise(frames))  # it moves
    shown = run.animate(format="gif", fps=4, dpi=30)
    found = re.fullmatch('<img alt="animation" src="data:image/gif;base64,(.*)">', shown._repr_html_())
    assert found is not None
    with Image.open(io.BytesIO(base64.b64decode(found[1]))) as image:
        assert image.n_frames == 13  # 1 s in 3 s, 4 in a second, both ends


def test_a_gif_keeps_the_colours_of_its_frames(tmp_path: Path) -> None:
    """Of a spatial model, whose solids have many shades; 64 colours by number of dots were wrong by 54 of 255."""
    run = eg.load_example("stewart_platform").compile(target="numpy").simulate(0.02)
    film = run.animate(tmp_path / "a.gif", fps=2, speed=0.02, dpi=40)
    folder = run.animate(tmp_path / "frames", fps=2, speed=0.02, dpi=40)
    assert [file.name for file in sorted(folder.iterdir())] == ["frame_0.png", "frame_1.png", "frame_2.png"]
    refuses("EG-FILE empty", run.animate, folder)
    with Image.open(film) as stored, Image.open(folder / "frame_0.png") as made:
        a, b = (np.asarray(one.convert("RGB")).astype(int) for one in (stored, made))
    wrong = np.abs(a - b).max(axis=2)
    assert wrong.mean() < 0.5
    assert np.percentile(wrong, 99.9) <= 16


def test_films_need_ffmpeg(run: Any, tmp_path: Path) -> None:
    if importlib.util.find_spec("imageio_ffmpeg") or shutil.which("ffmpeg"):
        assert run.animate(tmp_path / "run.mp4", fps=5, dpi=40).read_bytes()[4:8] == b"ftyp"
    else:
        refuses("EG-PACKAGE-MISSING ffmpeg", run.animate, tmp_path / "run.mp4")


@pytest.mark.parametrize(
    ("file", "how", "said"),
    [
        ("run.avi", {}, "EG-FILE .gif .mp4 .html"),
        ("run.gif", {"fps": 0}, "EG-RANGE fps 0"),
        ("run.gif", {"fps": 60, "speed": 0.001}, "EG-TOO-LARGE speed"),
        ("run.gif", {"trace": "nowhere"}, "EG-NAME-UNKNOWN trace"),
        ("run.gif", {"dpi": "x"}, "EG-NUMBER dpi"),
        ("run.gif", {"dpi": 1e6}, "EG-RANGE dpi 1 1200"),
        ("run.gif", {"format": "gif"}, "EG-CONFLICT format="),
        ("run.gif", {"forces": ("hing",)}, "EG-NAME-UNKNOWN hing"),
        ("gif", {}, "EG-FILE run.gif gif format="),
        (None, {"format": "png"}, "EG-CHOICE gif mp4 html png"),
        ("run.gif", {"model": eg.Model("m")}, "EG-TYPE Model.compile"),
    ],
)
def test_slips_are_reported_before_any_work(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str | None, how: dict[str, Any], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    refuses(said, run.animate, file, **how)
    assert list(tmp_path.iterdir()) == []


def test_a_page_holds_all_it_needs(run: Any, module: Any, tmp_path: Path) -> None:
    text = run.animate(tmp_path / "run.html", fps=10, trace="rod.tip").read_text()
    assert re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", text) == []
    assert "default-src 'none'" in text
    assert "<title>slider_crank</title>" in text
    slow = str(module.simulate(0.1).animate(speed=0.25))
    assert '"pace": 0.25' in slow
    assert "t = 0.000 s" in slow
    motion = module.kinematic_analysis(theta=np.linspace(0.0, 1.0, 5))
    assert '"words": ["theta = 0.000 rad", "theta = 0.250 rad"' in str(motion.animate(plot="s"))


def test_the_longest_arrow_is_the_force_that_a_joint_bears() -> None:
    """At rest the hinge holds 2 kg; let go at a right angle it holds nothing at first, and 3 m g at the bottom."""
    m = eg.Model("hanging", gravity=(0, -9.81, 0))
    m.revolute("hinge", m.ground, m.body("bob", mass=2.0, com=(0, -1, 0)), coordinate="theta")
    mod = m.compile(target="numpy")
    for angle, end, force in ((0.0, 0.2, 2 * 9.81), (np.pi / 2, 0.6, 3 * 2 * 9.81)):
        run = mod.simulate((0, end), initial={"theta": angle}, rtol=1e-9)
        shown = re.search(r"longest arrow ([\d.]+) N", str(run.animate(forces=True, fps=40, speed=0.1)))
        assert shown is not None
        q, w = run["theta"], run["theta_dot"]
        bound = np.abs(2 * (w**2 + 9.81 * np.cos(q))).max()  # m l w^2 along the rod, and m g cos of the fall
        assert float(shown[1]) == pytest.approx(bound, rel=0.01)
        assert float(shown[1]) <= force * 1.001


def test_the_arrow_of_a_spring_points_along_its_last_part(tmp_path: Path) -> None:
    """A bob straight below a pin, over which its spring runs to a far wall."""
    m = eg.Model("cord", gravity=(0, -9.81, 0))
    m.prismatic("slide", m.ground, bob := m.body("bob", mass=1.0), axis="y", coordinate="y")
    m.spring("cord", m.ground.at(-3, 0, 0), bob, stiffness=10, length=1, via=[m.ground.at(0, 1, 0)])
    run, seen = m.compile(target="numpy").simulate(0.1, initial={"y": -1.0}), []
    for forces in ((), ["cord"]):
        run.animate(folder := tmp_path / f"frames{len(forces)}", fps=10, forces=forces)
        seen.append(np.asarray(Image.open(min(folder.iterdir())).convert("RGB"), dtype=int))
    before, after = (frame @ [65536, 256, 1] for frame in seen)
    rows, columns = np.nonzero(~np.isin(after, before) & (np.ptp(seen[1], axis=2) > 60))
    assert 10 < 2 * np.ptp(columns) < np.ptp(rows)


@pytest.mark.thorough
def test_a_kernel_shows_progress_pictures_and_short_tracebacks(tmp_path: Path) -> None:
    cells = [
        "import eomgen as eg\nmod = eg.load_example('pendulum').compile(target='numpy')\nmod",
        "traj = mod.simulate(20.0, progress=True, rtol=1e-9)",
        "traj.plot();",
        "traj.animate(plot='theta')",
        "def mine():\n    return mod.simulate(1.0, initial={'thet': 3})\nmine()",
    ]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in cells])
    notebook.cells[4].metadata.tags = ["raises-exception"]
    nbformat.write(notebook, tmp_path / "given.ipynb")
    (tmp_path / "done").mkdir()
    outputs = [cell.outputs for cell in executed(tmp_path / "given.ipynb", tmp_path / "done", raw=True).cells]
    assert "base64" in outputs[0][0].data["text/html"]
    (bar,) = outputs[1]  # what was shown of the progress, at its end: nothing
    assert bar.data["text/html"] == ""
    assert any("image/png" in one.get("data", {}) for one in outputs[2])
    assert outputs[3][0].data["text/html"].startswith("<iframe")
    (error,) = outputs[4]
    text = "\n".join(error.traceback)
    assert "line 2, in mine" in text
    assert "did you mean theta" in text
    assert "eomgen/" not in text
