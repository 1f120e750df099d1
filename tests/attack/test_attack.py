"""A short attack of every kind, every case that once was a finding, and that the guard and the limits see what they must."""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from attack.fuzz import KEPT, attack, case_of, files_of
from attack.runner import MODULES, find
from children import HANGS
from hypothesis import given, settings
from hypothesis import strategies as st

import eomgen as eg

#: Kind -> how many cases run always, and with ``make thorough``.
CASES = {
    "expressions": (300, 5000),
    "yaml": (80, 1500),
    "sympy": (30, 300),
    "calls": (0, 1500),
    "command_lines": (12, 150),
    "urdf": (40, 1000),
    "mjcf": (2, 30),
    "meshes": (12, 300),
}


def assert_nothing_found(numbers: dict[str, int], folder: Path) -> None:
    """In a process of its own: the guard and the limits stay for the life of a process."""
    counts: dict[str, Counter[str]] = {}
    for report in attack([(name, -len(files_of(name)), count) for name, count in numbers.items()], folder):
        assert "done" in report, f"make fuzz KINDS={report['kind']} SEED={report['seed']}\n{report['text']}"
        counts[report["done"]] = Counter(report["counts"])
    assert {name: sum(counts[name].values()) for name in numbers} == {
        name: count + len(files_of(name)) for name, count in numbers.items()
    }
    assert all(counts[name]["fine"] for name in numbers if name != "mjcf")


def test_a_short_attack_finds_nothing(tmp_path: Path) -> None:
    assert_nothing_found({name: few for name, (few, _) in CASES.items() if few}, tmp_path)


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_a_longer_attack_finds_nothing(name: str, tmp_path: Path) -> None:
    assert_nothing_found({name: CASES[name][1]}, tmp_path)


def test_every_kind_has_a_home_and_repeats_itself(tmp_path: Path) -> None:
    for name in MODULES:
        assert find(name).name == name
        assert all(case_of(name, -k - 1) is not None for k in range(len(files_of(name))))
    assert {path.name for path in KEPT.iterdir()} <= set(MODULES)
    for name in ("expressions", "sympy", "urdf"):
        first, second = ([json.dumps(case_of(name, seed)) for seed in range(20)] for _ in range(2))
        assert first == second


@pytest.mark.quick
@settings(max_examples=40, database=None)
@given(st.text(max_size=80))
def test_any_text_is_an_expression_or_named(text: str) -> None:
    kind = find("expressions")
    try:
        assert kind.run(text, KEPT) == "fine"
    except eg.ModelError as error:
        assert error.problems


@settings(max_examples=30, database=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
        lambda x: st.lists(x, max_size=3) | st.dictionaries(st.text(max_size=6), x, max_size=3),
        max_leaves=12,
    )
)
def test_any_tree_is_a_model_or_named(tmp_path_factory: pytest.TempPathFactory, tree: Any) -> None:
    file = tmp_path_factory.getbasetemp() / "tree.yaml"
    file.write_text(json.dumps({"name": "made", "bodies": {"b": tree}, "parameters": tree}), encoding="utf-8")
    try:
        eg.load(file).mechanism()
    except eg.ModelError as error:
        assert error.problems


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
PROGRAM = """
import json, sys
from pathlib import Path
from attack.runner import Kind, Runner

class Attempt(Kind):
    name = "attempt"
    def run(self, given, folder):
        exec(given)
        return "nothing"

folder = Path(sys.argv[1])
runner = Runner(folder / "home", folder / "cache")
runner.prepare(Attempt())
for what, text in json.loads(sys.argv[2]).items():
    print(what, runner.run(Attempt(), compile(text, json.__file__, "exec")).kind, sep=": ")
"""


def test_the_guard_catches_what_no_case_may_do(tmp_path: Path) -> None:
    """Each attempt is refused before it happens, and reported as an escape."""
    (tmp_path / "canary.py").write_text("")
    attempts = {what: text.format(folder=tmp_path) for what, text in CAUGHT.items()}
    attempts |= {"nothing": "", "warns": "import warnings; warnings.warn('x')", "fails": "{}[1]", "nothing again": ""}
    words = [sys.executable, "-c", PROGRAM, str(tmp_path), json.dumps(attempts)]
    done = subprocess.run(words, cwd=KEPT.parents[1], capture_output=True, text=True, timeout=HANGS, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = dict(line.split(": ") for line in done.stdout.splitlines())
    assert {what for what, kind in found.items() if kind == "escape"} == set(CAUGHT)
    assert (found["nothing"], found["warns"], found["nothing again"]) == ("fine", "warning", "fine")
