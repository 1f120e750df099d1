"""The same model gives byte-identical sources under any hash seed (DESIGN, section 2)."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import models
import pytest
from sweeps import part_of

SCRIPT = """
import hashlib, json, sys
import eomgen as eg
from eomgen import pipeline
from eomgen.emit import emit_package

found = {}
for case in sys.argv[2:]:
    name, method = case.split(":")
    equations = eg.load(f"{sys.argv[1]}/{name}.yaml").derive(method)
    for target in ("cython", "numpy"):
        sources = emit_package(pipeline.build(equations, target), target)
        for file, text in sources.items():
            if file.endswith((".c", ".h", ".json", "_core.py", ".pyi", "__init__.py", "README.md")):
                found[f"{name} {method} {target} {file}"] = hashlib.sha256(text.encode()).hexdigest()
print(json.dumps(found))
"""
METHODS = ("embedding", "lagrange")
NAMES = (*models.EXAMPLE_NAMES, *models.DRIVEN_NAMES)
#: Every example by one of the methods, by turns; by the other one in ``make thorough``.
PARTS = [tuple(f"{name}:{METHODS[(k + which) % 2]}" for k, name in enumerate(NAMES)) for which in (0, 1)]


def hashes(seed: str, cases: tuple[str, ...]) -> dict[str, str]:
    command = [sys.executable, "-c", SCRIPT, str(models.EXAMPLES), *cases]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**os.environ, "PYTHONHASHSEED": seed}
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize("which", part_of([0, 1], lambda which: which == 0))
def test_sources_do_not_depend_on_the_hash_seed(which: int) -> None:
    one, other = hashes("1", PARTS[which]), hashes("20250", PARTS[which])
    assert len(one) > 50
    assert one == other


def test_a_second_derivation_in_one_process_gives_the_same_text() -> None:
    from eomgen import pipeline
    from eomgen.emit import emit_c, emit_numpy

    for name in ("slider_crank", "spatial_loop"):
        texts = []
        for _ in range(2):
            equations = models.build(name).derive("lagrange")
            texts.append([dict(emit(pipeline.build(equations, "c"))) for emit in (emit_c, emit_numpy)])
        assert texts[0] == texts[1]
