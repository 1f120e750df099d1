"""The comparison at the end of the worked solution: it knows every formula, and a wrong one is found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import eomgen as eg
from eomgen.explain.document import Table
from eomgen.reading.writes_quantities import WritesQuantities

EXAMPLES = Path(__file__).parents[2] / "examples"
EVERY = {"T", "V", "mass_matrix", "force", "velocities[rod]", "accelerations[rod]", "poses[rod]", "generalized_forces"}
EVERY |= {"constraints", "gamma", "velocity_transformation", "velocities", "masses and inertias"}
OF_METHODS = {
    "embedding": {"body_velocity_transformation", "body_mass_matrix", "quadratic_velocity"},
    "lagrange": {"derivatives of energies"},
    "recursive": {"velocities of links"},
    "augmented": {"block_system"},
    "newton_euler": {"free_bodies[rod]", "joint_forces[A]", "block_system"},
    "amalgamated": {"free_bodies[rod]", "joint_forces[A]", "block_system"},
    "gibbs_appell": {"gibbs_function"},
    "hamilton": {"momenta", "hamiltonian", "momentum_rates"},
}


def compared(method: str) -> dict[str, float]:
    """Formula -> its difference, as the last table says."""
    document = eg.load(EXAMPLES / "slider_crank.yaml").derive(method).explain()
    (table,) = (piece for piece in document.sections[-1].pieces if isinstance(piece, Table))
    return {name.strip("`"): float(value) for name, value in table.rows}


@pytest.mark.parametrize("method", OF_METHODS)
def test_every_formula_is_compared(method: str) -> None:
    found = compared(method)
    assert EVERY | OF_METHODS[method] <= set(found)
    assert max(found.values()) <= 1e-10


@pytest.mark.parametrize(
    ("method", "wrong", "key"),
    [
        ("embedding", "velocities.rod", "velocities"),
        ("embedding", "accelerations.rod", "accelerations[rod]"),
        ("newton_euler", "free_bodies.rod", "free_bodies[rod]"),
        ("augmented", "block_system", "block_system"),
        ("gibbs_appell", "gibbs_function", "gibbs_function"),
        ("hamilton", "hamiltonian", "hamiltonian"),
    ],
)
def test_a_wrong_formula_is_found(method: str, wrong: str, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    write = WritesQuantities._write

    def slip(self: Any, name: str, *args: Any) -> list[Any]:
        flat = write(self, name, *args)
        if name == wrong:
            k = max(range(len(flat)), key=lambda i: len(str(flat[i])))
            flat[k] = flat[k] * 1.01
        return flat

    monkeypatch.setattr(WritesQuantities, "_write", slip)
    assert compared(method)[key] > 1e-7
