"""Animations: as many frames as the time asks for, files that others read, pages that need no network."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import eomgen as eg
from eomgen.cli.command import eomgen
from eomgen.errors import UsageError

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def module() -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile(target="numpy")


@pytest.fixture(scope="module")
def run(module: Any) -> Any:
    return module.simulate(1.0)


def test_positions_of_markers_are_those_of_outputs(run: Any, module: Any) -> None:
    tip = run.position("rod.tip")
    assert tip[0] == pytest.approx(run["pin_x"], abs=1e-12)
    assert run.q.shape == (module.n_q, len(run))
    assert run.v.shape == (module.n_v, len(run))
    assert run.poses().shape == (module.n_bodies, 4, 4, len(run))
    assert run.position("slider") == pytest.approx(tip, abs=1e-6)
    with pytest.raises(UsageError, match="no marker or body 'rod.tap'; did you mean rod.tip"):
        run.position("rod.tap")


def test_a_gif_has_a_frame_for_every_step_of_time(run: Any, tmp_path: Path) -> None:
    file = run.animate(tmp_path / "run.gif", fps=10, speed=0.5, trace="rod.tip", plot="theta", dpi=40)
    with Image.open(file) as image:
        frames = image.n_frames
        durations = []
        for k in range(frames):
            image.seek(k)
            durations.append(image.info["duration"])
    assert frames == 21  # 1 s at half speed, 10 in a second, both ends
    assert sum(durations) == 2100


def test_a_saved_run_asks_for_its_model(run: Any, module: Any, tmp_path: Path) -> None:
    loaded = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    with pytest.raises(UsageError, match="give model=module"):
        loaded.animate(tmp_path / "run.gif")
    assert loaded.poses(module) == pytest.approx(run.poses(), abs=1e-12)
    loaded.animate(tmp_path / "run.gif", model=module, fps=4, dpi=30)
    other = eg.load(EXAMPLES / "pendulum.yaml").compile(target="numpy")
    with pytest.raises(UsageError, match="give the module that it was made with"):
        loaded.poses(other)


def test_bad_files_and_rates_are_refused_before_any_work(run: Any, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"\.gif, \.mp4, \.html"):
        run.animate(tmp_path / "run.avi")
    with pytest.raises(UsageError, match="fps must be a number greater than 0"):
        run.animate(tmp_path / "run.gif", fps=0)
    with pytest.raises(UsageError, match="of which an animation has at most"):
        run.animate(tmp_path / "run.gif", fps=60, speed=0.001)
    with pytest.raises(UsageError, match="trace"):
        run.animate(tmp_path / "run.gif", trace="nowhere")
    assert list(tmp_path.iterdir()) == []


def test_the_command_line_draws_and_animates(tmp_path: Path) -> None:
    model, picture, film = str(EXAMPLES / "pendulum.yaml"), tmp_path / "p.png", tmp_path / "p.gif"
    done = CliRunner().invoke(eomgen, ["check", model, "--draw", str(picture)])
    assert done.exit_code == 0, done.output
    with Image.open(picture) as image:
        assert np.ptp(np.asarray(image.convert("L"))) > 100  # not blank
    words = ["run", model, "--target", "numpy", "--end", "0.5", "--animate", str(film)]
    done = CliRunner().invoke(eomgen, words)
    assert done.exit_code == 0, done.output
    assert f"wrote {film}" in done.output
    with Image.open(film) as image:
        assert image.n_frames == 76  # 0.5 s shown over 3 s at 25 in a second


def test_a_page_holds_all_it_needs(run: Any, tmp_path: Path) -> None:
    pytest.importorskip("k3d")
    text = run.animate(tmp_path / "run.html", fps=10, trace="rod.tip").read_text()
    assert re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", text[:5000] + text[-5000:]) == []
    assert "<title>slider_crank</title>" in text


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_a_page_shows_the_mechanism_without_a_network(run: Any, tmp_path: Path) -> None:
    pytest.importorskip("k3d")
    page = run.animate(tmp_path / "run.html", fps=10)
    shot = tmp_path / "shot.png"
    words = ["chromium", "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
    words += ["--enable-unsafe-swiftshader", "--enable-logging=stderr", "--v=0", "--window-size=900,600"]
    words += [
        "--virtual-time-budget=20000",
        "--run-all-compositor-stages-before-draw",
        f"--user-data-dir={tmp_path / 'profile'}",
    ]
    words += ["--host-resolver-rules=MAP * ~NOTFOUND", f"--screenshot={shot}", page.as_uri()]
    for _ in range(4):  # a loaded machine may take the picture before WebGL has drawn
        done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
        console = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "Uncaught" in line]
        assert console == []
        assert "ERR_NAME_NOT_RESOLVED" not in done.stderr
        with Image.open(shot) as image:
            pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
        colours = {tuple(c) for c in (pixels // 32)}
        if len(colours) > 8:
            break
    assert len(colours) > 8  # links of several colours, not an empty canvas
