"""The package that ``generate --target cuda`` writes: it stands alone, and says what it cannot do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.cuda_functions import cuda_functions
from eomgen.errors import UsageError
from eomgen.generation import generate

CHILD = """
import sys
import numpy as np
sys.path[:0] = [{folder!r}, {tests!r}]
import slider_crank as model
assert not [name for name in sys.modules if name.partition(".")[0] in ("sympy", "scipy", "eomgen", "cuda")]
from device.host_device import HostDevice  # finds the compiler by eomgen
from pathlib import Path
from slider_crank.device import arrays_on_device
import device.host_device
device.host_device.DeviceArray = arrays_on_device.DeviceArray
loaded = model.load(HostDevice(Path({work!r})))
x = np.repeat(loaded.x0[:, None], 4, axis=1)
assert np.ptp(loaded.rhs(0.0, x), axis=1).max() == 0.0
runs = loaded.simulate_many((0.0, 0.1), x)
assert (runs.status == 0).all()
print(loaded.rhs(0.0, x)[:, 0].tolist())
"""


def test_it_stands_alone(tmp_path: Path) -> None:
    model = eg.load(models.EXAMPLES / "slider_crank.yaml")
    folder = generate(model, tmp_path, target="cuda")
    tests, work = str(Path(__file__).parents[1]), tmp_path / "work"
    work.mkdir()
    script = CHILD.format(folder=str(tmp_path), tests=tests, work=str(work))
    done = subprocess.run([sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    module = model.compile(target="numpy")
    expected = module.rhs(0.0, module.x0())
    found = [float(x) for x in done.stdout.strip()[1:-1].split(",")]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert "`inverse_dynamics(q, v, a, p=None, u=None, t=0.0)`" in readme
    assert "cuda-core" in (folder / "pyproject.toml").read_text(encoding="utf-8")


def test_the_same_model_gives_the_same_files(tmp_path: Path) -> None:
    model = eg.load(models.EXAMPLES / "double_pendulum.yaml")
    one, other = (generate(model, tmp_path / name, target="cuda") for name in ("one", "other"))
    for file in sorted(one.rglob("*")):
        if file.is_file():
            assert file.read_bytes() == (other / file.relative_to(one)).read_bytes()


def test_functions_in_c_are_refused_by_name(tmp_path: Path) -> None:
    m = eg.Model("driven")
    m.prismatic("d", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="x")
    (tmp_path / "push.c").write_text("double push(double x) { return -x; }\n")
    m.native("push", tmp_path / "push.c")
    m.torque("pushed", "d", "push(x)")
    with pytest.raises(UsageError, match="target 'cuda': function push is C code"):
        cuda_functions(m.derive())


def test_options_of_other_targets_are_refused(tmp_path: Path) -> None:
    model = eg.load(models.EXAMPLES / "double_pendulum.yaml")
    with pytest.raises(UsageError, match=r"is for target c"):
        generate(model, tmp_path, target="cuda", precision="float")
