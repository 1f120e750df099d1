"""Equations given without their energy: it is refused by name rather than told to be 0, and all else goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.cli import main

TEXT = """
name: free_mass
parameters: {m: 2.0, k: 5.0}
equations:
  coordinates: [x]
  mass_matrix: [[m]]
  forcing: ["-k*x"]
  MORE
outputs: {pull: OUT}
initial: {x: 1.0}
"""


def write(folder: Path, more: str = "", out: str = "k*x") -> Path:
    path = folder / "free_mass.yaml"
    path.write_text(TEXT.replace("MORE", more).replace("OUT", out))
    return path


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_an_energy_that_is_not_known_is_refused(target: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"optimize": 0} if target == "cython" else {}
    module = eg.load(write(tmp_path)).compile(target=target, **options)
    with pytest.raises(eg.UsageError, match=r"equations\.kinetic_energy, and equations\.potential_energy"):
        module.energy(np.array([1.0, 0.0]))
    run = module.simulate((0.0, 2.0), rtol=1e-10, atol=1e-12)
    assert run["x"][-1] == pytest.approx(np.cos(2.0 * np.sqrt(2.5)), abs=1e-8)
    assert not run.has_energies
    assert not {"T", "V", "energy"} & set(run.names)
    for what in ("energies", "energy_drift"):
        with pytest.raises(eg.UsageError, match="kinetic_energy"):
            getattr(run, what)
    loaded = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    assert loaded.names == run.names
    assert not loaded.has_energies
    with pytest.raises(eg.UsageError, match="kinetic_energy"):
        _ = loaded.energies


def test_with_its_energy_it_is_kept(tmp_path: Path) -> None:
    more = "kinetic_energy: m*x_dot**2/2\n  potential_energy: k*x**2/2"
    run = eg.load(write(tmp_path, more, "total_energy")).compile(target="numpy").simulate((0.0, 2.0), rtol=1e-10)
    assert run.has_energies
    assert run["energy"] == pytest.approx(2.5, rel=1e-6)
    assert run["pull"] == pytest.approx(2.5, rel=1e-6)


@pytest.mark.parametrize("name", ["kinetic_energy", "potential_energy", "total_energy"])
def test_an_output_of_it_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(
        eg.ModelError, match=rf"yaml:9: outputs.pull: {name} is not known, because .*equations.kinetic_energy"
    ):
        eg.load(write(tmp_path, out=name)).check()


def test_the_command_line_copes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["run", str(write(tmp_path)), "--end", "0.5", "--target", "numpy"]
    assert call(given) == 0
    assert "not known: the equations have no kinetic_energy" in capsys.readouterr().out
    assert call([*given, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["energy"] is None


def call(arguments: list[str]) -> Any:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    return caught.value.code
