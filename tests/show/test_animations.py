"""Animations: as many frames as the time asks for, files that others read, pages that need no network."""

from __future__ import annotations

import base64
import importlib.util
import io
import json
import re
import shutil
import time
from pathlib import Path
from typing import Any

import matplotlib.animation
import numpy as np
import pytest
from browser import Browser
from click.testing import CliRunner
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import eomgen as eg
from eomgen.cli.command import eomgen
from eomgen.errors import MissingDependencyError, UsageError
from eomgen.show import animate as eomgen_animate
from eomgen.show import writers
from eomgen.show.browser import _looks_round, scene_plot
from eomgen.show.build_scene import build_scene
from eomgen.show.film_frames import Frames
from eomgen.show.palettes import indices_in, palette_of
from eomgen.show.shown_motion import moving_scene, sample
from eomgen.show.solids import box, cylinder, sphere
from eomgen.show.unit_panels import ShownColumn, draw_curves

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


def test_a_gif_without_a_file_is_shown_by_a_notebook(run: Any, tmp_path: Path) -> None:
    shown = run.animate(format="gif", fps=4, dpi=30)
    file = run.animate(tmp_path / "run.gif", fps=4, dpi=30)
    assert bytes(shown) == shown.data == file.read_bytes()
    found = re.fullmatch('<img alt="animation" src="data:image/gif;base64,(.*)">', shown._repr_html_())
    assert found is not None
    with Image.open(io.BytesIO(base64.b64decode(found[1]))) as image:
        assert image.n_frames == 13  # 1 s in 3 s, 4 in a second, both ends
    swing = pendulum_modes().animate(1, format="gif", fps=4, dpi=30)
    with Image.open(io.BytesIO(bytes(swing))) as image:
        assert image.n_frames == 8
    assert "<html" in str(run.animate(format="html", fps=4)).lower()


def test_a_format_is_not_a_file(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("gif", ".gif", "mp4"):
        with pytest.raises(UsageError, match=f"such as 'run.{name[-3:]}', or format='{name[-3:]}' without a file"):
            run.animate(name)
    with pytest.raises(UsageError, match="format= is for an animation without a file"):
        run.animate("run.gif", format="gif")
    with pytest.raises(UsageError, match="format must be one of 'gif', 'mp4', 'html', not 'png'"):
        run.animate(format="png")
    assert list(tmp_path.iterdir()) == []


def pendulum_modes() -> Any:
    return eg.load(EXAMPLES / "pendulum.yaml").compile(target="numpy").modes({"theta": 0.0})


def test_ways_are_round_at_any_rate_of_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """A crank that turns by 2 rad from frame to frame leaves a circle, not a polygon, and only behind itself."""
    from eomgen.show import animate
    from eomgen.show.scene import passed

    m = eg.Model("crank")
    crank = m.body("crank", mass=1.0, inertia={"zz": 1.0})
    crank.marker("pin", at=(0.3, 0, 0))
    m.revolute("A", m.ground, crank, coordinate="theta")
    scenes: list[Any] = []
    monkeypatch.setattr(animate, "write", lambda file, scene, *rest: scenes.append(scene))
    m.compile(target="numpy").simulate(3.0, initial={"theta_dot": 20.0}).animate(fps=10, speed=1, trace="crank.pin")
    (way,) = [item.points for item in scenes[0].items if item.role == "trace"]
    assert len(scenes[0].frames) == 31
    middles = (way[1:] + way[:-1]) / 2
    assert np.linalg.norm(way, axis=1) == pytest.approx(0.3, rel=1e-6)
    assert np.linalg.norm(middles, axis=1) == pytest.approx(0.3, rel=0.01)
    behind = passed(way, 4, 31)
    assert behind[-1, :2] == pytest.approx([0.3 * np.cos(8.0), 0.3 * np.sin(8.0)], abs=1e-6)
    assert passed(way, 30, 31).shape == passed(way, 0, 31).shape == way.shape


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
    with pytest.raises(UsageError, match=r"\.gif, \.mp4 or \.html"):
        run.animate(tmp_path / "run.avi")
    with pytest.raises(UsageError, match="fps must be a number greater than 0"):
        run.animate(tmp_path / "run.gif", fps=0)
    with pytest.raises(UsageError, match="is the most; give a speed"):
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


def test_the_speeds_of_a_page_are_those_of_the_mechanism(module: Any) -> None:
    text = str(module.simulate(0.3).animate(speed=0.25))
    assert '<option value="1.0" selected>x0.25</option><option value="2.0">x0.5</option>' in text
    assert "t = 0.000 s" in text
    assert "s  x0.25" not in text


@pytest.mark.needs("chromium")
def test_a_page_plays_and_its_slider_moves_it_without_a_network(run: Any, tmp_path: Path) -> None:
    page = run.animate(tmp_path / "run.html", fps=10, trace="rod.tip", plot=["theta", "energy"], forces=True)
    with Browser(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.wait_for("document.getElementById('words') !== null")
        time = "+document.getElementById('time').value"
        browser.wait_for(f"{time} > 0.2")  # it plays of itself
        browser.click("#play")
        here = browser.evaluate(time)
        pixels = browser.picture()
        assert len(np.unique(pixels.reshape(-1, 3) // 32, axis=0)) > 8  # links of several colours, not an empty canvas
        assert browser.evaluate(time) == here  # it stands still
        browser.click("#time", across=0.6)
        browser.wait_for(f"{time} > 1.0")  # the run of 1 s is shown over 3 s
        there = browser.evaluate(time)
        browser.wait_for("document.getElementById('words').textContent.startsWith('t = 0.6')")
        moved = browser.picture()
        above = slice(40, int(browser.place("#canvasTarget")["h"]) - 20)
        assert (pixels[above] != moved[above]).any(axis=2).mean() > 0.005
        cursor = browser.place("#cursor")["x"]
        browser.click("#play")
        browser.wait_for(f"{time} > {there}")
        browser.wait_for(f"document.querySelector('#cursor').getBoundingClientRect().x > {cursor}")
        shown = "[...document.querySelectorAll('span')].find(e => e.textContent == 'rod')"
        assert browser.evaluate(f"{shown}.getBoundingClientRect().x") > 0  # names stand in the picture
        assert browser.complaints == []
        assert browser.requests == []


def hanging(angle: float = 0.0) -> Any:
    m = eg.Model("hanging", gravity=(0, -9.81, 0))
    bob = m.body("bob", mass=2.0, com=(0, -1, 0))
    m.revolute("hinge", m.ground, bob, coordinate="theta")
    return m.compile(target="numpy").simulate(0.2, initial={"theta": angle})


def test_arrows_are_the_forces_of_joints() -> None:
    """At rest the hinge holds 2 kg; let go at a right angle it holds nothing at first, and pulls inwards later."""
    from eomgen.show.force_arrows import with_arrows
    from eomgen.show.shown_motion import moving_scene, sample

    for angle, force in ((0.0, np.array([0.0, 2 * 9.81])), (np.pi / 2, None)):
        traj = hanging(angle)
        module = traj.columns.module
        motion = sample(
            traj, lambda t, traj=traj: (np.array([np.interp(t, traj.t, row) for row in traj.x]), None), 10.0, 1.0
        )
        scene = with_arrows(moving_scene(module, motion, False, False, ()), module, motion, True)
        (arrow,) = [item for item in scene.items if item.role == "arrow"]
        assert arrow.path is not None
        ways = (arrow.path[:, 1] - arrow.path[:, 0])[:, :2]
        if force is not None:
            assert scene.note == f"longest arrow {force[1]:.4g} N"
            assert ways / np.linalg.norm(ways, axis=1)[:, None] == pytest.approx(np.tile(force / force[1], (3, 1)))
        else:  # m l w^2 along the rod, as w^2 = 2 g sin(fall) / l, and m g cos of the fall across: closed form
            w, q = motion.x[1], motion.x[0]
            inwards, along = np.array([-np.sin(q), np.cos(q)]), 2.0 * (w**2 + 9.81 * np.cos(q))
            expected = (inwards * along).T
            longest = np.linalg.norm(expected, axis=1).max()
            assert ways / np.linalg.norm(ways, axis=1).max() == pytest.approx(expected / longest, abs=1e-6)
    with pytest.raises(UsageError, match="no joint, spring or damper 'hing' .* there are hinge"):
        with_arrows(scene, module, motion, ("hing",))


def test_arrows_are_the_forces_of_springs_and_dampers() -> None:
    """On each body at an end: -k (s - s0), of the free length 0.4, and -c s', away from the other end."""
    from eomgen.show.force_arrows import with_arrows
    from eomgen.show.shown_motion import moving_scene, sample

    m = eg.Model("two", gravity=(0, -9.81, 0))
    k = m.parameter("k", 80.0)
    upper, lower = m.body("upper", mass=1.0), m.body("lower", mass=2.0)
    m.prismatic("A", m.ground, upper, axis="y", coordinate="a")
    m.prismatic("B", m.ground, lower, axis="y", coordinate="b")
    m.spring("coil", lower, upper, stiffness=k, length=0.4)
    m.damper("pot", m.ground.at(0.0, 1.0, 0.0), upper, damping="3 + k/80")
    m.torque("lift", "B", "k/4*t")
    traj = m.compile(target="numpy").simulate(0.5, initial={"a": 0.3, "b": -0.3, "a_dot": 0.5}, dense_output=True)
    module = traj.columns.module
    motion = sample(traj, lambda t: (traj.at(t).x, None), 20.0, 1.0)
    x = dict(zip(module.x_names, motion.x, strict=True))
    scene = with_arrows(moving_scene(module, motion, False, False, ()), module, motion, ["coil", "pot"])
    found = [(item.name, item.path[:, 1, 1] - item.path[:, 0, 1], item.path[:, 0, 1]) for item in scene.items
             if item.role == "arrow" and item.path is not None]  # fmt: skip
    push, drag = -80.0 * (x["a"] - x["b"] - 0.4), -4.0 * x["a_dot"]
    longest = max(np.abs(push).max(), np.abs(drag).max())
    assert scene.note == f"longest arrow {longest:.4g} N"
    scale = max(np.abs(ways).max() for _, ways, _ in found) / longest
    expected = [("coil", push, x["a"]), ("coil", -push, x["b"]), ("pot", drag, x["a"])]  # ground has no arrow
    for (name, ways, tails), (element, force, place) in zip(found, expected, strict=True):
        assert name == element
        assert ways == pytest.approx(scale * force, abs=1e-6 * scale * longest)
        assert tails == pytest.approx(place, abs=1e-12)
    named = with_arrows(moving_scene(module, motion, False, False, ()), module, motion, True)
    assert {item.name for item in named.items if item.role == "arrow"} == {"A", "B", "coil", "pot"}


def test_frames_and_films(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from eomgen.show import writers

    folder = run.animate(tmp_path / "frames", fps=2, speed=0.5, dpi=40)
    assert [file.name for file in sorted(folder.iterdir())] == [f"frame_{k}.png" for k in range(5)]
    with Image.open(folder / "frame_3.png") as image:
        assert np.ptp(np.asarray(image.convert("L"))) > 100
    with pytest.raises(UsageError, match="must be new or empty"):
        run.animate(folder)
    if importlib.util.find_spec("imageio_ffmpeg") or shutil.which("ffmpeg"):
        film = run.animate(tmp_path / "run.mp4", fps=5, dpi=40).read_bytes()
        assert film[4:8] == b"ftyp"
    monkeypatch.setattr(matplotlib.animation.writers, "is_available", lambda name: False)
    monkeypatch.setattr(writers, "import_module", lambda name: (_ for _ in ()).throw(ImportError(name)))
    with pytest.raises(MissingDependencyError, match=r"needs ffmpeg: pip install imageio-ffmpeg.*\.html do not need"):
        run.animate(tmp_path / "other.mp4")


def test_a_range_at_one_time_moves_in_a_page_too(module: Any, tmp_path: Path) -> None:
    motion = module.kinematic_analysis(theta=np.linspace(0.0, 1.0, 5))
    text = motion.animate(tmp_path / "range.html", plot="s").read_text()
    assert '"words": ["theta = 0.000 rad", "theta = 0.250 rad"' in text
    clock = json.loads(re.search(r'"clock": (\[[^]]*\])', text)[1])  # type: ignore[index]
    assert len(set(clock)) == 5


@pytest.mark.parametrize("dpi", ["x", 0, True, 1e6, float("nan")])
def test_dots_are_a_sensible_number(run: Any, tmp_path: Path, dpi: Any) -> None:
    with pytest.raises(UsageError, match="dpi must be a number(?: from 1 to 1200)?, not"):
        run.animate(tmp_path / "a.gif", dpi=dpi)


def test_a_model_in_place_of_a_module_is_told(run: Any, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"model must be a module, as Model.compile\(\) returns"):
        run.animate(tmp_path / "a.gif", model=eg.load(EXAMPLES / "slider_crank.yaml"))


def test_curves_beside_an_animation_are_smooth(module: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Between the few steps of a run they follow the motion, as traj.plot does."""
    shown: list[Any] = []
    monkeypatch.setattr(eomgen_animate, "write", lambda file, scene, motion, curves, dpi, format: shown.extend(curves))
    module.simulate(0.2).animate(tmp_path / "a.gif", plot="pin_x")
    (curve,) = shown
    exact = module.simulate(0.2, t_eval=curve.over)["pin_x"]
    assert len(curve.over) > 500
    assert curve.values == pytest.approx(exact, abs=1e-5)


def test_a_title_fits_a_narrow_picture() -> None:
    m = eg.Model("a_weight_on_a_very_long_rail", gravity=(0, -9.81, 0))
    m.prismatic("fall", m.ground, m.body("weight", mass=1), axis="y", coordinate="h")
    mod = m.compile(target="numpy")
    motion = sample(mod.simulate(1.0), lambda t: (mod.simulate(1.0, t_eval=t).x, None), 5, 0.25)
    frames = Frames.of(moving_scene(mod, motion, None, False, ())._replace(note="longest arrow 1.23e+04 N"), motion)
    box = frames.titles[0].get_window_extent(frames.canvas.get_renderer())
    assert 0 <= box.x0 < box.x1 <= frames.canvas.get_width_height()[0]


@pytest.mark.parametrize("dpi", [45, 80])
def test_letters_can_be_read_in_pictures_of_few_dots(run: Any, module: Any, dpi: int) -> None:
    """Names, numbers and titles are at least 8.5 dots high, and each number of an axis too."""
    motion = sample(run, lambda t: (np.repeat(run.x[:, :1], len(t), axis=1), None), 2, None)
    curve = ShownColumn("s", "m", motion.over, np.zeros(len(motion.over)))
    frames = Frames.of(moving_scene(module, motion, True, False, ()), motion, [curve], dpi=dpi)
    written = [text for text in frames.figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert {"crank", "A"} < {text.get_text() for text in written}
    assert min(text.get_fontsize() * dpi / 72 for text in written) > 8.5


def test_curves_over_a_range_name_its_unit(module: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    turn = module.kinematic_analysis(theta=np.linspace(0, 6, 9))
    motion = sample(turn, lambda t: (turn.x, None), 25, None)
    ax = Figure().add_subplot()
    draw_curves([ax], [[ShownColumn("s", "m", motion.over, turn["s"])]], motion)
    assert ax.get_xlabel() == r"$\theta$ (rad)"


@pytest.mark.needs("chromium")
def test_a_page_fits_a_narrow_window(run: Any, tmp_path: Path) -> None:
    pytest.importorskip("k3d")
    file = run.animate(tmp_path / "run.html", names=False)
    with Browser(tmp_path / "profile", size=(420, 760)) as browser:
        browser.open(file.as_uri())
        browser.wait_for("document.getElementById('words') && document.getElementById('words').textContent !== ''")
        end = time.monotonic() + 30
        while True:  # until the mechanism is drawn
            drawn = (browser.picture()[60:600] < 200).any(axis=(0, 2))
            if drawn.sum() > 50 and not drawn[:3].any() and not drawn[-3:].any():
                break
            assert time.monotonic() < end, "the mechanism reaches beyond the window"
            time.sleep(0.5)


@pytest.mark.needs("chromium")
def test_a_page_says_what_it_lacks(run: Any, tmp_path: Path) -> None:
    pytest.importorskip("k3d")
    file = run.animate(tmp_path / "run.html", names=False)
    with Browser(tmp_path / "profile") as browser:
        script = "HTMLCanvasElement.prototype.getContext = () => null;"
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=script)
        browser.open(file.as_uri())
        browser.wait_for("document.getElementById('missing') !== null")
        assert "needs WebGL 2" in browser.evaluate("document.getElementById('missing').textContent")


def test_curves_of_two_units_have_an_axis_each(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Frames] = []
    monkeypatch.setitem(writers.FILMS, "gif", lambda frames: made.append(frames) or b"")
    run.animate(format="gif", plot=["theta", "s", "pin_x"], fps=4)
    axes = made[0].figure.axes
    assert [ax.get_ylabel() for ax in axes[1:]] == ["rad", "m"]
    assert [[line.get_ydata()[0] for line in ax.lines[:-1]] for ax in axes[1:]] == [
        [run["theta"][0]], [run["s"][0], run["pin_x"][0]],
    ]  # fmt: skip
    made[0].show(3)
    assert [ax.lines[-1].get_xdata()[0] for ax in axes[1:]] == [made[0].motion.over[3]] * 2
    run.animate(format="gif", plot=["s", "pin_x"], fps=4)
    assert len(made[1].figure.axes) == 2
    page = str(run.animate(plot=["theta", "s"], fps=4))
    heights = [int(h) for h in re.findall(r"#curves \{ position: fixed; bottom: 40px; height: (\d+)px", page)]
    assert heights == [280]


def test_a_gif_keeps_the_colours_of_its_frames() -> None:
    """Of a spatial model, whose solids have many shades; 64 colours by number of dots were wrong by 54 of 255."""
    module = eg.load(EXAMPLES / "stewart_platform.yaml").compile(target="numpy")
    run = module.simulate(0.1)
    motion = sample(run, lambda t: (np.repeat(run.x[:, :1], len(t), axis=1), None), 2, None)
    frames = Frames.of(moving_scene(module, motion, None, False, ()), motion)
    with Image.open(io.BytesIO(writers.gif_bytes(frames))) as film:
        stored = np.asarray(film.convert("RGB")).astype(int)
    wrong = np.abs(stored - frames.image(0)).max(axis=2)
    assert wrong.mean() < 0.5
    assert np.percentile(wrong, 99.9) <= 16


def test_few_colours_stay_as_they_are() -> None:
    image = np.array([[[255, 255, 255], [1, 2, 3]], [[4, 5, 6], [255, 255, 254]]], dtype=np.uint8)
    palette = palette_of([image], 8)
    assert (palette[indices_in(palette, image)] == image).all()


@pytest.mark.parametrize("name", ["slider_crank", "jansen_leg"])
def test_parts_of_a_page_lie_in_layers(name: str) -> None:
    """No two bodies share a depth, and joints lie before all of them, by less than a few symbols."""
    pytest.importorskip("k3d")
    module = eg.load(EXAMPLES / f"{name}.yaml").compile(target="numpy")
    scene = build_scene(module, module.x0()[: module.n_q, None])
    depths: dict[str, set[float]] = {}
    for one in scene_plot(scene).objects:
        role, _, _ = one.name.partition(" ")
        if role in ("link", "joint", "rim"):
            depths.setdefault(role, set()).add(round(float(scene.view[2] @ one.model_matrix[:3, 3]) / scene.symbol, 4))
    bodies = {item.name for item in scene.items if item.role == "link"}
    assert len(depths["link"]) == len(bodies)
    assert min(depths["joint"]) > max(depths["link"]) > min(depths["link"]) > 0.0
    assert max(depths["joint"]) < 2.0
    assert depths["rim"] == depths["joint"]


def test_a_hinge_is_a_cylinder_and_a_ball_is_round() -> None:
    for mesh, round_ in ((cylinder(1.0, 2.5), False), (sphere(1.0), True), (box((1, 1, 1)), False)):
        assert _looks_round(*mesh) is round_
