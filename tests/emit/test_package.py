"""Exported packages: what is in them, and that they work on their own."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import models
import numpy as np
import pytest

import eomgen.errors
from eomgen.emit import SourceSet, carried, emit_c, emit_numpy, emit_package
from eomgen.layer import LAYER

ROOT = Path(eomgen.errors.__file__).parent
ALONE = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("eomgen", "sympy", "jinja2", "scipy"):
            raise ImportError(name)
sys.meta_path.insert(0, Refuse())
import numpy as np
import crank
x = crank.x0(theta=0.3, theta_dot=10.0)
assert np.abs(crank.constraints(x[:3])).max() < 1e-12
x_dot = crank.rhs(0.0, x)
assert np.allclose(x_dot[:3], x[3:], rtol=1e-13) and np.isfinite(x_dot).all()
assert set(crank.__all__) <= set(dir(crank)) | {"minimal", "Signal"}
assert crank.Signal([0, 1], [0, 2])(0.5) == 1.0
assert crank.step(0.0, x, 1e-6).shape == x.shape
assert crank.minimal.rhs(0.0, [0.3, 10.0]).shape == (2,)
try:
    crank.simulate((0, 1), method="BDF")
except crank.EomgenError as error:
    assert "scipy" in str(error).lower()
else:
    raise AssertionError("BDF ran without SciPy")
try:
    trajectory = crank.simulate((0, 0.1), initial=x)
except crank.EomgenError as error:  # no compiler, no steppers of its own
    assert crank.metadata["target"] == "numpy" and "scipy" in str(error).lower()
else:
    assert crank.metadata["target"] == "cython" and trajectory.t[-1] == 0.1
    batch = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 5))
    assert crank._core.lane_width >= 2 and "mass_matrix" in crank.metadata["lanes"]  # from the beginning
    single = [crank.mass_matrix(np.ascontiguousarray(batch[:, k])) for k in range(5)]
    assert (crank.mass_matrix(batch) == np.stack(single, axis=-1)).all()
    assert crank._core.lane_width >= 2 and crank.rhs(t=0.0, x=x, out=x_dot) is x_dot
print(repr(x_dot.tolist()))
"""


def run_alone(folder, interpreter=sys.executable):
    done = subprocess.run(
        [interpreter, "-c", ALONE], cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)}, capture_output=True,
        text=True, check=False, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return np.array(json.loads(done.stdout))


@pytest.fixture(scope="module")
def packages(systems, libraries, tmp_path_factory):
    made = {}
    for target in ("cython", "numpy", "c"):
        made[target] = folder = tmp_path_factory.mktemp(target)
        libraries.write(emit_package(systems.slider_crank().program(), target), folder / "crank")
    return made


def test_the_files_of_each_target(packages):
    files = {
        target: {str(p.relative_to(folder / "crank")) for p in folder.rglob("*") if p.is_file()}
        for target, folder in packages.items()
    }
    c_files = {"crank.c", "crank.h", "eomgen.h", "eomgen_real.h", "eomgen_sincos.h", "eomgen_angles.h"} | {
        "eomgen_processor.h",
        "eomgen_contraction.h",
    }
    c_files |= {
        "crank_lanes.h",
        *(f"crank_{kind}{width}.c" for kind in ("lanes", "contracted_lanes") for width in (2, 4, 8)),
    }
    built = {"Makefile", "CMakeLists.txt", "crank.pc.in", "crank_real_time.c"}
    about = {"model.json", "README.md", "PROVENANCE.md", "LICENSE.txt"}
    assert files["c"] == c_files | built | about
    copied = {
        n for n in files["cython"] if n.endswith(".py") and n.removesuffix(".py").partition("/")[0] in carried.ALONE
    }
    assert {"errors.py", "api/module.py", "runtime/kernels.py", "verification/selftest.py"} <= copied
    in_python = {"runtime/numpy_core.py", "runtime/numpy_drivers.py"}
    in_python |= {n for n in files["numpy"] - copied if n.startswith(("numeric/", "limits/"))}
    assert "numeric/embedded.py" in in_python
    python = about | {"__init__.py", "__init__.pyi", "selftest.py", "pyproject.toml", "py.typed"}
    python |= {"tests/test_recorded.py"}
    assert files["numpy"] == copied | in_python | python | {"_core.py"}
    assert files["cython"] == copied | python | set(LAYER) | {"setup.py"} | c_files
    for name in copied - {n for n in copied if n.endswith("/__init__.py")}:
        assert (packages["cython"] / "crank" / name).read_bytes() == (ROOT / name).read_bytes()
    for target, folder in packages.items():
        assert json.loads((folder / "crank" / "model.json").read_text())["target"] == target


def test_the_numpy_package_runs_with_numpy_alone(packages, systems, compiled):
    x_dot = run_alone(packages["numpy"])
    system = systems.slider_crank()
    q = [0.3, -np.arcsin(0.1 * np.sin(0.3) / 0.35), 0.0]
    q[2] = 0.1 * np.cos(0.3) + 0.35 * np.cos(q[1])
    rate = -0.1 * np.cos(0.3) / (0.35 * np.cos(q[1])) * 10.0
    v = [10.0, rate, -0.1 * np.sin(0.3) * 10.0 - 0.35 * np.sin(q[1]) * rate]
    np.testing.assert_allclose(x_dot, compiled(system).fine("rhs", [*q, *v]), rtol=1e-9)


@pytest.mark.slow
def test_the_cython_package_installs_and_runs_with_numpy_alone(packages, tmp_path):
    source = str(packages["cython"] / "crank")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--no-build-isolation", "--no-index", "--target", str(tmp_path), source]
    environment = {**os.environ, "CFLAGS": "-O0"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(run_alone(tmp_path), run_alone(packages["numpy"]), rtol=1e-10)


def test_the_c_package_builds_its_libraries_and_its_example(packages):
    folder = packages["c"] / "crank"
    (folder / "crank_example.c").write_text(
        re.search(r"```c\n(.*?)```", (folder / "README.md").read_text(), re.S).group(1)
    )
    subprocess.run(
        ["make", "-s", "all", "crank_example", "CFLAGS=-O0 -std=c99 -fPIC -Wall -Wextra -Werror"],
        cwd=folder,
        check=True,
    )
    done = subprocess.run(["./crank_example"], cwd=folder, capture_output=True, text=True, check=True)
    x_dot = [float(word) for word in done.stdout.split()]
    assert len(x_dot) == 6
    given = re.search(r"const double x\[CRANK_N_X\] = \{ (.*?) \}", (folder / "crank_example.c").read_text()).group(1)
    x = [float(word) for word in given.split(", ")]
    np.testing.assert_allclose(x_dot[:3], x[3:], rtol=1e-12)
    theta, phi = x[:2]  # of crank and rod against ground, r = 0.1 and l = 0.35; the guide is the x axis
    omega, turning = x[3:5]
    assert abs(omega) >= 1.0  # it moves
    assert 0.1 * np.cos(theta) * omega + 0.35 * np.cos(phi) * turning == pytest.approx(0.0, abs=1e-12)
    assert x[5] == pytest.approx(-0.1 * np.sin(theta) * omega - 0.35 * np.sin(phi) * turning, abs=1e-12)
    assert (folder / "libcrank.so").exists()


CALLS = """
import re
import numpy as np
import crank
x = crank.x0(theta=0.3, theta_dot=10.0)
values = {
    "t": 0.0, "x": x, "q": x[:3], "v": x[3:], "a": x[3:], "q_i": x[:1], "v_i": x[3:4], "a_i": x[3:4],
    "w": np.ones(3), "d": np.ones(9),
    "x_min": [0.3, 10.0], "span": 1.0, "y": np.ones(crank.dae.n_y), "yp": np.ones(crank.dae.n_y), "cj": 2.0,
}
tried = 0
for call, shape in re.findall(r"^    (\\w.*\\)) -> (\\(.*?\\)|Module|Trajectory): ", crank.__doc__, re.M):
    if not shape.startswith("("):
        continue
    text = re.sub(r"\\*\\*\\w+", "theta=0.3", call)
    found = eval("crank." + text, {"crank": crank, **values})
    sizes = str(tuple(np.shape(part) for part in found))[1:-1] if isinstance(found, tuple) else str(np.shape(found))
    assert sizes == shape, (call, sizes, shape)
    tried += 1
assert tried >= 21, tried
"""


def test_the_calls_listed_are_those_there_are(packages):
    folder = packages["numpy"]
    done = subprocess.run(
        [sys.executable, "-c", CALLS.replace("\\\\", "\\")],
        cwd=folder, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    readme = (folder / "crank" / "README.md").read_text()
    assert "| `kinematics(q_i, v_i, a_i)` | `(3,), (3,), (3,)` |" in readme
    assert "| `velocity_constraints(x)` |" in readme


def test_awkward_documentation_breaks_nothing(systems, libraries, tmp_path):
    system = systems.chain(1)
    system.metadata["doc"] = 'It says """hello""" \\n */ and {{ more }} ?? \x41\nsecond line'
    compile(emit_package(system.program(), "numpy")["__init__.py"], "__init__.py", "exec")
    project = tomllib.loads(emit_package(system.program(), "cython")["pyproject.toml"])
    assert project["project"]["description"].startswith('It says """hello"""')
    path = libraries.compile_library(emit_c(system.program()), tmp_path)
    assert libraries.Library(path).metadata["doc"] == system.metadata["doc"]


def test_sources_are_a_frozen_mapping(systems):
    sources = emit_numpy(systems.chain(1).program())
    assert isinstance(sources, SourceSet)
    assert set(sources) == {"_core.py", "model.json"}
    with pytest.raises(TypeError):
        sources["x"] = ""


def test_an_unknown_target_is_refused_with_those_there_are(systems):
    with pytest.raises(eomgen.errors.UsageError, match="cython, numpy, c"):
        emit_package(systems.chain(1).program(), "fortran")


def test_packages_tell_whence_they_are_and_whose(packages):
    licence = (ROOT.parent / "LICENSE").read_text()
    for target, folder in packages.items():
        facts = json.loads((folder / "crank" / "model.json").read_text())
        found = facts["provenance"]
        assert (found["model"], found["options"]["target"]) == ("crank", target)
        assert found["versions"]["numpy"] == np.__version__
        assert {"python", "sympy", "eomgen"} <= found["versions"].keys()
        text = (folder / "crank" / "PROVENANCE.md").read_text()
        assert f"| method | `{found['options']['method']}` |" in text
        assert f"| version of numpy | `{np.__version__}` |" in text
        told = (folder / "crank" / "LICENSE.txt").read_text()
        assert told.endswith(licence)
        assert "eomgen claims no right in them" in told


def test_options_are_in_the_provenance(tmp_path):
    from eomgen.generation import generate

    folder = generate(models.build("slider_crank"), tmp_path, "augmented", "numpy", ["theta"], (5.0, 5.0))
    facts = json.loads((folder / "model.json").read_text())
    options = {"method": "augmented", "target": "numpy", "independent": ["theta"], "baumgarte": [5.0, 5.0]}
    assert facts["provenance"]["options"] == options
    assert facts["provenance"]["model_digest"] == facts["model_digest"]
    text = (folder / "PROVENANCE.md").read_text()
    assert facts["model_digest"] in text
