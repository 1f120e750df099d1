"""Batches of states in vectors and ensembles: compiled when first needed, to the same bits, and done without."""

import pickle
import re
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
from children import HANGS
from command import run

import eomgen as eg

OTHER = """
import pickle, sys
import numpy as np
module, x = pickle.load(open(sys.argv[1], 'rb')), np.load(sys.argv[2])
np.save(sys.argv[3], module.rhs(0.0, x) if len(x[0]) > 100 else module.simulate_many(0.3, x, rtol=1e-8).x)
"""


@pytest.fixture
def named(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., eg.Model]:
    """A model whose code no other function has."""

    def make(name: str = "two_link_manipulator") -> eg.Model:
        own = request.node.originalname
        text = (models.EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8")
        (tmp_path / "named.yaml").write_text(re.sub("^name: .*", f"name: {own}", text, flags=re.MULTILINE))
        return eg.load(tmp_path / "named.yaml")

    return make


def states(k: int, n: int = 4) -> np.ndarray:
    return np.random.default_rng(k).uniform(-3.0, 3.0, (n, k))


def kinds(model: eg.Model) -> list[str]:
    """What the cache holds of a model."""
    entries = run("cache", "list", "--json").json["entries"]
    return sorted(entry["kind"] for entry in entries if entry["name"] == model.name)


def test_a_batch_brings_the_lanes_and_the_bits_stay(named: Callable[..., eg.Model]) -> None:
    model = named()
    module, x = model.compile(optimize=0), states(5000)
    few = module.rhs(0.0, x[:, :100])
    module.simulate(0.1)
    assert kinds(model) == ["model"]
    mass = module.mass_matrix(x[:2])
    assert kinds(model) == ["lanes", "model"]
    np.testing.assert_array_equal(module.rhs(0.0, x)[:, :100], few)
    heavy = module.bind({"m2": 3.0})
    np.testing.assert_array_equal(heavy.mass_matrix(x[:2])[..., 7], heavy.mass_matrix(x[:2, 7]))
    np.testing.assert_array_equal(model.compile(lanes=2, optimize=0).mass_matrix(x[:2]), mass)


@pytest.mark.parametrize("name", ["slider_crank", pytest.param("gait_leg", marks=pytest.mark.thorough)])
def test_every_column_has_the_bits_of_a_single_call(name: str) -> None:
    """With parameters, times and inputs of their own, whatever the neighbours hold: some that fail among them."""
    module, rng = compiled(name, "cython"), np.random.default_rng(1)
    start = module.x0()
    x = start[:, None] + 0.01 * rng.normal(size=(module.n_x, 4500))
    t, u = rng.uniform(0.0, 1.0, 4500), rng.normal(size=(module.n_u, 4500))
    found = module.rhs(t, x, u=u)
    for k in (0, 1, 7, 2048, 4499):
        np.testing.assert_array_equal(found[:, k], module.rhs(t[k], x[:, k].copy(), u=u[:, k]))
    if name == "slider_crank":
        x[2, 1000] = 50.0  # cannot be closed
        with pytest.raises(eg.ProjectionError):
            module.rhs(t, x, u=u)


def test_an_ensemble_is_compiled_when_it_is_requested(named: Callable[..., eg.Model], tmp_path: Path) -> None:
    """Processes and threads that need it at once wait for one build, and all have the same numbers."""
    model, x = named(), 0.3 * states(20)
    module = model.compile(optimize=0)
    (tmp_path / "module").write_bytes(pickle.dumps(module))
    np.save(tmp_path / "x.npy", x)
    command = [sys.executable, "-c", OTHER, str(tmp_path / "module"), str(tmp_path / "x.npy")]
    others = [subprocess.Popen([*command, str(tmp_path / f"{k}.npy")]) for k in range(2)]
    found: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: found.append(module.simulate_many(0.3, x, rtol=1e-8).x)) for _ in "abc"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [other.wait(timeout=HANGS) for other in others] == [0, 0]
    for k in range(2):
        np.testing.assert_array_equal(np.load(tmp_path / f"{k}.npy"), found[0])
    assert len(found) == 3
    assert all((one == found[0]).all() for one in found)
    assert kinds(model) == ["lanes", "model"]
    alone = module.simulate(0.3, x[:, 3], rtol=1e-10).x[:, -1]
    np.testing.assert_allclose(found[0][:, 3], alone, atol=1e-6)
    # what was built needs no compiler in another process
    np.save(tmp_path / "x.npy", many := states(5000))
    command[2] = "import os; os.environ['CC'] = '/nowhere/cc'\n" + OTHER
    subprocess.run([*command[:1], "-W", "error", *command[1:], str(tmp_path / "y.npy")], check=True)
    np.testing.assert_array_equal(np.load(tmp_path / "y.npy"), module.rhs(0.0, many))


@pytest.mark.parametrize("what", ["batch", "ensemble"])
@pytest.mark.parametrize("reason", ["compiler", pytest.param("cache", marks=pytest.mark.thorough)])
def test_what_cannot_be_compiled_is_done_without(
    what: str, reason: str, named: Callable[..., eg.Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One warning, and the right numbers; each time of a build of its own, which has tried nothing yet."""
    module, x = named().compile(optimize=0, extra=[f"-DTRIED={what}_{reason}"]), 0.3 * states(5000)
    attempts = Path(run("cache", "list", "--json").json["directory"]) / "attempts"
    aside = attempts.with_name("aside")
    if reason == "compiler":
        monkeypatch.setenv("CC", "/nowhere/cc")
    else:
        attempts.rename(aside)
        attempts.write_text("in the way, as for any user a read-only folder is")
    call: Callable[[], Any] = (
        (lambda: module.rhs(0.0, x)) if what == "batch" else lambda: module.simulate_many(0.2, x[:, :3], rtol=1e-10).x
    )
    try:
        words = "CC does not work" if reason == "compiler" else "cannot be written"
        with pytest.warns(RuntimeWarning, match=rf"(?s)are computed .*{words}"):
            found = call()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            np.testing.assert_array_equal(call(), found)
    finally:
        if aside.exists():
            attempts.unlink()
            aside.rename(attempts)
    for k in range(3):
        one = x[:, k].copy()
        expected = module.rhs(0.0, one) if what == "batch" else module.simulate(0.2, one, rtol=1e-10).x[:, -1]
        np.testing.assert_allclose(found[:, k], expected, rtol=0, atol=0 if what == "batch" else 1e-8)


@pytest.mark.parametrize("native", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_tables_and_native_instructions(native: bool) -> None:
    """A module for this processor alone contracts a*b + c, in lanes and in single calls alike."""
    m = eg.Model("tabled")
    points = np.linspace(-0.1, 0.1, 21)
    force = m.table("force", points, 4000 * points + 3e5 * points**3)
    m.prismatic("s", m.ground, m.body("buffer", mass=2.0), axis="x")
    m.actuator("spring", "s", -force(m.coordinate("s")))
    x = np.random.default_rng(5).uniform(-0.15, 0.15, (2, 5000))
    plain = m.compile(optimize=0)
    found = plain.rhs(0.0, x)
    np.testing.assert_array_equal(found[:, 17], plain.rhs(0.0, x[:, 17].copy()))
    if native:
        np.testing.assert_allclose(m.compile(native=True).rhs(0.0, x), found, rtol=1e-10, atol=1e-9)
