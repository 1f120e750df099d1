"""Types that a checker sees in a user's file, outside the package: results are named classes, not Any."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tools.stubs import write

ROOT = Path(__file__).parents[2]

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
    "mod.bind({'l': 0.5})": "Module",
    "m.compile(target='numpy', optimize=2)": "Module",
    "eg.load_example('slider_crank')": "Model",
    "m.draw(theta=0.3)": "Axes",
    "mod.draw({'theta': 0.3}, axes=True)": "Axes",
    "mod.draw_branches(theta=0.3)": "ndarray",
    "mod.page()": "InlinePage",
    "m.check().draw()": "Axes",
    "mod.simulate(1.0).plot('theta')": "Axes",
    "mod.simulate(1.0).plot('theta', kind='spectrum')": "Axes",
    "mod.simulate(1.0).plot('theta', ax=ax)": "Axes",
    "mod.simulate(1.0).animate('run.gif', fps=10, trace='rod')": "Path",
    "mod.simulate(1.0).animate(plot=['theta'])": "InlinePage",
    "mod.simulate(1.0).animate(format='gif')": "InlineFilm",
    "mod.simulate_many(1.0, rtol='1e-6').plot('theta')": "Axes",
    "mod.simulate('2*pi', rtol='1e-6', atol='1e-9', max_step='0.1', p={'l': 0.5})": "Trajectory",
    "mod.sensitivities(['l'], 1.0, rtol='1e-8')": "Sensitivities",
}
#: What may be several things, as a checker writes it.
UNIONS = {
    "mod.simulate(1.0).plot()": ("Axes", "ndarray"),
    "mod.simulate(1.0).plot('a', 'b')": ("Axes", "ndarray"),
}
BEGIN = """import eomgen as eg
import matplotlib.pyplot as plt
m = eg.Model("pendulum", gravity=(0, -9.81, 0))
rod = m.body("rod", mass=1, com=(0, -0.5, 0), inertia={"zz": 0.1})
mod = m.compile()
ax = plt.figure().add_subplot()
"""
#: A wrong line of a user's file -> what a checker says of it.
WRONG = {
    "mod.simulate(1.0).qq": '"Trajectory" has no attribute "qq"',
    "m.revolute('hinge', m.ground)": 'Missing positional argument "successor"',
    "mod.x0(theta=object())": "incompatible type",
    "mod.simulat(1.0)": 'Module has no attribute "simulat"; maybe "simulate"?',
    "mod.simulate(foo=1)": 'Unexpected keyword argument "foo"',
    "mod.simulate(1.0, rtol=object())": "incompatible type",
    "mod.simulate_many(1.0, foo=1)": 'Unexpected keyword argument "foo"',
    "m.hinge('A', m.ground, rod)": '"Model" has no attribute "hinge"',
    "m.gravty = (0, 0, 0)": '"Model" has no attribute "gravty"',
    "m.derive().mass_matrx": '"Equations" has no attribute "mass_matrx"',
    "m.compile(optimise=2)": 'Unexpected keyword argument "optimise"',
    "eg.load('robot.urdf', limit='off')": 'Unexpected keyword argument "limit"',
    "mod.draw(theta=[1])": "incompatible type",
    "mod.simulate(1.0).plot('theta').plott()": '"Axes" has no attribute "plott"',
    "mod.simulate(1.0).animate('run.gif', fsp=10)": 'Unexpected keyword argument "fsp"',
    "mod.simulate(1.0).animate(format='gfi')": "No overload variant",
}


def check(tmp_path: Path, text: str) -> list[str]:
    """Lines that mypy prints of a user's file, with what a wheel holds beside it."""
    write()
    site = tmp_path / "site"
    shutil.copytree(ROOT / "eomgen", site / "eomgen", ignore=shutil.ignore_patterns("__pycache__", "built"))
    (tmp_path / "mine.py").write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file=", "mine.py"]
    done = subprocess.run(
        command, cwd=tmp_path, env={"MYPYPATH": str(site), "PATH": ""}, capture_output=True, text=True
    )
    return (done.stdout + done.stderr).splitlines()


@pytest.mark.slow
@pytest.mark.thorough
def test_a_checker_names_results_and_finds_slips(tmp_path: Path) -> None:
    first = BEGIN.count("\n") + len(SEEN) + len(UNIONS) + 1
    text = BEGIN + "".join(f"reveal_type({expression})\n" for expression in (*SEEN, *UNIONS))
    lines = check(tmp_path, text + "".join(f"{line}\n" for line in WRONG))
    seen = [line.partition('Revealed type is "')[2] for line in lines if "Revealed type is" in line]
    names = [re.match(r"(?:builtins\.)?(?:[\w.]+\.)?(\w+)", one) for one in seen]
    assert dict(zip(SEEN, (name[1] if name else "" for name in names), strict=False)) == SEEN, lines
    for several, one in zip(UNIONS.values(), seen[len(SEEN) :], strict=True):
        assert all(re.search(rf"\b{name}\b", one) for name in several), one
        assert "Any" not in one.replace("tuple[Any, ...]", "").replace("dtype[Any]", ""), one
    errors: dict[int, str] = {}
    for line in lines:
        if found := re.match(r"mine\.py:(\d+): error: (.*)", line):
            errors.setdefault(int(found[1]), found[2])
    assert sorted(errors) == list(range(first, first + len(WRONG))), lines
    for (wrong, expected), said in zip(WRONG.items(), (errors[k] for k in sorted(errors)), strict=True):
        assert expected in said, wrong
