"""The list of deliberate faults: each still fits the sources, has a test that exists, and three are really tried."""

import ast
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from mutations.copies import Copy
from mutations.fault import FAULTS, ROOT, Fault, read_sources
from mutations.run import FAILED, RESULTS

TRIED = ("quotient-rule", "wide-steps", "gear-inverted")


def test_every_fault_fits_the_sources_once() -> None:
    texts, plain = read_sources(ROOT), cache(lambda text: ast.unparse(ast.parse(text)))
    for fault in FAULTS:
        path, text = fault.apply(texts)
        assert text != (plain(texts[path]) if path.suffix == ".py" else texts[path]), fault.id
        assert fault.breaks
    assert len({fault.id for fault in FAULTS}) == len(FAULTS) > 200


def test_a_fault_is_independent_of_the_layout_and_the_file() -> None:
    texts = {
        Path("a.py"): "def f(a):\n    return a\n",
        Path("b.py"): "class C:\n    def f(self, a):\n        return (  # twice\n            2*g(a, 'x',)\n        )\n",
        Path("c.c"): "static int f(int a)\n{\n    return  2 *\n        a;\n}\n",
    }
    path, text = Fault("", "C.f", '2 * g(a, "x")', "a + 1", "").apply(texts)
    assert (path.name, text.splitlines()[-1].strip()) == ("b.py", "return a + 1")
    path, text = Fault("", "C f", "2 * a", "a", "").apply(texts)
    assert (path.name, text.splitlines()[2].strip()) == ("c.c", "return  a;")
    with pytest.raises(ValueError, match="occurs 0 times in f"):
        Fault("", "f", "2", "1", "").apply(texts)


def test_tests_that_are_to_notice_exist() -> None:
    tests = sorted({test for fault in FAULTS for test in fault.caught_by})
    words = ("-m", "pytest", "--collect-only", "-q", "-p", "mutations.plugin", "-p", "no:cacheprovider", *tests)
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]


def test_three_faults_are_noticed(tmp_path: Path) -> None:
    copy = Copy(tmp_path)
    before = read_sources(copy.root)
    for fault in FAULTS:
        if fault.id in TRIED:
            outcome = copy.run_with(fault, fault.caught_by)
            assert outcome.code == FAILED, outcome.text
            assert read_sources(copy.root) == before


def test_the_results_are_those_of_the_list() -> None:
    rows = [line.split(" | ") for line in RESULTS.read_text(encoding="utf-8").splitlines() if line.startswith("| ")][1:]
    assert [row[0].removeprefix("| ") for row in rows] == [fault.id for fault in FAULTS]
    assert not any("nobody" in row[3] for row in rows)
