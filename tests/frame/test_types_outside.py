"""Types that a checker sees in a user's file, outside the package: results are named classes, not Any."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from .test_packaging import built  # noqa: F401  (the wheel)

#: An expression of a user's file -> the class that a checker must see.
SEEN = {
    "m": "Model",
    "rod": "BodyHandle",
    "m.revolute('hinge', m.ground, rod, coordinate='theta')": "JointHandle",
    "m.check()": "MechanismReport",
    "m.derive()": "Equations",
    "m.compile()": "Module",
    "eg.load('model.yaml')": "Model",
    "m.derive().velocities": "ByName",
    "m.derive().generalized_forces": "NamedSum",
    "m.derive().linearize().states[0]": "str",
    "m.derive().with_parameters(l=0.5)": "ReadingView",
    "m.derive().with_dynamicsymbols().free_bodies": "ByName",
    "mod.x0(theta=0.3)": "ndarray",
    "mod.rhs(0.0, mod.x0())": "ndarray",
    "mod.simulate(1.0)": "Trajectory",
    "mod.simulate(1.0)['theta']": "ndarray",
    "mod.simulate(1.0).q": "ndarray",
    "mod.simulate_many(1.0)": "Ensemble",
    "mod.linearize()": "Linearization",
    "mod.equilibrium()": "Equilibrium",
    "mod.modes()": "Modes",
}
BEGIN = """import eomgen as eg
m = eg.Model("pendulum", gravity=(0, -9.81, 0))
rod = m.body("rod", mass=1, com=(0, -0.5, 0), inertia={"zz": 0.1})
mod = m.compile()
"""
WRONG = """mod.simulate(1.0).qq
m.revolute("hinge", m.ground)
mod.x0(theta=object())
"""


@pytest.mark.slow
def test_a_checker_names_results_and_finds_slips(built: Path, tmp_path: Path) -> None:  # noqa: F811
    site = tmp_path / "site"
    with zipfile.ZipFile(next(built.glob("*.whl"))) as wheel:
        wheel.extractall(site)
    text = BEGIN + "".join(f"reveal_type({expression})\n" for expression in SEEN) + WRONG
    (tmp_path / "mine.py").write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file=", "mine.py"]
    done = subprocess.run(
        command, cwd=tmp_path, env={"MYPYPATH": str(site), "PATH": ""}, capture_output=True, text=True
    )
    seen = re.findall(r'Revealed type is "(?:builtins\.)?(?:[\w.]+\.)?(\w+)', done.stdout)
    assert dict(zip(SEEN, seen, strict=True)) == SEEN, done.stdout + done.stderr
    errors = [line.partition(": error: ")[2] for line in done.stdout.splitlines() if ": error: " in line]
    assert len(errors) == 3, done.stdout
    assert '"Trajectory" has no attribute "qq"' in errors[0]
    assert 'Missing positional argument "successor"' in errors[1]
    assert "incompatible type" in errors[2]
