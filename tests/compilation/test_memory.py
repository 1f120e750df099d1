"""What loaded models cost: those of the NumPy target go with their last user, compiled ones stay."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

#: Models until what is loaded and kept once has been: parts of eomgen that load late, arenas of the allocator.
WARM = 15
#: Compiles models, uses each once and lets it go; prints the resident memory (MB) on the way, and what is left loaded.
RUN = """
import gc, sys
from pathlib import Path
import numpy as np
import eomgen as eg
def once(k):
    model = eg.Model("thrown_away")
    body = model.body("b", mass=1.0 + 0.01 * k, com=(0, -1, 0))
    model.revolute("j", model.ground, body, coordinate="theta")
    module = model.compile(target="numpy")
    module.mass_matrix(np.zeros(1))
    return module.rhs(0.0, [0.1, 0.2])[1]
def compiled(k, folder=Path(sys.argv[3])):
    from eomgen.compilation import compile_sources, load_core
    from eomgen.emit.sources import read_template
    sources = {f.name: f.read_text() for f in folder.iterdir()} | {"eomgen.h": read_template("c/eomgen.h")}
    sources["pendulum.c"] = sources["pendulum.c"].replace("9.81", f"9.8{k:03}")
    return load_core(compile_sources(sources, "pendulum")).metadata
work = {"numpy": once, "cython": compiled}[sys.argv[1]]
for k in range(int(sys.argv[2])):
    work(k)
    if k in (int(sys.argv[4]) - 1, int(sys.argv[2]) - 1):
        gc.collect()
        print(int(open("/proc/self/statm").read().split()[1]) * 4096 / 1e6)
print(sum("pendulum" in name or "thrown" in name for name in sys.modules))
"""


def grown(target: str, count: int) -> tuple[float, int]:
    command = [sys.executable, "-c", RUN, target, str(count), str(Path(__file__).with_name("model")), str(WARM)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    early, late, left = done.stdout.split()
    return (float(late) - float(early)) / (count - WARM), int(left)


def test_throw_away_models_of_numpy_leave_nothing() -> None:
    per_model, left = grown("numpy", 175)  # so many that what the allocator keeps once counts little
    assert left == 0
    assert per_model < 0.02  # MB; 0.06 while they were kept


def test_compiled_models_stay() -> None:
    per_model, left = grown("cython", 23)
    assert left == 23
    assert per_model < 1.0  # MB, as docs/python.md says
