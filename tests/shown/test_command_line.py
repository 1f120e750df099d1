"""The command ``eomgen``: its verbs, options and exit codes, and what goes to stdout, to stderr and into ``--json``.

0 success; 1 error in the model; 2 usage or file not found; 3 compiler or package; 4 the integration; 5 a verification.
"""

import json
import os
import re
import signal
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from subprocess import PIPE
from typing import Any

import command
import pytest
from children import HANGS, child
from models import EXAMPLES
from sweeps import COVERING, part_of

Call = Callable[..., command.Result]
CRANK, FOUR_BAR, PENDULUM = (EXAMPLES / f"{name}.yaml" for name in ("slider_crank", "four_bar", "pendulum"))
TEXT = PENDULUM.read_text(encoding="utf-8")
MODELS = sorted(EXAMPLES.glob("*.yaml"))
NUMPY = ("--target", "numpy")
VERBS = (
    *("run", "ensemble", "view", "kinematics", "check", "derive", "explain", "linearize", "modes", "equilibrium"),
    *("sensitivity", "consistent", "reactions", "inverse", "impact", "verify", "generate", "convert", "examples"),
    *("doctor", "cache"),
)


@pytest.fixture
def call(tmp_path: Path) -> Call:
    """The command in an empty folder."""
    return partial(command.run, cwd=tmp_path)


def model_file(folder: Path, text: str, name: str = "model.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def expect(result: command.Result, code: int, *said: str) -> None:
    assert result.code == code, result.err
    assert "Traceback" not in result.err
    for text in said:
        assert text in " ".join(result.err.split()), result.err


# -- help and verbs ---------------------------------------------------------------------------------------------------


@pytest.mark.quick
def test_help_and_version(call: Call) -> None:
    told = call("--help").out
    listed = re.findall(r"^  (\w+)  ", told.partition("Verbs:")[2].partition("\n\n")[0], re.M)
    assert tuple(listed) == VERBS
    assert re.fullmatch(r"eomgen \d+\.\d+\.\d+\n", call("--version").out)
    assert call("-h").out == told


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself_and_its_own_options_first(call: Call, verb: str) -> None:
    result = call(verb, "--help")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"Usage: eomgen {verb}")
    assert max(map(len, result.out.splitlines())) <= 120
    own = result.out.partition("\nOptions:\n")[2].partition("\n\n")[0]
    assert "--method" not in own
    assert own.rstrip().endswith("Show this message and exit.")


#: What is wrong on a command line -> what is said; all of it ends with 2, or the code in front.
SLIPS: list[tuple[list[Any], str]] = [
    (["chek", "x.yaml"], "did you mean check?"),
    (["check"], "Missing argument"),
    (["check", "nothing.yaml"], "nothing.yaml: no such file"),
    (["check", "pendulum.yaml"], "eomgen examples pendulum"),
    (["check", "."], "is a folder"),
    (["check", PENDULUM, "--lock", "left=abc"], "--lock left=abc"),
    (["check", PENDULUM, "--rotation", "foo"], "'--rotation'"),
    (["check", PENDULUM, "--friction", "-1"], "'--friction'"),
    (["check", CRANK, "--graph", "graph.doc"], ".svg"),
    (["run", PENDULUM, PENDULUM], "unexpected extra argument"),
    (["run", PENDULUM, "--sett", "g=1"], "--set"),
    (["run", PENDULUM, "--set", "g"], "name=value"),
    (["run", PENDULUM, "--set", "G=1"], "'G'"),
    (["run", PENDULUM, "--set", "g=one"], "'one' is not a number"),
    (["run", FOUR_BAR, "--set", "theta=5cm"], "--set theta=5cm: not a valid expression"),
    (["run", PENDULUM, "--end", "-1"], "-1"),
    (["run", PENDULUM, "--end", "soon"], "'--end'"),
    (["run", PENDULUM, "--method", "kane"], "embedding, lagrange"),
    (["run", PENDULUM, "--solver", "RK54"], "DOP853, RK45"),
    (["run", PENDULUM, "--solver", "lagrange"], "--method"),
    (["run", PENDULUM, "--solver", "RK4", "--target", "numpy"], "--step"),
    (["run", PENDULUM, "--rtol", "0"], "0"),
    (["run", PENDULUM, "--atol", "-1"], "-1"),
    (["run", PENDULUM, "--out", "/eomgen-nowhere/dir/run.npz"], "no folder /eomgen-nowhere"),
    (["run", PENDULUM, "--out", "run.xls"], ".npz"),
    (["run", PENDULUM, "--plot", "run.xyz"], ".png"),
    (["run", PENDULUM, "--columns", "theta"], "--plot"),
    (["run", PENDULUM, "--plot", "run.png", "--columns", "thet"], "did you mean theta"),
    (["derive", FOUR_BAR, "--independent", "thet"], "theta"),
    (["derive", CRANK, "--baumgarte", "3"], "not two numbers ALPHA,BETA"),
    (["derive", CRANK, "--baumgarte", "3,4"], "works with method 'augmented' only"),
    (["derive", CRANK, "--format", "fortran"], "is not one of 'latex', 'text', 'sympy'"),
    (["derive", CRANK, "--out", "x.m"], "--out needs --format"),
    (["derive", CRANK, "--format", "c", "--json"], "--json and --format exclude each other"),
    (["derive", CRANK, "--format", "c", "--out", "none/x.c"], "there is no folder"),
    (["derive", CRANK, "--format", "c", "--out", "."], "this is a folder; name a file in it"),
    (["explain", CRANK, "--level", "short", "--out", "none/x.md"], "there is no folder"),
    (["explain", CRANK, "--out", "solution.docx"], ".html"),
    (["generate", PENDULUM], "--out"),
    (["generate", PENDULUM, "--out", "x", "--target", "rust"], "cython"),
    (["generate", PENDULUM, "--out", "x", "--target", "fmu", "--wheel"], "--wheel is for target cython"),
    (["examples", "pendulun"], "did you mean pendulum?"),
    (["examples", "pendulum", "--all"], "leave out pendulum"),
    (["ensemble", CRANK], "all runs are equal"),
    (["ensemble", CRANK, "--vary", "r=1"], "--vary r=1: write NAME=LOW:HIGH"),
    (["ensemble", CRANK, "--vary", "theta=0:x"], "--vary theta=0:x: write NAME=LOW:HIGH with two numbers"),
    (["ensemble", CRANK, "--vary", "radius=1:2"], "no coordinate or rate 'radius'"),
    (["ensemble", CRANK, "--vary", "r=0.1:0.2", "--out", "a.txt"], "written as .npz, .csv or .nc"),
    (["ensemble", CRANK, "--grid", "theta=1"], "write NAME=LOW:HIGH:COUNT"),
    (["ensemble", CRANK, "--grid", "theta=0:1:2", "--vary", "r=1:2"], "leave out --cases, --vary and --count"),
    (["kinematics", FOUR_BAR, *NUMPY], "give --range: 1 degree of freedom is left, for example of theta"),
    (["kinematics", FOUR_BAR, *NUMPY, "--range", "theta"], "write NAME=START:END"),
    (["kinematics", FOUR_BAR, *NUMPY, "--range", "theta=0:1:0"], "the count must be a whole number from 1 to"),
    (["kinematics", FOUR_BAR, *NUMPY, "--range", "theta=0:1:3", "--range", "t=0:1:4"], "must be equal"),
    (["kinematics", FOUR_BAR, *NUMPY, "--range", "theta=0:1", "--range", "theta=0:2"], "each name once"),
    (["kinematics", FOUR_BAR, *NUMPY, "--range", "theta=0:1", "--out", "x.txt"], "written as .npz or .csv"),
    (["kinematics", FOUR_BAR, *NUMPY, "--range", "tt=0:1", "--range", "a9=0:1"], "did you mean t?"),
    (["view", FOUR_BAR, *NUMPY, "--range", "theta=0:zz"], "--range theta=0:zz: 'zz' is not a number"),
    (["view", FOUR_BAR, *NUMPY, "--range", "theta=0:30deg"], "not a valid expression"),
    (["view", FOUR_BAR, *NUMPY, "--range", "theta=0:1:1"], "an animation needs two positions"),
    (["view", FOUR_BAR, *NUMPY, "--range", "theta=0:1", "--end", "2"], "leave out --end"),
    (["view", FOUR_BAR, *NUMPY, "--out", "x.avi"], "must end in .gif, .mp4 or .html"),
    (["view", FOUR_BAR, *NUMPY, "--range", "thet=0:1:3", "--out", "x.gif"], "did you mean theta"),
    (["view", FOUR_BAR, *NUMPY, "--trace", "coupler.Q", "--out", "x.gif", "--end", "0.1"], "no marker or body"),
    (["equilibrium", CRANK, *NUMPY, "--hold", "theta="], "--hold theta=: write name=value"),
    (["equilibrium", CRANK, *NUMPY, "--hold", "nothing"], "no coordinate 'nothing'"),
    (["consistent", CRANK, *NUMPY, "--weight", "s"], "--weight s"),
    (["consistent", CRANK, *NUMPY, "--set", "C=1"], "a state has the names"),
    (["sensitivity", CRANK, *NUMPY, "--end", "0.1", "--by", "l9"], "l9"),
    (["sensitivity", CRANK, *NUMPY, "--end", "0.1", "--out", "by.txt"], ".csv"),
    (["reactions", CRANK, *NUMPY, "--out", "r.csv"], "--end"),
    (["inverse", CRANK, *NUMPY, "--actuated", "thet"], "did you mean theta"),
    (["impact", CRANK, *NUMPY], "give --gap NAME=RESTITUTION for a gap that closes, or --stop NAME"),
    (["impact", CRANK, *NUMPY, "--gap", "s"], "--gap s: write name=value, for example --gap s=0.5"),
    (["impact", CRANK, *NUMPY, "--gap", "s=2"], "--gap: the restitution of s must be between 0 and 1"),
    (["impact", CRANK, *NUMPY, "--stop", "q"], "--stop: no coordinate 'q'"),
    (["impact", CRANK, *NUMPY, "--gap", "s=0.5"], "(open); an impact needs a gap of 0"),
    (["impact", CRANK, *NUMPY, "--gap", "s=0.5", "--slip", "s"], "--slip: 's' is not NAME=MU:SPEED"),
]


@pytest.mark.parametrize(
    ("words", "said"), SLIPS, ids=lambda x: " ".join(map(str, x[:1])) if isinstance(x, list) else ""
)
def test_slips_end_with_2_and_say_what_to_write(call: Call, tmp_path: Path, words: list[Any], said: str) -> None:
    target = NUMPY if words[0] in ("run", "ensemble") and "--target" not in words else ()
    result = call(*words, *target)
    expect(result, 2, said)
    assert result.out == "" or "--json" in words
    assert list(tmp_path.iterdir()) == []  # nothing was made on the way


@pytest.mark.parametrize("verb", VERBS)
def test_slips_as_json(call: Call, verb: str) -> None:
    for words in ((verb, "--json", "--no-such-option"), (verb, "--no-such-option", "--json")):
        result = call(*words)
        assert result.code == 2
        error = result.json["error"]
        assert set(error) == {"type", "code", "exit_code", "message", "problems"}
        assert (error["type"], error["exit_code"], error["problems"]) == ("UsageError", 2, [])
        assert error["message"] in result.err  # people read it on stderr as without --json


# -- models at fault, compilers, integrations -------------------------------------------------------------------------


@pytest.mark.quick
def test_faults_of_a_model_are_reported_all_at_once_with_their_lines(call: Call, tmp_path: Path) -> None:
    text = TEXT.replace("type: revolute", "type: revolut").replace("mass: m,", "mass: mm,")
    file = model_file(tmp_path, text)
    result = call("check", file)
    expect(result, 1, "model.yaml:9: bodies.rod.mass: ", "model.yaml:11: joints.pivot.type: ", "revolute")
    assert result.out == ""
    told = call("run", file, "--json")
    assert told.code == 1
    assert set(told.json) == {"error"}
    assert set(told.json["error"]) == {"type", "code", "exit_code", "message", "problems"}
    problem = told.json["error"]["problems"][0]
    assert set(problem) == {"path", "message", "remedy", "file", "line", "code"}
    assert (problem["path"], problem["line"], problem["code"]) == ("bodies.rod.mass", 9, "EG-NAME-UNKNOWN")


FALLS = "name: fall\ngravity: [0, -9.81, 0]\nbodies: {b: {mass: 1}}\n"
FALLS += "joints: {s: {type: prismatic, between: [ground, b], axis: y}}\n"
PUSHED = TEXT + "forces:\n  push: {type: torque, joint: pivot, value: sqrt(0.05 - t)}\n"
OPEN = FOUR_BAR.read_text(encoding="utf-8").replace("value: 0.12", "value: 1.2")
BAD = TEXT.replace("com: [0, -l, 0]", "com: [0, 0, 0]")


@pytest.mark.parametrize(
    ("text", "words", "code", "said"),
    [
        (OPEN, ["check"], 1, "loops"),
        (OPEN, ["run", *NUMPY], 1, "loops"),
        (BAD, ["check"], 1, "model.yaml:11: joints.pivot"),
        (TEXT.replace("value: 9.81, ", ""), ["check"], 1, "model.yaml:7: parameters.g: has no value"),
        (TEXT.replace("value: 9.81, ", ""), ["derive"], 0, ""),  # needs none
        (FALLS, ["equilibrium", *NUMPY], 1, "the generalized force along s is still -9.81"),
        (PUSHED, ["run", *NUMPY], 4, "model.yaml"),
        (FOUR_BAR.read_text(), ["kinematics", *NUMPY, "--range", "psi=1.2:2.5"], 1, "stop at psi = 2.24592786"),
        (TEXT, ["check", "--lock", "left=1"], 2, "only robot files take the options lock"),
    ],
    ids=lambda x: x[0] if isinstance(x, list) else "",
)
def test_codes_of_models(call: Call, tmp_path: Path, text: str, words: list[str], code: int, said: str) -> None:
    expect(call(words[0], model_file(tmp_path, text), *words[1:]), code, said)


def test_messages_name_options_not_arguments_of_python(call: Call, tmp_path: Path) -> None:
    told = call("kinematics", FOUR_BAR, *NUMPY, "--range", "psi=1.2:2.5").err
    assert "give --partial for the part" in told
    robot = model_file(
        tmp_path,
        '<robot name="arm"><link name="base"/><link name="tip"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="tip"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>',
        "arm.urdf",
    )
    told = call("check", robot).err
    assert "--limits stop" in told
    assert "limits='stop'" not in told


def test_files_that_cannot_be_written_are_reported_before_the_work(call: Call, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "link.md").symlink_to(tmp_path / "other.md")
    for words, said in (
        (("run", PENDULUM, "--out", "file/deeper/run.npz"), "is a file, not a folder"),
        (("run", PENDULUM, "--out", "folder.npz"), "is a folder"),
        (("explain", PENDULUM, "--out", "link.md"), "is a symbolic link"),
        (("check", tmp_path / "file"), ".yaml"),
    ):
        result = call(*words)
        expect(result, 2, said)
        assert "derive" not in result.err


def test_no_compiler(call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "cache"))
    expect(call("run", PENDULUM), 3, "no-such-compiler", "pip install ziglang")
    told = call("doctor")
    assert told.code == 3
    assert "no-such-compiler" in told.out
    checks = {check["name"]: check for check in call("doctor", "--json").json["checks"]}
    assert {frozenset(check) for check in checks.values()} == {frozenset({"name", "ok", "detail", "remedy", "needed"})}
    assert {"python", "numpy", "[robots]", "[mesh]", "[plot]", "[results]", "compiler", "cache"} <= set(checks)
    assert not checks["compiler"]["ok"]
    assert checks["numpy"]["ok"]
    monkeypatch.setenv("EOMGEN_CACHE_DIR", "/proc/eomgen")  # which grants all rights to root, and takes no file
    checks = {check["name"]: check for check in call("doctor", "--json").json["checks"]}
    assert not checks["cache"]["ok"]


def test_a_library_that_is_missing_ends_as_a_compiler_that_is_missing(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    expect(call("run", PENDULUM, *NUMPY, "--end", "0.1", "--out", "run.nc"), 3, "pip install")


@pytest.mark.slow
@pytest.mark.thorough
def test_the_doctor_finds_all_well(call: Call) -> None:
    result = call("doctor", "--json")
    assert result.code == 0
    assert result.json["ok"] is True
    assert {"small model"} <= {check["name"] for check in result.json["checks"]}


@pytest.mark.thorough
def test_the_doctor_tells_what_is_installed_and_cannot_be_imported(tmp_path: Path) -> None:
    """As pint 0.24 beside a later flexparser: every run with a unit such as inch failed, and doctor was content."""
    for name in ("pint", "trimesh"):
        (tmp_path / f"{name}.py").write_text("raise TypeError('a frozen class from one that is not')")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "CC": "no-such-compiler"}
    with child(
        [sys.executable, "-m", "eomgen", "doctor", "--json"], env=environment, stdout=PIPE, text=True
    ) as process:
        told = process.communicate(timeout=HANGS)[0]
    assert process.returncode == 3
    checks = {check["name"]: check for check in json.loads(told)["checks"]}
    for name in ("pint", "[mesh]"):
        assert not checks[name]["ok"]
        assert "cannot be imported (TypeError: a frozen class from one that is not)" in checks[name]["detail"]


def test_faults_in_c_of_the_user_are_faults_of_the_model(call: Call, tmp_path: Path) -> None:
    (tmp_path / "law.c").write_text("double law(double x)\n{\n    return k*x;\n}\n")
    functions = "functions: {law: {type: native, source: law.c}}\n"
    functions += "forces: {f: {type: torque, joint: pivot, value: law(theta)}}\n"
    result = call("run", model_file(tmp_path, TEXT + functions), "--allow-native")
    expect(result, 1, "law.c:3: functions.law: the compiler says: ", "undeclared")
    assert "gcc" not in result.err


@pytest.mark.parametrize("after", part_of((0.05, 0.0, 0.01, 0.03, 0.1, 0.2, 0.4), lambda after: after == 0.05))
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_command_without_a_traceback(number: signal.Signals, after: float) -> None:
    """While it imports, reads and derives: with 130 and 143, as shells say of both signals."""
    script = (
        "import signal, sys\nfrom eomgen.cli import main\nprint('begun', flush=True)\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\nmain()\n"  # else ignored in the background
    )
    words = ["derive", str(EXAMPLES / "large" / "tracked_excavator.yaml"), "--method", "lagrange"]  # some seconds
    with child([sys.executable, "-c", script, *words], stdout=PIPE, stderr=PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(after + 0.05)
        process.send_signal(number)
        _, said = process.communicate(timeout=HANGS)
    assert process.returncode == 128 + number, said
    assert said.replace("interrupted\n", "").strip() == ""


# -- what is printed --------------------------------------------------------------------------------------------------

REPORT = {
    "name", "bodies", "joints", "tree", "loop_joints", "coordinates", "loop_coordinates", "independent", "dependent",
    "constraints", "constraints_declared", "rank", "ranks", "degrees_of_freedom", "configuration_freedoms",
    "nonholonomic", "gruebler_kutzbach", "gruebler_kutzbach_planar", "redundant", "conditioning", "length_scale",
    "reference", "assumed", "assembly_restarts", "instantaneous_freedoms", "candidates", "notes", "elements", "guessed",
    "guess_distance", "other_branches",
}  # fmt: skip
KEYS: dict[str, tuple[tuple[str, ...], set[str]]] = {
    "run": (("--end", "0.1"), {
        "name", "method", "choice", "system", "report", "operations", "seconds", "integration", "loop_residual",
        "energy", "change_points", "final", "files", "origin", "parameters", "inputs",
    }),
    "check": ((), REPORT),
    "derive": ((), {"name", "method", "choice", "system", "report", "operations", "seconds"}),
    "linearize": ((), {
        "name", "method", "t", "x", "states", "inputs", "outputs", "A", "B", "C", "D", "mass", "damping", "stiffness",
        "drift", "velocities", "positions", "equilibrium", "steady", "eigenvalues", "stability", "origin",
    }),
    "modes": ((), {
        "name", "method", "t", "coordinates", "stability", "names", "squares", "frequencies", "hertz", "shapes",
        "rigid", "diverging", "damped", "origin",
    }),
    "equilibrium": ((), {
        "name", "method", "t", "coordinates", "unknowns", "supports", "forces", "steps", "eigenvalues", "stability",
        "origin",
    }),
    "reactions": ((), {
        "name", "method", "t", "end", "joints", "components", "reactions", "undetermined", "constraints",
        "multipliers", "files", "origin",
    }),
    "inverse": ((), {
        "name", "method", "t", "forces", "accelerations", "constraints", "multipliers", "joints", "reactions", "origin",
    }),
    "impact": (("--stop", "s"), {
        "name", "method", "t", "names", "impulses", "energy_lost", "x", "rates_before", "rates_after", "constraints",
        "constraint_impulses", "origin",
    }),
    "consistent": ((), {"name", "method", "t", "x", "rough", "change", "origin"}),
    "sensitivity": (("--end", "0.05", "--by", "r,theta"), {
        "name", "method", "t", "names", "held", "steps", "final", "events", "files", "origin",
    }),
    "kinematics": (("--range", "theta=0:1:3"), {"name", "report", "seconds", "files", "motion", "limits"}),
    "ensemble": (("--vary", "r=0.1:0.11", "--count", "2", "--end", "0.05"), {
        "name", "method", "origin", "t", "count", "varied", "steps", "failures", "files", "summary",
    }),
    "view": (("--range", "theta=0:1:3", "--out", "a.gif"), {"name", "points", "files", "opened"}),
    "generate": (("--out", "made"), {"name", "target", "folder", "files"}),
}  # fmt: skip


@pytest.mark.parametrize("verb", KEYS)
def test_keys_of_json(call: Call, verb: str) -> None:
    more, keys = KEYS[verb]
    target = () if verb in ("check", "derive") else ("--target", "c") if verb == "generate" else NUMPY
    result = call(verb, CRANK, *target, "--json", *more)
    assert result.code == 0, result.err
    assert set(result.json) == keys
    assert result.json["name"] == "slider_crank"
    if "report" in keys:
        assert set(result.json["report"]) == REPORT


def test_every_line_fits_the_columns_that_are_set() -> None:
    def longest(columns: str) -> int:
        return max(map(len, command.run("check", EXAMPLES / "double_wishbone.yaml", columns=columns).out.splitlines()))

    assert longest("60") <= 62 < longest("many")
    assert longest("1") > 20  # never narrower than can be read


@pytest.mark.parametrize("path", part_of(MODELS, lambda path: path.stem in COVERING), ids=lambda path: path.stem)
def test_every_example_passes_check_and_names_its_source(call: Call, path: Path) -> None:
    result = call("check", path)
    assert (result.code, result.err) == (0, "")
    assert f"mechanism {path.stem}" in result.out
    assert "degrees of freedom" in result.out


def test_check_tells_the_freedoms_and_draws(call: Call, tmp_path: Path) -> None:
    report = call("check", CRANK, "--json").json
    assert (report["degrees_of_freedom"], report["rank"], report["loop_joints"]) == (1, 2, ["C"])
    assert (report["gruebler_kutzbach"], report["gruebler_kutzbach_planar"]) == (-2, 1)
    assert report["independent"] == ["theta"]
    result = call("check", CRANK, "--graph", "graph.svg", "--draw", "drawn.png")
    assert result.code == 0
    assert "can be independent" in result.out
    assert "<svg" in (tmp_path / "graph.svg").read_text(encoding="utf-8")
    assert (tmp_path / "drawn.png").read_bytes().startswith(b"\x89PNG")


def test_a_model_is_read_from_stdin(call: Call) -> None:
    assert "mechanism pendulum" in call("check", "-", stdin=TEXT).out
    expect(call("check", "-", stdin="name: [\n"), 1, "<stdin>")


def test_derive_writes_the_equations_in_every_form(call: Call, tmp_path: Path) -> None:
    assert "mass_matrix[0, 0] = l**2*m" in call("derive", PENDULUM, "--equations").out
    listed = re.search(r"is not one of (.*?)\.", call("derive", PENDULUM, "--format", "f").err.replace("\n", " "))
    assert listed is not None
    forms = re.findall(r"'(\w+)'", listed[1])
    assert {"latex", "text", "sympy", "c", "matlab", "octave", "julia", "mathematica"} <= set(forms)
    for form in forms:
        said = call("derive", EXAMPLES / "double_pendulum.yaml", "--format", form)
        assert said.code == 0
        assert "bend" in said.out
    said = call("derive", CRANK, "--format", "matlab", "--out", "equations.m")
    assert (said.code, said.out) == (0, "equations.m\n")
    assert (tmp_path / "equations.m").read_text(encoding="utf-8").count("function [M, f]") == 1
    sizes = call("derive", CRANK, "--method", "newton_euler", "--json").json
    assert sizes["system"] == {"unknowns": 41, "entries": 118}
    assert sizes["operations"]["linear system"]["total"] > 0


def test_explain_writes_the_worked_solution(call: Call, tmp_path: Path) -> None:
    for ending, begins in ((".html", "<!doctype html>"), (".md", "# "), (".tex", r"\documentclass")):
        said = call("explain", PENDULUM, "--out", f"solution{ending}", "--level", "short")
        assert (said.code, said.out.splitlines()[0]) == (0, f"solution{ending}")
        assert (tmp_path / f"solution{ending}").read_text(encoding="utf-8").lower().startswith(begins)
    words = ("--method", "augmented", "--baumgarte", "20,10", "--out", "held.md", "--json")
    assert call("explain", CRANK, *words).json["difference"] < 1e-10
    assert r"2 \cdot 20 \dot{\mathbf{C}} + 10^2 \mathbf{C}" in (tmp_path / "held.md").read_text(encoding="utf-8")


def test_examples_are_listed_and_copied_and_never_overwritten(call: Call, tmp_path: Path) -> None:
    listed = call("examples", "--json").json["examples"]
    assert {frozenset(entry) for entry in listed} == {frozenset({"name", "file", "doc"})}
    assert {entry["name"] for entry in listed} >= {path.stem for path in MODELS}
    lines = call("examples").out.splitlines()
    for entry in listed:  # one line each, short and with a source
        assert sum(line.split()[:1] == [entry["name"]] and entry["doc"] in line for line in lines) == 1, entry
        assert len(entry["doc"]) <= 100
        assert "(" in entry["doc"] or not entry["file"].endswith(".yaml")
    for name, file in (("pendulum", "pendulum.yaml"), ("chain.py", "chain.py")):
        assert call("examples", name).out.strip() == file
        (tmp_path / file).write_text("mine")
        assert call("examples", name).code == 2
        assert (tmp_path / file).read_text() == "mine"
        assert call("examples", name, "--force", "--json").json == {"file": file}
        assert (tmp_path / file).read_bytes() == (EXAMPLES / file).read_bytes()


@pytest.mark.slow
@pytest.mark.thorough
def test_every_example_runs(call: Call) -> None:
    told = call("examples", "--all", "--json")
    assert told.code == 0
    assert set(told.json) == {"ok", "target", "seconds", "examples"}
    for entry in told.json["examples"]:
        assert entry["ok"], entry
        assert entry["steps"] > 0 or entry["file"].endswith(".py")
