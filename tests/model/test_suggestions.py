"""A name that is not known is answered by the nearest one, in the place where it is written."""

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
        ("Model", "revolut", "revolute"), ("Model", "PrismaticJoint", "prismatic"), ("Model", "BODY", "body"),
        ("Model", "add_spring", "spring"), ("Model", "gravty", "gravity"), ("Module", "mass_matrx", "mass_matrix"),
        ("Module", "lineraize", "linearize"), ("Module", "simulate_mny", "simulate_many"), ("Module", "X0", "x0"),
        ("Trajectory", "to_panda", "to_pandas"), ("Equations", "massmatrix", "mass_matrix"),
        ("eomgen", "modle", "Model"),
    ],
)  # fmt: skip
def test_names_in_python(held: dict[str, Any], kind: str, word: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=rf"has no attribute '{word}'; did you mean '?{meant}\b"):
        getattr(held[kind], word)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("bodys: {a: {mass: 1}}", "bodies"), ("paramters: {a: 1}", "parameters"), ("Forces: {}", "forces"),
        ("bodies: {a: {mas: 1}}", "mass"), ("bodies: {a: {mass: 1, CoM: [0, 0, 0]}}", "com"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolut, between: [ground, a]}}", "revolute"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolute, betwen: [ground, a]}}", "between"),
        ("bodies: {a: {mass: 1}}\njoints: {A: {type: revolute, between: [grond, a]}}", "ground"),
        ("bodies: {a: {mass: 1}}\nforces: {f: {type: spring, between: [ground, a], stifness: 3}}", "stiffness"),
        ("simulation: {ends: 3}", "end"), ("simulation: {rtoll: 3}", "rtol"),
    ],
)  # fmt: skip
def test_names_in_a_file(tmp_path: Path, text: str, meant: str) -> None:
    (tmp_path / "model.yaml").write_text(f"name: m\n{text}\n")
    code = "EG-CHOICE" if "revolut," in text else "EG-NAME-UNKNOWN"
    refuses(f"{code} '{meant}'?", lambda: eg.load(tmp_path / "model.yaml").check())


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["rum"], "run"), (["exmples"], "examples"), (["run", "m.yaml", "--ends", "3"], "--end"),
        (["run", "m.yaml", "--sett", "l=1"], "--set"), (["run", "m.yaml", "--OUT", "a"], "--out"),
    ],
)  # fmt: skip
def test_names_on_the_command_line(words: list[str], meant: str) -> None:
    done = command.run(*words)
    assert done.code == 2
    assert f"id you mean {meant}" in done.err.replace("'", "")


def test_a_file_is_suggested_where_its_name_without_suffix_is_alike(tmp_path: Path) -> None:
    (tmp_path / "cam.yaml").touch()
    assert "did you mean" not in command.run("check", tmp_path / "scissor.yaml").err
    assert f"did you mean {tmp_path / 'cam.yaml'}?" in command.run("check", tmp_path / "cma.yaml").err


def test_what_there_is_stands_once_for_all_names_that_are_like_none(held: dict[str, Any]) -> None:
    with refused("EG-NAME-UNKNOWN 'zzz' 'G' '?'") as caught:
        held["Module"].simulate((0, 1), parameters={"zzz": 1.0, "G": 2.0, "?": 3.0})
    first, second = str(caught.value).splitlines()
    assert first.startswith("no parameter 'zzz', '?'; there are ")
    assert second == "no parameter 'G'; did you mean g?"


@pytest.mark.parametrize(("word", "meant"), [("initial_", "initial"), ("methd", "method"), ("teval", "t_eval")])
def test_an_argument_of_a_run(held: dict[str, Any], word: str, meant: str) -> None:
    refuses(f"EG-NAME-UNKNOWN '{word}' {meant}?", lambda: held["Module"].simulate((0, 1), **{word: 1.0}))


def test_the_name_that_is_written_alike_comes_first() -> None:
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
        "m.revolut('A', m.ground, rod)",
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
