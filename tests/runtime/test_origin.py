"""Results say where they come from, and the same run gives the same bytes."""

from __future__ import annotations

import json
import platform
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.describe.digest import model_digest
from eomgen.runtime.identity import digest

CRANK = files("eomgen.examples") / "slider_crank.yaml"


def pendulum(length: Any = 1.0, doc: str = "", reverse: bool = False) -> eg.Model:
    m = eg.Model("p", gravity=(0, -9.81, 0))
    l = m.parameter("l", 1.0, doc=doc)
    body = m.body("b", mass=1.0, com=(l * length, 0, 0), inertia={"zz": l**2 + length if reverse else length + l**2})
    m.revolute("J", m.ground, body, coordinate="theta")
    return m


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_run_and_its_file_say_where_they_come_from(target: str, tmp_path: Path) -> None:
    module = eg.load(CRANK).compile(target=target)
    inputs = {"tau": ([0.0, 1.0], [0.0, 0.1])}
    run, again = (module.simulate(0.2, parameters={"r": 0.11}, inputs=inputs, rtol=1e-6) for _ in range(2))
    facts = eg.load_trajectory(run.save(tmp_path / "a.npz")).metadata
    assert facts == json.loads(json.dumps(run.metadata))
    assert facts["origin"]["model_digest"] == model_digest(eg.load(CRANK).mechanism())
    assert facts["origin"]["target"] == target
    versions = facts["origin"]["versions"]
    assert (versions["eomgen"], versions["python"]) == (eg.__version__, platform.python_version())
    assert versions["numpy"] == np.__version__
    assert (versions["compiler"] is None) == (target == "numpy")
    assert facts["parameters"]["r"] == 0.11
    assert facts["options"]["rtol"] == 1e-6
    assert facts["inputs"]["tau"] == {
        "interpolation": "linear", "corners": True, "times": [0.0, 1.0], "values": [0.0, 0.1],
    }  # fmt: skip
    assert again.save(tmp_path / "b.npz").read_bytes() == (tmp_path / "a.npz").read_bytes()
    many = module.simulate_many(0.1, {"theta": [0.1, 0.2]}, inputs=inputs)
    with np.load(many.save(tmp_path / "many.npz")) as data:
        header = json.loads(str(data["header"]))
    assert header == json.loads(json.dumps(many.metadata))
    assert header["origin"] == facts["origin"]
    assert header["inputs"] == facts["inputs"]
    assert header["count"] == 2


def test_inputs_are_kept_as_they_were_given() -> None:
    module = eg.load(CRANK).compile(target="numpy")

    def drive(t: float, x: Any) -> float:
        return 0.01 * np.sin(t)

    for given, kept in ((0.5, 0.5), ("0.1*sin(t)", "0.1*sin(t)")):
        assert module.simulate(0.01, inputs={"tau": given}).metadata["inputs"]["tau"] == kept
    found = module.simulate(0.01, inputs={"tau": drive}).metadata["inputs"]["tau"]
    assert found == {"function": f"{__name__}.{drive.__qualname__}", "sha256": digest(drive)}
    long = np.linspace(0, 1, 2000)
    found = module.simulate(0.01, inputs={"tau": eg.Signal(long, 0 * long, "cubic")}).metadata["inputs"]["tau"]
    assert (found["points"], found["interpolation"]) == (2000, "cubic")


def test_the_digest_is_of_what_is_computed() -> None:
    one = model_digest(pendulum().mechanism())
    assert one == model_digest(pendulum(doc="another text").mechanism())
    assert one == model_digest(pendulum(reverse=True).mechanism())
    assert one != model_digest(pendulum(1.1).mechanism())
    looked_at = pendulum().derive()
    _ = looked_at.mass_matrix
    assert looked_at.compile(target="numpy").metadata["model_digest"] == one
    assert pendulum().compile(target="numpy", method="recursive").metadata["model_digest"] == one


def test_functions_are_known_by_what_they_do() -> None:
    def made(size: float) -> Any:
        return lambda t, x: size * t

    assert digest(made(1.0)) == digest(made(1.0)) != digest(made(2.0))
    assert digest(lambda t, x: t) != digest(lambda t, x: -t)
    assert digest([1, 2.0, "a", None, {"b": np.ones(2)}]) == digest((1, 2.0, "a", None, {"b": np.ones(2)}))
    loop: list[Any] = []
    loop.append(loop)
    assert len(digest(loop)) == 64
