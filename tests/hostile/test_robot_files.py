"""Hostile robot files by fixed seeds: each ends in a model or a named error, and nothing outside its folder is read.

``make fuzz`` runs many more.  The attacks that once worked are written out in tests/model/test_robot_file_faults.py.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from hostile.kind import generator
from hostile.robot_files import KINDS
from sweeps import part_of

#: Kind -> cases; one of MJCF takes a process of its own.
CASES = {"urdf": 600, "mjcf": 20, "meshes": 150}
SHARES = (0.4, 1.0)  #: of the cases that are tried always, and by make thorough
PROGRAM = """
import json, sys
from pathlib import Path
from hostile.kind import find, generator
from hostile.outcome import FINDINGS, Runner

kind, folder = find(sys.argv[1]), Path(sys.argv[2])
runner = Runner(folder / "home", folder / "cache")
runner.prepare(kind)
runner.limit()
found = [(seed, runner.run(kind, kind.make(generator(kind.name, seed)))) for seed in range(int(sys.argv[3]))]
words = sorted({outcome.kind for _, outcome in found})
print(json.dumps({"words": words, "bad": [(seed, *o[:2], o.text) for seed, o in found if o.kind in FINDINGS]}))
"""


@pytest.mark.parametrize("share", part_of(SHARES, lambda share: share < 1.0))
@pytest.mark.parametrize("kind", CASES)
def test_no_robot_file_escapes_hangs_or_ends_in_a_traceback(kind: str, share: float, tmp_path: Path) -> None:
    """In a process of its own, whose audit hook and limits stay with it."""
    words = [sys.executable, "-c", PROGRAM, kind, str(tmp_path), str(int(share * CASES[kind]))]
    tests = Path(__file__).parents[1]
    done = subprocess.run(words, cwd=tests, capture_output=True, text=True, timeout=90, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    report = json.loads(done.stdout)
    assert report["bad"] == []
    assert set(report["words"]) == {"fine", "named error"}, "cases of both kinds, or nothing was attacked"


@pytest.mark.parametrize("kind", CASES)
def test_a_seed_always_makes_the_same_case(kind: str) -> None:
    for seed in range(20):
        first, second = (KINDS[kind].make(generator(kind, seed)) for _ in range(2))
        assert json.dumps(first) == json.dumps(second)
