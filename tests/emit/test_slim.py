"""Slim packages: calls, events and runs to the last bit as in the whole, in few lines; all else refuses by name."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg
from eomgen.api.module import CALLS
from eomgen.emit.carried import _names as carried_names
from eomgen.emit.selection import NOT_REACHED
from eomgen.emit.slim import LEFT_OUT, OF_CLOCKS
from eomgen.errors import UsageError
from eomgen.generation import generate

ROOT = Path(eg.__file__).parent
#: Lines of Python, blank ones, comments and stubs included, setup.py and the numpy target's own equations apart.
MOST = {"cython": 5569, "numpy": 7017}
#: What a model without inputs over time, late initial values, states and contacts between groups needs not either.
ITS_OWN = ("runtime/tapes", "runtime/late_start", "runtime/mechanical", "simulation/meetings", *OF_CLOCKS)


def bouncing() -> eg.Model:
    """A ball on a slide with a declared input, a reset by a restitution-like rule, and a terminal event."""
    m = eg.Model("bouncing")
    m.parameter("k", 4.0)
    ball = m.body("ball", mass=1.0)
    m.prismatic("J", m.ground, ball, axis="x", coordinate="s")
    m.torque("motor", "J", m.input("u", signal="-k*s + 0.3*sin(3*t)"))
    m.torque("push", "J", m.input("f"))
    m.event("wall", "s + 0.5", direction=-1, reset={"s_dot": "-0.8*s_dot"})
    m.output("power", "u*s_dot")
    return m


CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "double_pendulum": (lambda: models.build("double_pendulum"), {}),
    "slider_crank": (lambda: models.build("slider_crank"), {"inputs": {"tau": [[0.0, 0.2, 1.0], [0.0, 1.0, -1.0]]}}),
    "bouncing": (
        bouncing,
        {"span": 3.0, "initial": {"s": 1.0, "s_dot": 0.5}, "inputs": {"f": [[0.0, 0.5, 2.0], [0.0, 0.1, 0.1]]}},
    ),
    "stewart_platform": (lambda: models.build("stewart_platform"), {}),
}

#: What both sides carry out: on the package in a process of its own, and on the module here.
COMPARED = """
import json
import numpy as np

def compare(mod, options):
    found = {}
    def note(name, value):
        found[name] = np.asarray(value, dtype=float).ravel().tolist()
    options = dict(options)
    for name, table in options.get("inputs", {}).items():
        options["inputs"] = {**options["inputs"], name: tuple(table)}
    x = mod.x0(options.get("initial") or {})
    q, v = x[: mod.n_q], x[mod.n_q :]
    note("x0", x)
    note("assembled", mod.assemble(dict(zip(mod.q_names[:1], q[:1] + 0.01))))
    off = x + 1e-3 * np.cos(np.arange(mod.n_x))
    batch = mod.project(np.stack([x, off], axis=-1))
    for name in ("rhs", "jacobian", "bias", "outputs", "input_jacobian", "parameter_jacobian"):
        note(name, getattr(mod, name)(0.3, x))
        note(f"{name} of many", getattr(mod, name)(0.3, batch))
    for name in ("energy", "project", "momentum", "velocity_constraints"):
        note(name, getattr(mod, name)(x))
    for name in ("mass_matrix", "embedded_mass_matrix", "poses", "center_of_mass", "com_jacobian", "centroidal_inertia",
                 "constraints", "constraint_jacobian"):
        note(name, getattr(mod, name)(q))
    note("inverse_dynamics", mod.inverse_dynamics(q, v, v))
    note("bound", mod.bind(p={mod.p_names[0]: 1.01 * mod.p[0]}).rhs(0.3, x) if mod.n_p else [])
    span = options.pop("span", 0.4)
    event = lambda t, z: z[0] - 0.9 * x[0]
    for method in options.pop("methods"):
        run = mod.simulate((0.0, span), method=method, **options)
        for name in ("t", *run.names):
            note(f"{method} {name}", run[name])
        note(f"{method} events", [t for times in run.t_events for t in times])
        watched = mod.simulate((0.0, span), method=method, events={"own": event}, dense_output=True, **options)
        note(f"{method} own", watched.t_events["own"])
        note(f"{method} at", watched.at([0.1, 0.2]).x)
    return found
"""
ALONE = (
    COMPARED
    + """
import importlib, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
given = json.load(sys.stdin)
print(json.dumps(compare(importlib.import_module(given["name"]), given["options"])))
"""
)


def run_alone(folder: Path, script: str, given: Any = None) -> str:
    command = [sys.executable, "-c", script]
    text = json.dumps(given)
    done = subprocess.run(command, cwd=folder, input=text, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def lines_of(folder: Path) -> int:
    """Lines of Python; those that a model's own equations take in Python are the model's."""
    apart = {folder / "_core.py", folder / "setup.py"}
    return sum(
        len(file.read_text().splitlines())
        for file in folder.rglob("*.py*")
        if file.suffix != ".pyx" and file not in apart
    )


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return generate(models.build("slider_crank"), tmp_path_factory.mktemp("slim"), target="numpy", slim=True)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_the_lines_are_few(target: str, tmp_path: Path) -> None:
    slim = generate(models.build("slider_crank"), tmp_path / "slim", target=target, slim=True)
    whole = generate(models.build("slider_crank"), tmp_path / "whole", target=target)
    assert lines_of(slim) <= MOST[target]
    assert lines_of(whole) > 3 * lines_of(slim)
    if target == "cython":  # what runs is the same to the last character
        sources = {
            file.name: file.read_bytes() for file in whole.iterdir() if file.suffix in (".c", ".h", ".pyx", ".pxi")
        }
        assert len(sources) > 20
        assert all((slim / name).read_bytes() == text for name, text in sources.items())


@pytest.mark.parametrize("name", part_of(CASES, lambda name: name != "stewart_platform"))
def test_results_are_those_of_the_whole_to_the_last_bit(name: str, tmp_path: Path) -> None:
    build, options = CASES[name]
    options = {**options, "methods": ["DOP853", "Radau"] if name != "stewart_platform" else ["RK45"]}
    generate(build(), tmp_path, target="numpy", slim=True)
    there = json.loads(run_alone(tmp_path, ALONE, {"name": name, "options": options}))
    scope: dict[str, Any] = {}
    exec(COMPARED, scope)  # noqa: S102 - the text above
    here = scope["compare"](build().compile(target="numpy"), options)
    assert here.keys() == there.keys()
    assert len(here) > 30
    if name == "bouncing":
        assert here["DOP853 events"]
    different = [key for key in here if not np.array_equal(here[key], there[key], equal_nan=True)]
    assert different == []


@pytest.mark.slow
def test_a_compiled_one_too(tmp_path: Path) -> None:
    options = {**CASES["bouncing"][1], "methods": ["DOP853", "RK45", "Radau", "BDF"]}
    folder = generate(bouncing(), tmp_path / "source", slim=True)
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--no-build-isolation", "--no-index", "--target", str(tmp_path / "there"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    there = json.loads(run_alone(tmp_path / "there", ALONE, {"name": "bouncing", "options": options}))
    scope: dict[str, Any] = {}
    exec(COMPARED, scope)  # noqa: S102 - the text above
    here = scope["compare"](bouncing().compile(), options)
    assert [key for key in here if not np.array_equal(here[key], there[key], equal_nan=True)] == []


REFUSED = """
import json, re, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import slider_crank as package
run = package.simulate((0, 0.05))
calls = {
    **{name: lambda name=name: getattr(package, name)() for name in json.load(sys.stdin)},
    **{name: lambda name=name: getattr(package, name) for name in ("minimal", "canonical", "dae", "DOP853", "Taylor")},
    "kinematics": lambda: package.module.kinematics([0.3]),
    "checkpoint=": lambda: package.simulate((0, 0.05), checkpoint="kept"),
    "progress=": lambda: package.simulate((0, 0.05), progress=True),
    "cubic tables": lambda: package.simulate((0, 0.05), inputs={"tau": package.Signal([0, 1, 2], [0, 1, 3], "cubic")}),
    "save": lambda: run.save("run.npz"),
    "plot": lambda: run.plot(),
    "change_points": lambda: run.change_points,
    "pickling": lambda: __import__("pickle").dumps(package.module),
}
said = {}
for name, call in calls.items():
    try:
        call()
    except package.EomgenError as error:
        said[name] = str(error)
    else:
        said[name] = "nothing"
    assert not (name in ("minimal", "equilibrium") and hasattr(package.module, name)), name
try:
    package.simulate((0, 0.05), events="theta - 1")
except package.EomgenError as error:
    said["texts"] = str(error)
try:
    package.nothing
except AttributeError as error:
    said["lacking"] = str(error)
said["shown"] = repr(package.module)
print(json.dumps(said))
"""


def test_everything_else_refuses_by_name(package: Path) -> None:
    said = json.loads(run_alone(package.parent, REFUSED, sorted(CALLS.keys() - {"simulate"})))
    assert "needs eomgen" in said.pop("texts")
    assert "no attribute 'nothing'" in said.pop("lacking")
    assert "slider_crank" in said.pop("shown")
    expected = "this package was generated slim; generate it without --slim for "
    assert {name: text for name, text in said.items() if not text.startswith(expected)} == {}
    assert said["equilibrium"] == f"{expected}equilibrium"
    assert len(said) > len(CALLS)


def test_what_is_left_out_is_there_and_asked_for(package: Path) -> None:
    """No name of the table is out of date, and no refusal comes at an import that every run needs."""
    assert LEFT_OUT.keys() <= carried_names()
    refusals = {file for file in package.rglob("*.py") if "\nraise left_out(" in file.read_text()}
    asked = {str(file.relative_to(package).with_suffix("")) for file in refusals}
    assert asked == {*LEFT_OUT, *ITS_OWN}
    for file in package.rglob("*.py"):
        for home in re.findall(r"^from (\.[\w.]+) import", file.read_text(), re.M):
            up = len(home) - len(home.lstrip("."))
            found = file.parents[up - 1].joinpath(*home.lstrip(".").split(".")).with_suffix(".py")
            assert found not in refusals, f"{file}: {home}"


def headers(text: str) -> dict[str, set[int]]:
    """Signatures of all functions, and the lines of those that take several."""
    found: dict[str, set[int]] = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            returns = ast.dump(node.returns) if node.returns is not None else ""
            lines = range(node.lineno - 1, node.body[0].lineno - 1)
            name = f"{node.name} {ast.dump(node.args)} {returns}"
            found.setdefault(name, set()).update(lines if len(lines) > 1 else ())
    return found


def test_what_is_kept_is_the_text_of_eomgen(package: Path) -> None:
    """Line by line; only imports and signatures are put together anew, documentation is shortened, and ends of blocks
    that stand behind an import of what is left out are marked."""
    compared = signatures = 0
    for file in package.rglob("*.py"):
        original = ROOT / file.relative_to(package)
        if (file.parent == package and file.name in ("__init__.py", "_core.py")) or file.parent.name == "tests":
            continue
        if "left_out(" in file.read_text() and file.name not in ("errors.py", "module.py"):
            continue
        known = {line.strip() for line in original.read_text().splitlines()}
        written, lines = headers(original.read_text()), file.read_text().splitlines()
        for signature, places in headers(file.read_text()).items():
            assert signature in written, f"{file.name}: {signature}"
            lines = ["" if k in places else line for k, line in enumerate(lines)]
            signatures += len(places) > 0
        for line in lines:
            text = line.strip().removesuffix('"""').rstrip()
            fine = {text, f'{text}"""', line.strip()} & known or text.startswith(("from ", "import ")) or not text
            fine = fine or text == NOT_REACHED
            assert fine, f"{file.name}: {line}"
            compared += 1
    assert compared > 3000
    assert signatures >= 50


USER = """
import slider_crank
from slider_crank import Signal
run = slider_crank.simulate((0.0, 1.0), inputs={"tau": Signal([0, 1], [0, 1])})
reveal_type(slider_crank.rhs(0.0, slider_crank.x0()))
reveal_type(run)
reveal_type(slider_crank.bind(p={"r": 0.1}).simulate((0.0, 1.0)).x)
reveal_type(slider_crank.n_q)
slider_crank.equilibrium
"""


@pytest.fixture(scope="module")
def told(package: Path) -> tuple[str, str]:
    """What a type checker says of a program that uses the package, and of the package."""
    (package.parent / "user.py").write_text(USER)
    command = [sys.executable, "-m", "mypy", "--config-file=", "user.py", package.name]
    done = subprocess.run(command, cwd=package.parent, capture_output=True, text=True, timeout=600)
    *lines, last = done.stdout.splitlines(keepends=True)
    assert "checked" in last
    of_user = [line for line in lines if line.startswith("user.py:")]
    return "".join(of_user), "".join(line for line in lines if line not in of_user)


def test_types_are_seen_from_outside(told: tuple[str, str]) -> None:
    text, _ = told
    types = re.findall(r'Revealed type is "(.*)"', text)
    assert len(types) == 4, text
    assert "ndarray" in types[0]
    assert types[1].endswith("runtime.trajectory.Trajectory")
    assert "ndarray" in types[2]
    assert types[3].endswith("int")
    assert text.count("error:") == 1
    assert 'has no attribute "equilibrium"' in text


def test_names_hold_together(told: tuple[str, str]) -> None:
    """A type checker misses nothing but what is refused."""
    _, text = told
    refused = [name.replace("/", ".") for name in (*LEFT_OUT, *ITS_OWN)]
    assert text
    for line in text.splitlines():
        named = re.search(r'Module "slider_crank\.([\w.]+)" has no attribute', line)
        parser = bool(re.search(r"slider_crank.(runtime.formulas|describe.constant_texts)\b", line))
        parser = parser or line.endswith("#missing-imports")
        parser = parser or "stubs not installed" in line or "note: " in line  # of SciPy and pandas
        assert parser or (named and named[1] in refused), line


def test_a_library_of_c_holds_no_python(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="slim is for target cython or numpy"):
        generate(models.build("pendulum"), tmp_path, target="c", slim=True)


def test_the_command_line(tmp_path: Path) -> None:
    from eomgen.cli import main

    arguments = ["generate", str(models.EXAMPLES / "pendulum.yaml"), "--out", str(tmp_path), "--target", "numpy"]
    with pytest.raises(SystemExit) as left:
        main([*arguments, "--slim"])
    assert not left.value.code
    assert not (tmp_path / "pendulum" / "selftest.py").exists()
    with pytest.raises(SystemExit):
        main(arguments)
    assert (tmp_path / "pendulum" / "analysis" / "equilibrium.py").is_file()  # the whole one takes its place
    with pytest.raises(SystemExit):
        main([*arguments, "--slim"])
    assert not (tmp_path / "pendulum" / "analysis" / "equilibrium.py").exists()


def struck() -> eg.Model:
    """A mass that impacts, by the law of restitution."""
    m = eg.Model("struck")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.event("wall", "s + 0.5", restitution=0.5)
    return m


BEFORE = """
import importlib, json, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
package = importlib.import_module(json.load(sys.stdin))
assert package.rhs(0.0, package.x0()).shape == (package.n_x,)
try:
    package.simulate((0.0, 1e-9))
except package.EomgenError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("build", "what"),
    [(struck, "events with impacts"), (lambda: models.build("driven_slider_crank"), "mechanisms that drivers move")],
)
def test_a_run_that_it_cannot_end_does_not_begin(build: Any, what: str, tmp_path: Path) -> None:
    folder = generate(build(), tmp_path, target="numpy", slim=True)
    assert f"generate it without --slim for {what}" in run_alone(tmp_path, BEFORE, folder.name)
