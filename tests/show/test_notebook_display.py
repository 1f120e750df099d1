"""What a notebook shows: in a real kernel, every result has a picture; progress and short tracebacks are there too."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from kernels import executed
from PIL import Image

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


def pictures(html: str) -> list[Any]:
    """Images in a text, opened."""
    found = re.findall(r"src='data:image/(?:png|gif);base64,([^']+)'", html)
    return [Image.open(io.BytesIO(base64.b64decode(one))) for one in found]


def colours(image: Any) -> int:
    return len(np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0))


@pytest.fixture(scope="module")
def model() -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml")


@pytest.fixture(scope="module")
def module(model: Any) -> Any:
    return model.compile(target="numpy")


def test_model_module_report_and_run_show_themselves(model: Any, module: Any) -> None:
    run = module.simulate(0.3)
    motion = module.kinematic_analysis(theta=np.linspace(0.0, 1.0, 5))
    for one in (model, module, model.check(), run, motion):
        (image,) = pictures(one._repr_html_())
        assert colours(image) > 50
    assert "rhs(t, x)" in module._repr_html_()
    assert "<td>6</td>" in module._repr_html_()  # six states
    assert "0 .. 0.3 s" in run._repr_html_()
    assert "markers pin; display cylinder<" in eg.load(EXAMPLES / "engine.yaml")._repr_html_()


def test_an_ensemble_shows_its_columns_and_its_failures(module: Any) -> None:
    many = module.simulate_many(0.2, parameters={"r": [0.08, 0.1, 0.12]}, t_eval=[0.0, 0.1, 0.2])
    html = many._repr_html_()
    (image,) = pictures(html)
    assert colours(image) > 20
    assert f"<td>{np.mean(many['theta'][-1]):.5g}</td>" in html


def test_modes_swing() -> None:
    modes = eg.load(EXAMPLES / "double_pendulum.yaml").compile(target="numpy").modes()
    (image,) = pictures(modes._repr_html_())
    assert image.n_frames == 24
    frames = []
    for k in (0, 6):
        image.seek(k)
        frames.append(np.asarray(image.convert("RGB")))
    assert (frames[0] != frames[1]).any(axis=2).mean() > 0.01
    assert "e-2" not in re.sub(r"base64,[^']+", "", modes._repr_html_())  # no rounding noise as numbers


def test_a_mode_keeps_its_loops_closed(tmp_path: Path) -> None:
    from eomgen.show.mode_shapes import swing

    m = eg.load(EXAMPLES / "four_bar.yaml")
    mod = m.compile(target="numpy")
    x = mod.x0()
    B = mod.kinematics([x[0] + 1e-6])[0] - mod.kinematics([x[0]])[0]
    states = swing(mod, np.concatenate([x[: mod.n_q], np.zeros(mod.n_v)]), B / 1e-6, 16)
    assert np.abs(mod.constraints.every(states[: mod.n_q])).max() < 1e-9
    assert np.ptp(states[0]) > 0.1


def test_a_picture_that_cannot_be_is_told(monkeypatch: pytest.MonkeyPatch, model: Any) -> None:
    m = eg.Model("open")
    body = m.body("rod", mass="m")
    m.parameter("m")
    m.revolute("hinge", m.ground, body)
    html = m._repr_html_()
    assert "no picture" in html
    assert "parameters.m" in html
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    assert "needs matplotlib: pip install" in model.compile(target="numpy").simulate(0.1)._repr_html_()


def test_a_kernel_shows_progress_pictures_and_short_tracebacks(tmp_path: Path) -> None:
    cells = [
        f"import eomgen as eg\nmod = eg.load({str(EXAMPLES / 'pendulum.yaml')!r}).compile(target='numpy')\nmod",
        "traj = mod.simulate(20.0, progress=True, rtol=1e-9)",
        "traj.plot();",
        "eg.load({!r}).check().draw();".format(str(EXAMPLES / "four_bar.yaml")),
        "traj.animate(plot='theta')",
        "def mine():\n    return mod.simulate(1.0, initial={'thet': 3})\nmine()",
        "import sys\n'eomgen.show' in sys.modules",
    ]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in cells])
    notebook.cells[5].metadata.tags = ["raises-exception"]
    nbformat.write(notebook, tmp_path / "given.ipynb")
    (tmp_path / "done").mkdir()
    outputs = [cell.outputs for cell in executed(tmp_path / "given.ipynb", tmp_path / "done", raw=True).cells]
    assert "base64" in outputs[0][0].data["text/html"]
    (bar,) = outputs[1]  # what was shown of the progress, at its end: nothing
    assert bar.data["text/html"] == ""
    for shown in outputs[2:4]:
        assert any("image/png" in one.get("data", {}) for one in shown)
    assert outputs[4][0].data["text/html"].startswith("<iframe")
    (error,) = outputs[5]
    text = "\n".join(error.traceback)
    assert "line 2, in mine" in text
    assert "did you mean theta" in text
    assert "eomgen/" not in text
    assert len(error.traceback) < 9
