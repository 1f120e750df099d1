"""Exit codes 0 to 4, and what is printed with each: plain lines on stderr, never a traceback."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from subprocess import PIPE

import pytest
from children import child

from eomgen.cli.command import VERBS

from .conftest import EXAMPLES, Call, Result

PENDULUM = (EXAMPLES / "pendulum.yaml").read_text()
FOUR_BAR = (EXAMPLES / "four_bar.yaml").read_text()


def expect(result: Result, code: int, *said: str) -> None:
    assert result.code == code, result.err
    assert "Traceback" not in result.err
    for text in said:
        assert text in result.err


def test_model_faults_are_told_all_at_once_with_their_lines(call: Call, model_file: Callable[[str], Path]) -> None:
    text = PENDULUM.replace("type: revolute", "type: revolut").replace("mass: m,", "mass: mm,")
    result = call("check", model_file(text))
    expect(result, 1, "model.yaml:9: bodies.rod.mass: ", "model.yaml:11: joints.pivot.type: ", "revolute")
    assert result.out == ""


def test_model_faults_as_json(call: Call, model_file: Callable[[str], Path]) -> None:
    result = call("run", model_file(PENDULUM.replace("mass: m,", "mass: mm,")), "--json")
    assert result.code == 1
    assert set(result.json) == {"error"}
    assert set(result.json["error"]) == {"type", "exit_code", "message", "problems"}
    problem = result.json["error"]["problems"][0]
    assert set(problem) == {"path", "message", "remedy", "file", "line"}
    assert (problem["path"], problem["line"]) == ("bodies.rod.mass", 9)


@pytest.mark.parametrize("verb", ["check", "run"])
def test_loops_that_cannot_close(call: Call, model_file: Callable[[str], Path], verb: str) -> None:
    expect(call(verb, model_file(FOUR_BAR.replace("value: 0.12", "value: 1.2"))), 1, "model.yaml", "loops")


def test_a_coordinate_with_no_inertia(call: Call, model_file: Callable[[str], Path]) -> None:
    text = PENDULUM.replace("com: [0, -l, 0]", "com: [0, 0, 0]")
    expect(call("check", model_file(text)), 1, "model.yaml:11: joints.pivot", "no inertia")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["chek", "x.yaml"], "did you mean check?"),
        (["check"], "Missing argument"),
        (["check", "nothing.yaml"], "nothing.yaml: no such file"),
        (["check", "pendulum.yaml"], "eomgen examples pendulum"),
        (["check", "."], "is a folder"),
        (["run", EXAMPLES / "pendulum.yaml", "--sett", "g=1"], "--set"),
        (["run", EXAMPLES / "pendulum.yaml", "--set", "g"], "name=value"),
        (["run", EXAMPLES / "pendulum.yaml", "--set", "G=1"], "'G'"),
        (["run", EXAMPLES / "pendulum.yaml", "--set", "g=one"], "'one' is not a number"),
        (["run", EXAMPLES / "pendulum.yaml", "--end", "-1"], "-1"),
        (["run", EXAMPLES / "pendulum.yaml", "--method", "kane"], "embedding, lagrange"),
        (["run", EXAMPLES / "pendulum.yaml", "--solver", "RK54"], "DOP853, RK45"),
        (["run", EXAMPLES / "pendulum.yaml", "--solver", "lagrange"], "--method"),
        (["run", EXAMPLES / "pendulum.yaml", "--rtol", "0"], "0"),
        (["run", EXAMPLES / "pendulum.yaml", "--atol", "-1"], "-1"),
        (["run", EXAMPLES / "pendulum.yaml", "--out", "/eomgen-nowhere/dir/run.npz"], "no folder /eomgen-nowhere"),
        (["run", EXAMPLES / "pendulum.yaml", "--out", "run.xls"], ".npz"),
        (["run", EXAMPLES / "pendulum.yaml", "--plot", "run.xyz"], ".png"),
        (["run", EXAMPLES / "pendulum.yaml", "--plot", "run"], ".png"),
        (["derive", EXAMPLES / "four_bar.yaml", "--independent", "thet"], "theta"),
        (["generate", EXAMPLES / "pendulum.yaml"], "--out"),
        (["generate", EXAMPLES / "pendulum.yaml", "--out", "x", "--target", "rust"], "cython"),
        (["examples", "pendulun"], "did you mean pendulum?"),
    ],
    ids=lambda value: " ".join(getattr(w, "name", w) for w in value) if isinstance(value, list) else "",
)
def test_usage(call: Call, words: list[object], said: str) -> None:
    expect(call(*words), 2, said)


@pytest.mark.parametrize("option", ["--out", "--plot"])
def test_files_that_cannot_be_written_are_told_before_the_work(call: Call, tmp_path: Path, option: str) -> None:
    ending = {"--out": ".npz", "--plot": ".png"}[option]
    (tmp_path / "file").write_text("")
    result = call("run", EXAMPLES / "pendulum.yaml", option, f"file/deeper/run{ending}")
    expect(result, 2, f"{option} file/deeper/run{ending}", "is a file, not a folder")
    assert "derive" not in result.err
    (tmp_path / f"folder{ending}").mkdir()
    expect(call("run", EXAMPLES / "pendulum.yaml", option, f"folder{ending}"), 2, "is a folder")


def test_an_unknown_suffix(call: Call, tmp_path: Path) -> None:
    (tmp_path / "model.txt").write_text("name: x")
    expect(call("check", tmp_path / "model.txt"), 2, ".yaml")


def test_no_compiler(call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "cache"))
    expect(call("run", EXAMPLES / "pendulum.yaml"), 3, "no-such-compiler", "pip install ziglang")


def test_an_integration_that_fails(call: Call, model_file: Callable[[str], Path]) -> None:
    # the torque tan(t) goes to infinity at pi/2
    text = PENDULUM + "forces:\n  push: {type: torque, joint: pivot, value: 1/(1 - t)**3}\n"
    result = call("run", model_file(text))
    expect(result, 4, "model.yaml")


def test_a_locked_joint_without_a_number_is_blamed_on_lock(call: Call, model_file: Callable[[str], Path]) -> None:
    result = call("check", model_file("name: x\n"), "--lock", "left=abc")
    assert result.code == 2
    assert "--lock left=abc" in result.err
    for words in (("--rotation", "foo"), ("--mimic", "foo"), ("--friction", "-1")):
        result = call("check", model_file("name: x\n"), *words)
        assert result.code == 2
        assert f"'{words[0]}'" in result.err


def test_faults_in_c_of_the_user_are_faults_of_the_model(
    call: Call, model_file: Callable[[str], Path], tmp_path: Path
) -> None:
    (tmp_path / "law.c").write_text("double law(double x)\n{\n    return k*x;\n}\n")
    functions = "functions: {law: {type: native, source: law.c}}\n"
    functions += "forces: {f: {type: torque, joint: pivot, value: law(theta)}}\n"
    file = model_file(PENDULUM + functions)
    result = call("run", file, "--allow-native")
    expect(result, 1, "law.c:3: functions.law: the compiler says: ", "undeclared")
    assert "gcc" not in result.err
    file = model_file(
        PENDULUM + functions.replace("law.c", "law.c, arguments: 2").replace("law(theta)", "law(theta, 1)")
    )
    expect(call("check", file, "--allow-native"), 1, "functions.law.arguments: law in law.c:1 takes 1 arguments")


def test_advice_on_checkpoints_names_options_of_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from eomgen.cli.command import run_command

    (tmp_path / "p.yaml").write_text((Path(__file__).parents[2] / "examples" / "pendulum.yaml").read_text())
    words = ["run", str(tmp_path / "p.yaml"), "--target", "numpy", "--solver", "BDF", "--end", "0.1"]
    with pytest.raises(SystemExit, match="2"):
        run_command([*words, "--checkpoint", str(tmp_path / "c.npz"), "--plot", str(tmp_path / "p.png")])
    said = capsys.readouterr().err
    assert "leave --plot out, or take --solver DOP853" in said
    assert "dense_output" not in said


def test_the_doctor_tries_whether_the_cache_takes_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from eomgen.cli import verb_doctor

    monkeypatch.setenv("EOMGEN_CACHE_DIR", "/proc/eomgen")  # which grants all rights to root, and takes no file
    assert not verb_doctor._cache().ok
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "cache"))
    assert verb_doctor._cache().ok


@pytest.mark.parametrize("verb", VERBS)
def test_wrong_options_as_json(call: Call, verb: str) -> None:
    for words in ((verb, "--json", "--no-such-option"), (verb, "--no-such-option", "--json")):
        result = call(*words)
        assert result.code == 2
        error = result.json["error"]
        assert set(error) == {"type", "exit_code", "message", "problems"}
        assert (error["type"], error["exit_code"], error["problems"]) == ("UsageError", 2, [])
        assert error["message"] in result.err  # people read it on stderr as without --json


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("rum",), "no verb 'rum'"),
        (("run",), "Missing argument 'MODEL'"),
        (("run", "model.yaml", "--end", "soon"), "'--end'"),
        (("derive", "model.yaml", "--target", "fortran"), "--target"),
        (("run", "model.yaml", "more.yaml"), "more.yaml"),
        ((), "--json"),
    ],
)
def test_other_slips_of_usage_as_json(call: Call, words: tuple[str, ...], message: str) -> None:
    result = call(*words, "--json")
    assert result.code == 2
    assert message in result.json["error"]["message"]
    assert call(*words).out == "" or not words  # without words: help


COMMAND = """
import signal, sys
from eomgen.cli import main

class Begun:
    def find_spec(name, *_):
        if name == "eomgen.cli.command":
            print("begun", flush=True)

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
sys.meta_path.insert(0, Begun)
main()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_command_without_a_traceback(number: signal.Signals) -> None:
    """While it imports, reads and derives: with 130 and 143, as shells say of both signals."""
    words = ["derive", str(EXAMPLES / "large" / "tracked_excavator.yaml"), "--method", "lagrange"]  # some seconds
    for after in (0.0, 0.01, 0.03, 0.06, 0.1, 0.2, 0.4):
        with child([sys.executable, "-c", COMMAND, *words], stdout=PIPE, stderr=PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "begun\n"
            time.sleep(after)
            process.send_signal(number)
            _, said = process.communicate(timeout=60)
        assert process.returncode == 128 + number, (after, said)
        assert said.replace("interrupted\n", "").strip() == ""
