"""A short attack of every kind, and every case that once was a finding."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hostile.kind import MODULES, find, generator, kept
from hostile.outcome import FINDINGS
from hypothesis import given, settings
from hypothesis import strategies as st
from sweeps import part_of

HERE = Path(__file__).parent
KEPT = sorted((HERE / "kept").glob("*/*.*"))
#: Kind -> how many cases; test_robot_files tries the same robots and more.
SHORT = {"expressions": 1600, "yaml": 160, "sympy": 60, "command_lines": 24, "urdf": 10, "meshes": 5}
LONGER = {"expressions": 4000, "yaml": 400, "sympy": 150, "command_lines": 60, "urdf": 120, "meshes": 60}


@pytest.mark.slow
@pytest.mark.parametrize("counts", part_of((SHORT, LONGER), lambda counts: counts is SHORT), ids=["short", "longer"])
def test_a_short_attack_finds_nothing(counts: dict[str, int], tmp_path: Path) -> None:
    """In a process of its own: the guard and the limits stay for the life of a process."""
    command = [sys.executable, "-m", "hostile.short", str(tmp_path), json.dumps(counts)]
    done = subprocess.run(command, cwd=HERE.parent, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert done.stdout.count("nothing found") == len(SHORT) + bool(KEPT)


@pytest.mark.parametrize("name", ["expressions", "yaml", "sympy", "urdf"])
def test_a_seed_makes_the_same_case_again(name: str, tmp_path: Path) -> None:
    kind = find(name)
    kind.prepare(tmp_path)
    assert [kind.make(generator(name, seed)) for seed in range(20)] == [
        kind.make(generator(name, seed)) for seed in range(20)
    ]


@settings(max_examples=300, database=None)
@given(st.text(max_size=80))
def test_any_text_is_an_expression_or_named(text: str) -> None:
    from eomgen.errors import ExpressionError

    kind = find("expressions")
    try:
        assert kind.run(text, HERE) == "fine"
    except ExpressionError as error:
        assert error.message


@settings(max_examples=100, database=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
        lambda x: st.lists(x, max_size=3) | st.dictionaries(st.text(max_size=6), x, max_size=3),
        max_leaves=12,
    )
)
def test_any_tree_is_a_model_or_named(tree: Any) -> None:
    from eomgen.errors import ModelError

    kind = find("yaml")
    try:
        kind.run(
            {"stage": "build", "text": json.dumps({"name": "made", "bodies": {"b": tree}, "parameters": tree})}, HERE
        )
    except ModelError as error:
        assert error.problems


def test_every_kind_has_a_home() -> None:
    assert all(find(name).name == name for name in MODULES)
    assert "fine" not in FINDINGS


CAUGHT = {
    "open": "open('/etc/hostname')",
    "write": "open('/tmp/eomgen-canary', 'w')",
    "system": "import os; os.system('true')",
    "process": "import subprocess; subprocess.Popen(['true'])",
    "socket": "import socket; socket.socket().connect(('127.0.0.1', 9))",
    "run text": "exec(compile('1', 'x', 'exec'))",
    "evaluate text": "eval('1+1')",
    "pickle": "import pickle; pickle.loads(pickle.dumps(len))",
    "remove": "import os; os.remove('/tmp/eomgen-canary')",
    "foreign code": "import sys; sys.path.insert(0, '{folder}'); import canary",
    "library": "import ctypes; ctypes.CDLL(None)",
}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What each attempt came to: all in one process of their own, which has to load the libraries first."""
    folder = tmp_path_factory.mktemp("guard")
    (folder / "canary.py").write_text("")
    attempts = {what: text.format(folder=folder) for what, text in CAUGHT.items()}
    program = f"""
import json
import sys
from pathlib import Path
from hostile.outcome import Runner
from hostile.short import Attempt
runner = Runner(Path({str(folder / "home")!r}), Path({str(folder / "cache")!r}))
for what, text in json.loads(sys.argv[1]).items():
    print(what, runner.run(Attempt(compile(text, json.__file__, "exec")), None).kind, sep=": ")
"""
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps({"nothing": "", **attempts, "nothing again": ""})],
        cwd=HERE.parent,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return dict(line.split(": ") for line in done.stdout.splitlines())


@pytest.mark.parametrize("what", CAUGHT)
def test_the_guard_catches(what: str, outcomes: dict[str, str]) -> None:
    """Each attempt is refused before it happens, and told as an escape."""
    assert outcomes[what] == "escape"


def test_the_guard_lets_pass_what_does_nothing(outcomes: dict[str, str]) -> None:
    assert (outcomes["nothing"], outcomes["nothing again"]) == ("fine", "fine")


@pytest.mark.parametrize("path", KEPT, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_kept_cases_are_readable(path: Path) -> None:
    assert path.parent.name in MODULES
    assert kept(path) is not None
