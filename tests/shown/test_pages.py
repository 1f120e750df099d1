"""Pages in which a mechanism runs: the numbers of simulate, closed loops, text that stays text, no request."""

import json
import subprocess
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser

import eomgen as eg

SAME = 1e-9  #: largest difference of a state in a page from that of simulate, at the same method and tolerances
CLOSED = 1e-9  #: m, rad
#: In a page: the largest residual of the loops at the state shown, which is finite.
RESIDUAL = """(() => { const f = page.frames[page.cursor];
return f.x.every(Number.isFinite) ? page.model.residual(f.t, f.x) : Infinity; })()"""
#: 20 random moves of sliders and drags, each followed by some frames of the run: the largest residual.
AT_RANDOM = """(async () => {
  let worst = 0;
  const random = () => { window.seed = ((window.seed ?? 1) * 16807) % 2147483647; return window.seed / 2147483647; };
  const slides = [...document.querySelectorAll('.field input[type=range]')];
  const { clientWidth: w, clientHeight: h } = get('over');
  for (let k = 0; k < 20; k += 1) {
    const slide = slides[Math.floor(random() * slides.length)];
    const grip = page.picture.pick(random() * w, random() * h);
    if (grip && random() < 0.7) { page.grip = grip; page.drag([random() * w, random() * h]); page.grip = null; }
    else { slide.value = +slide.min + random() * (slide.max - slide.min); slide.oninput(); }
    page.play(random() < 0.5);
    await new Promise(requestAnimationFrame);
    await new Promise(requestAnimationFrame);
    worst = Math.max(worst, RESIDUAL);
  }
  const before = page.count;
  for (let k = 0; k < 3; k += 1) await new Promise(requestAnimationFrame);
  return page.count > before ? worst : Infinity;
})()"""
BOUNCER = """name: bouncer
doc: </script><script>alert(1)</script>
gravity: [0, -g, 0]
parameters: {g: 9.81, e: 0.8}
inputs: {push: {signal: 0.2*sin(3*t)}}
bodies: {ball: {mass: 1.0, inertia: {zz: 0.1}}}
joints: {drop: {type: prismatic, between: [ground, ball], axis: y, coordinate: h}}
forces: {up: {type: torque, joint: drop, value: push}}
events: {ground: {expression: h, direction: -1, reset: {h_dot: -e*h_dot}}}
initial: {h: 1.0}
simulation: {end: 1.5, rtol: 1e-9, atol: 1e-11}
"""
IN_NODE = """
const text = require("fs").readFileSync(process.argv[1], "utf8"), times = JSON.parse(process.argv[2]);
const data = JSON.parse(text.match(/id="data">([^<]*)<.script>/)[1]);
require("vm").runInThisContext(text.match(/<script>([^]*?)<.script>/)[1]);
Model.open(data.model, data.wasm).then((model) => {
  Object.assign(model, JSON.parse(process.argv[3] ?? "{}"));
  model.begin(0, Float64Array.from(data.model.x0));
  const states = times.map((t) => (model.advance(t), [...model.state(t)]));
  const arrows = times.map((t, k) => [...model.call("outputs", t, states[k]).subarray(model.info.y.length)]);
  const energies = states.map((x, k) => [...model.call("energy", times[k], x)]);
  console.log(JSON.stringify({ inputs: model.inputs, states, energies, arrows, happened: model.happened }));
});
"""


@cache
def slider_crank() -> eg.Module:
    return eg.load_example("slider_crank").compile()


def in_node(page: Path, times: np.ndarray, **how: Any) -> Any:
    """States, energies, events and arrows of a page's model at some times, by node."""
    words = ["node", "-e", IN_NODE, str(page), json.dumps(times.tolist()), json.dumps(how)]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True, timeout=300).stdout)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return slider_crank().page(tmp_path_factory.mktemp("pages") / "slider_crank.html")


@pytest.fixture
def opened(page: Path, tmp_path: Path) -> Iterator[Browser]:
    with Browser(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.wait_for("window.page !== undefined && page.count > 2")
        yield browser
        assert (browser.complaints, browser.requests) == ([], [])


def put_in(opened: Browser, name: str, value: Any) -> str:
    """Type a value into the box of a name; what the page says to it, its loops closed."""
    box = f"[...document.querySelectorAll('.field')].find((one) => one.textContent.startsWith('{name}')).children[2]"
    opened.evaluate(f"(() => {{ const it = {box}; it.value = '{value}'; it.onchange(); }})()")
    assert opened.evaluate(RESIDUAL) < CLOSED
    return str(opened.evaluate("get('message').textContent"))


@pytest.mark.needs("node")
@pytest.mark.slow
def test_a_page_takes_the_steps_of_simulate(page: Path) -> None:
    times = np.linspace(0.0, 2.0, 101)
    run = slider_crank().simulate(5.0, t_eval=times)
    seen = in_node(page, times)
    assert np.abs(np.array(seen["states"]).T - run.x).max() < SAME
    assert np.abs(np.array(seen["energies"]).sum(axis=1) - run["energy"]).max() < SAME


@pytest.mark.needs("node")
@pytest.mark.slow
def test_steps_of_one_size_and_arrows_are_those_of_the_module(page: Path) -> None:
    module, times, step = slider_crank(), np.linspace(0.0, 0.4, 9), 1e-3
    run = module.simulate(0.4, method="RK4", step=step, t_eval=times)
    seen = in_node(page, times, method=1, stepSize=step)
    assert np.abs(np.array(seen["states"]).T - run.x).max() < SAME
    forces = module.reactions(run.t, run.x)[:, :3] * [[1.0], [1.0], [0.0]]  # those in the plane are determined
    arrows = np.array(seen["arrows"]).reshape(len(times), -1, 6)[:, -4:, 3:]  # after the motor's and the spring's
    assert np.abs(np.moveaxis(arrows, 0, 2) - forces).max() < SAME * np.abs(forces).max()
    x, n = module.x0(), module.n_q
    for _ in range(400):  # velocities first, as step_semi_implicit of a C library
        y = x + np.append(np.zeros(n), step * module.rhs(0.0, x)[n:])
        x = module.project(np.append(x[:n] + step * module.rhs(0.0, y)[:n], y[n:]))
    seen = in_node(page, times, method=2, stepSize=step)
    assert np.abs(seen["states"][-1] - x).max() < SAME


@pytest.mark.needs("node")
@pytest.mark.thorough
@pytest.mark.parametrize("name", ["double_wishbone", "planetary_gear"])
def test_loops_and_gears_run_as_in_simulate(name: str, tmp_path: Path) -> None:
    module, times = eg.load_example(name).compile(), np.linspace(0.0, 1.0, 41)
    page = module.page(tmp_path / "it.html")
    run = module.simulate(1.0, t_eval=times)
    size = np.abs(run.x).max()
    assert np.abs(np.array(in_node(page, times)["states"]).T - run.x).max() < SAME * size
    run = module.simulate(1.0, t_eval=times, method="RK4", step=1e-3)  # no step size that rounding decides on
    seen = in_node(page, times, method=1, stepSize=1e-3)
    assert np.abs(np.array(seen["states"]).T - run.x).max() < 1e-3 * SAME * size


@pytest.mark.needs("node")
@pytest.mark.slow
def test_events_and_inputs_over_time_are_those_of_simulate(tmp_path: Path) -> None:
    (tmp_path / "bouncer.yaml").write_text(BOUNCER)
    module = eg.load(tmp_path / "bouncer.yaml").compile(target="numpy")
    page = module.page(tmp_path / "bouncer.html")
    assert "alert(1)</script>" not in page.read_text()
    run = module.simulate(1.5, t_eval=np.linspace(0.0, 1.4, 50))
    seen = in_node(page, run.t)
    assert np.abs(np.array(seen["states"]).T - run.x).max() < SAME
    assert seen["inputs"] == ["as declared"]
    assert [t for name, t in seen["happened"]] == pytest.approx(
        run.t_events["ground"][: len(seen["happened"])], abs=SAME
    )


@pytest.mark.needs("chromium")
@pytest.mark.slow
def test_sliders_and_drags_keep_loops_closed_and_a_gap_is_told(opened: Browser) -> None:
    opened.click("#play")
    put = partial(put_in, opened)
    for theta in (2.9, -2.0, 0.1):  # past the dead centres
        assert put("theta (", theta) == ""
        x = opened.evaluate("[...page.frames[page.cursor].x]")
        slider = 0.1 * np.cos(theta) + np.sqrt(0.35**2 - (0.1 * np.sin(theta)) ** 2)
        assert x[2] == pytest.approx(slider, abs=1e-9)
    put("l (", 0.175)
    assert put("r (", 0.17) == ""
    put("theta (", np.pi / 2)
    assert "do not close" in put("r (", 0.2)
    assert put("r (", 0.1) == ""
    for k in range(10):
        where = opened.evaluate("page.picture.seen(place(page.picture.poses[0], [0.05, 0, 0])).slice(0, 2)")
        top = opened.place("#over")
        at = {"x": top["x"] + where[0], "y": top["y"] + where[1], "button": "left", "buttons": 1, "clickCount": 1}
        opened.call("Input.dispatchMouseEvent", type="mousePressed", **at)
        for step in (1, 2, 3):
            move = {**at, "x": at["x"] + 15 * step * np.cos(k), "y": at["y"] + 15 * step * np.sin(k)}
            opened.call("Input.dispatchMouseEvent", type="mouseMoved", **move)
        opened.call("Input.dispatchMouseEvent", type="mouseReleased", **at)
        assert opened.evaluate(RESIDUAL) < CLOSED


@pytest.mark.needs("chromium")
@pytest.mark.slow
def test_what_a_page_refuses_is_told_and_changes_nothing_else(opened: Browser) -> None:
    opened.click("#play")
    put = partial(put_in, opened)
    for name in ("r (", "theta (", "tau ("):
        for value in ("1e999", "-Infinity", ""):
            assert "must be a finite number" in put(name, value)
    assert "do not close" in put("r (", 0.9)
    assert put("m_c (", 1.2) == ""
    for text in ("max(3)", "atan2(2)", "sin(1,2,3)", "const(7)", "x(2)", "2 constructor 3", "1e999*t", "toString(1)"):
        assert text in put("tau (", text)
    assert put("tau (", "max(1, t, 2*sin(t))") == ""
    copied = opened.evaluate("(page.copy('yaml'), get('copied').value)")
    assert 'inputs: {tau: {signal: "max(1, t, 2*sin(t))"}}\ninitial: {theta: 0.3, theta_dot: 10}' in copied
    assert put("tau (", "2000") == ""
    assert opened.evaluate("page.forces[0].slide.max") == "2000"
    opened.evaluate("get('declared').click()")
    assert opened.evaluate(
        "page.model.p.every((p, k) => p === page.model.info.pValues[k]) && page.model.inputs[0] === 0"
    )

    put("theta (", np.pi / 2)  # a start that longer cranks do not reach
    opened.evaluate("page.replace(0, page.model.reach(0, page.start, page.model.p, [[0, 0.02]])[0])")
    assert "what is shown is the start" in put("r (", 0.36)
    assert opened.evaluate("page.model.residual(0, page.start)") < CLOSED

    opened.evaluate("page.model.state = () => { throw new Error('lost'); }")
    opened.click("#play")
    opened.wait_for("get('message').textContent.includes('lost')")
    opened.evaluate("delete page.model.state")
    opened.click("#play")
    opened.wait_for("page.frames.length > 3")
    opened.click("#theme")  # keys work after a click on a button
    opened.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowLeft")
    assert opened.evaluate("page.playing") is False
    assert opened.evaluate("[0.0000187, -150000, 0.05, 0, 99999].map((x) => shown(x, 3))") == [
        "1.87e-5", "-1.5e5", "0.05", "0", "1e5"
    ]  # fmt: skip


@pytest.mark.needs("chromium")
@pytest.mark.slow
def test_arrows_the_branch_and_steps_of_one_size_are_chosen(opened: Browser) -> None:
    assert opened.evaluate("[...get('trace').options].at(-1).textContent") == "rod.tip"
    opened.evaluate("get('arrows').value = 'both'")
    opened.wait_for("page.picture.arrows.every((one) => one.count > 0)")
    assert "longest arrow" in opened.evaluate("get('scale').textContent")
    opened.click("#play")
    opened.evaluate("get('branch').value = 1; get('branch').onchange()")
    assert opened.evaluate("get('branch').offsetWidth > 0 && page.frames[0].x[2] < 0")
    opened.evaluate("get('method').value = 2; get('method').onchange(); get('size').value = 0; get('size').onchange()")
    assert "must be a finite positive number" in opened.evaluate("get('message').textContent")
    opened.click("#play")
    opened.wait_for("page.frames.length > 5")
    assert opened.evaluate(RESIDUAL) < CLOSED


@pytest.mark.needs("chromium")
@pytest.mark.slow
def test_a_lost_picture_comes_back_and_the_view_holds_what_is_shown(opened: Browser) -> None:
    opened.click("#play")
    opened.evaluate("window.gone = page.picture.gl.getExtension('WEBGL_lose_context'); gone.loseContext()")
    opened.wait_for("get('message').textContent.includes('picture')")
    opened.evaluate("gone.restoreContext()")
    opened.wait_for("!get('message').textContent && page.picture.poses !== undefined")
    assert len(np.unique(opened.picture().reshape(-1, 3) // 32, axis=0)) > 8
    before = opened.evaluate("page.picture.high[0] - page.picture.low[0]")
    assert put_in(opened, "l (", 3.0) == ""
    opened.wait_for(f"page.picture.high[0] - page.picture.low[0] > 2 + {before}")
    put_in(opened, "l (", 0.35)
    opened.evaluate("new Promise(requestAnimationFrame)")
    opened.evaluate("document.onkeydown({ target: {}, key: '0', preventDefault() {} })")
    assert opened.evaluate("page.picture.high[0] - page.picture.low[0]") < 1.5 * before


@pytest.mark.needs("chromium")
@pytest.mark.slow
def test_a_page_plays_steps_and_fits_a_telephone(page: Path, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile", size=(400, 760)) as browser:
        browser.open(page.as_uri())
        browser.wait_for("window.page !== undefined && page.frames.length > 5")
        pixels = browser.picture()
        assert len(np.unique(pixels.reshape(-1, 3) // 32, axis=0)) > 8  # links of several colours
        assert browser.evaluate("document.documentElement.scrollWidth") <= 400
        browser.click("#play")
        here = browser.evaluate("page.cursor")
        browser.click("#back")
        assert browser.evaluate("page.cursor") == here - 1
        browser.click("#reset")
        assert browser.evaluate("page.frames[page.cursor].t") == 0
        assert (browser.complaints, browser.requests) == ([], [])


@pytest.mark.needs("chromium")
@pytest.mark.slow
def test_a_film_has_a_side_panel_only_for_its_curves(tmp_path: Path) -> None:
    run = slider_crank().simulate(0.2)
    with Browser(tmp_path / "profile") as browser:
        for plot, empty in (("theta", False), ((), True)):
            browser.open(run.animate(tmp_path / f"{empty}.html", plot=plot).as_uri())
            browser.wait_for("window.page !== undefined && page.playing")
            assert browser.evaluate("get('side').hidden") is empty
            assert (browser.evaluate("get('stage').clientWidth") == 900) is empty


def test_names_of_other_files_are_refused(tmp_path: Path) -> None:
    for name in ("it.gif", "it.txt", "it"):
        with pytest.raises(eg.UsageError, match="must end in .html"):
            slider_crank().page(tmp_path / name)
    with pytest.raises(eg.UsageError, match="the file comes first"):
        slider_crank().page(slider_crank().simulate(0.1), "it.html")  # type: ignore[call-overload]


def test_models_that_cannot_run_in_a_page_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "hard.yaml").write_text(BOUNCER.replace("reset: {h_dot: -e*h_dot}", "restitution: 0.8"))
    module = eg.load(tmp_path / "hard.yaml").compile(target="numpy")
    with pytest.raises(eg.ModelError, match=r"events\.ground\.restitution: a page cannot hold an impact"):
        module.page(tmp_path / "hard.html")
    assert not (tmp_path / "hard.html").exists()


@pytest.mark.needs("chromium")
@pytest.mark.thorough
@pytest.mark.parametrize("name", ["four_bar", "excavator", "stewart_platform", "double_wishbone", "satellite"])
def test_nothing_breaks_at_random_moves(name: str, tmp_path: Path) -> None:
    page = eg.load_example(name).compile(target="numpy").page(tmp_path / "it.html")
    with Browser(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.wait_for("window.page !== undefined && page.count > 2")
        for _ in range(10):
            assert browser.evaluate(AT_RANDOM.replace("RESIDUAL", RESIDUAL)) < CLOSED
        assert (browser.complaints, browser.requests) == ([], [])
