"""Words of other programs: each is answered by a name that there is, in the place where it is written."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import command
import pytest
from refusals import refused, refuses

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def held() -> dict[str, Any]:
    equations = eg.load(EXAMPLES / "pendulum.yaml").derive()
    module = equations.compile(target="numpy")
    return {
        "eomgen": eg,
        "Model": eg.Model("m"),
        "Module": module,
        "Trajectory": module.simulate(0.1),
        "Equations": equations,
    }


@pytest.mark.quick
@pytest.mark.parametrize(
    ("kind", "word", "meant"),
    [
        ("Model", "hinge", "revolute"), ("Model", "PinJoint", "revolute"), ("Model", "pivot", "revolute"),
        ("Model", "piston", "prismatic"), ("Model", "ram", "prismatic"), ("Model", "telescope", "prismatic"),
        ("Model", "PrismaticJoint", "prismatic"), ("Model", "glue", "weld"), ("Model", "fixed_joint", "weld"),
        ("Model", "gimbal", "spherical"), ("Model", "BallJoint", "spherical"), ("Model", "add_body", "body"),
        ("Model", "RigidBody", "body"), ("Model", "Particle", "body"), ("Model", "add_spring", "spring"),
        ("Model", "shock_absorber", "damper"), ("Model", "hindge", "revolute"), ("Model", "freejoint", "free"),
        ("Model", "simulate", "compile"), ("Model", "sensor", "output"), ("Model", "hard_stop", "stop"),
        ("Module", "run", "simulate"), ("Module", "solve", "simulate"), ("Module", "mass", "mass_matrix"),
        ("Module", "rnea", "inverse_dynamics"), ("Module", "crba", "mass_matrix"), ("Module", "nle", "bias"),
        ("Module", "aba", "rhs"), ("Module", "forward_kinematics", "poses"), ("Module", "ik", "assemble"),
        ("Module", "natural_frequencies", "modes"), ("Module", "steady_state", "equilibrium"), ("Module", "nq", "n_q"),
        ("Module", "monte_carlo", "simulate_many"), ("Module", "render", "draw"), ("Module", "integrte", "simulate"),
        ("Trajectory", "time", "t"), ("Trajectory", "y", "x"), ("Trajectory", "movie", "animate"),
        ("Trajectory", "df", "to_pandas"), ("Trajectory", "positions", "q"), ("Trajectory", "show", "plot"),
        ("Trajectory", "export", "save"), ("Trajectory", "sample", "at"), ("Trajectory", "energy", "energies"),
        ("Equations", "M", "mass_matrix"), ("Equations", "L", "lagrangian"), ("Equations", "forcing", "force"),
        ("Equations", "latex", "explain"), ("eomgen", "modle", "Model"), ("Equations", "simulate", "compile"),
    ],
)  # fmt: skip
def test_names_of_other_programs_in_python(held: dict[str, Any], kind: str, word: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=rf"has no attribute '{word}'; did you mean '?{meant}\b"):
        getattr(held[kind], word)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("links: {a: {mass: 1}}", "bodies"), ("sensors: {a: t}", "outputs"), ("constants: {a: 1}", "parameters"),
        ("actuators: {}", "forces"), ("ic: {}", "initial"), ("bodies: {a: {weight: 1}}", "mass"),
        ("bodies: {a: {mass: 1, cog: [0, 0, 0]}}", "com"), ("bodies: {a: {mass: 1, geometry: []}}", "display"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: hinge, between: [ground, a]}}", "revolute"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: piston, between: [ground, a]}}", "prismatic"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolute, parent: [ground, a]}}", "between"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolute, between: [world, a]}}", "ground"),
        ("bodies: {a: {mass: 1}}\nforces: {f: {type: dashpot, between: [ground, a]}}", "damper"),
        ("bodies: {a: {mass: 1}}\nforces: {f: {type: spring, between: [ground, a], spring_constant: 3}}", "stiffness"),
        ("simulation: {t_end: 3}", "end"), ("simulation: {tol: 3}", "rtol"),
    ],
)  # fmt: skip
def test_names_of_other_programs_in_a_file(tmp_path: Path, text: str, meant: str) -> None:
    (tmp_path / "model.yaml").write_text(f"name: m\n{text}\n")
    code = "EG-CHOICE" if re.search("type: (hinge|piston|dashpot)", text) else "EG-NAME-UNKNOWN"
    refuses(f"{code} '{meant}'?", lambda: eg.load(tmp_path / "model.yaml").check())


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["simulate"], "run"), (["simulat"], "run"), (["movie"], "view"), (["sweep"], "ensemble"), (["eig"], "modes"),
        (["codegen"], "generate"), (["gallery"], "examples"), (["import"], "convert"), (["test"], "verify"),
        (["run", "m.yaml", "--time", "3"], "--end"), (["run", "m.yaml", "--params", "l=1"], "--set"),
        (["run", "m.yaml", "--movie", "a.gif"], "--animate"), (["run", "m.yaml", "--dt", "1"], "--step"),
        (["run", "m.yaml", "--output", "a"], "--out"), (["run", "m.yaml", "--tolerance", "1"], "--rtol"),
    ],
)  # fmt: skip
def test_names_of_other_programs_on_the_command_line(words: list[str], meant: str) -> None:
    done = command.run(*words)
    assert done.code == 2
    assert f"id you mean {meant}" in done.err.replace("'", "")


@pytest.mark.parametrize(("word", "meant"), [("x0", "initial"), ("tol", "rtol"), ("teval", "t_eval")])
def test_an_argument_of_a_run(held: dict[str, Any], word: str, meant: str) -> None:
    refuses(f"EG-NAME-UNKNOWN '{word}' {meant}?", lambda: held["Module"].simulate((0, 1), **{word: 1.0}))


def test_the_normal_force_of_a_contact_is_its_force() -> None:
    m = eg.Model("m")
    m.prismatic("s", m.ground, m.body("ball", mass=1.0), axis="y")
    m.output("N", "normal(floor)")
    refuses("EG-EXPRESSION outputs.N.expression normal 'force'?", m.check)


def test_the_name_that_is_written_alike_comes_first() -> None:
    """Letters before synonyms, among the names that there are; nothing where none is near."""
    words = {"thetta": "theta", "Theta": "theta", "hinge": "hinges", "zzzzz": ""}
    for word, meant in words.items():
        m = eg.Model("m")
        for name in ("theta", "phi", "hinges"):
            m.parameter(name, 1.0)
        m.prismatic("s", m.ground, m.body("a", mass=word))
        with refused(f"EG-NAME-UNKNOWN bodies.a.mass: '{word}'" + f" '{meant}'?" * bool(meant)) as caught:
            m.check()
        assert ("did you mean" in str(caught.value)) == bool(meant)


@pytest.mark.parametrize(
    "line",
    [
        "m.hinge('A', m.ground, rod)",
        "m.gravty = (0, 0, 1)",
        "mod.simulat(1.0)",
        "run.tt",
        "equations.mass_matrx",
        "eg.Modle",
    ],
)
def test_a_notebook_shows_the_line_of_the_user_and_no_other(held: dict[str, Any], line: str) -> None:
    """Through IPython's own shell: the cell, its line and the message, and nothing of eomgen's files."""
    from IPython.core.interactiveshell import InteractiveShell
    from IPython.utils.capture import capture_output

    shell = InteractiveShell()
    names = {"m": held["Model"], "mod": held["Module"], "run": held["Trajectory"], "equations": held["Equations"]}
    shell.user_ns.update(names, eg=eg, rod=None)
    with capture_output() as captured:
        result = shell.run_cell(f"def mine():\n    {line}\nmine()", store_history=True)
    InteractiveShell.clear_instance()
    assert isinstance(result.error_in_exec, AttributeError)
    text = captured.stdout + captured.stderr
    assert "in mine" in text
    assert line in text
    assert "did you mean" in text
    assert "near_names" not in text
    assert "builder.py" not in text
    assert len(text.splitlines()) <= 8
