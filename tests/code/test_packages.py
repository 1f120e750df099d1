"""Exported packages and wheels: they run with NumPy alone, say whence they are, test themselves, replace their own."""

import hashlib
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib import util
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from command import run
from packages import built
from sweeps import part_of

import eomgen as eg
from eomgen.api.generation import generate

#: Only NumPy: everything else that eomgen uses is refused.  Each call that the package lists has the shape it says.
ALONE = """
import json, re, sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("eomgen", "sympy", "jinja2", "scipy", "Cython", "click"):
            raise ImportError(name)
sys.meta_path.insert(0, Refuse())
import numpy as np
import {name} as m
x = m.x0()
n_q, n_v = len(m.q_names), len(m.v_names)
q, v = x[:n_q], x[n_q:]  # states follow the velocities
dof = m.minimal.x0().size // 2 if getattr(m, "minimal", None) is not None else 0
values = dict(t=0.0, x=x, q=q, v=v, a=v, q_i=m.minimal.x0()[:dof] if dof else q, v_i=v[:dof], a_i=v[:dof], span=0.01,
    w=np.ones(n_v), d=np.ones(2 * n_v + n_q), x_min=m.minimal.x0() if dof else x)
if getattr(m, "dae", None) is not None:
    values |= dict(y=np.ones(m.dae.n_y), yp=np.ones(m.dae.n_y), cj=2.0)
tried, wrong = 0, []
for call, shape in re.findall(r"^    (\\w.*\\)) -> (\\(.*?\\)|Module|Trajectory): ", m.__doc__, re.M):
    if not shape.startswith("("):
        continue
    text = re.sub(r"\\*\\*\\w+", "", call)
    try:
        found = eval("m." + text, {{"m": m, **values}})
    except m.EomgenError as error:
        wrong.append((call, str(error), shape))
        continue
    sizes = str(tuple(np.shape(part) for part in found))[1:-1] if isinstance(found, tuple) else str(np.shape(found))
    tried += 1
    if sizes != shape:
        wrong.append((call, sizes, shape))
for name in m.__all__:
    getattr(m, name)
try:
    end = m.simulate(0.01).x[:, -1].tolist()
except m.EomgenError as error:
    end = str(error)
try:
    m.simulate(0.01, method="BDF")
except m.EomgenError as error:
    told = str(error)
print(json.dumps(dict(rhs=m.rhs(0.0, x).tolist(), tried=tried, wrong=wrong, end=end, told=told)))
"""


def package(model: eg.Model, folder: Path, *words: str, target: str = "cython") -> Path:
    model.save(folder / "model.yaml")
    done = run("generate", folder / "model.yaml", "--out", folder, "--target", target, *words)
    assert done.code == 0, done.err
    return folder / model.name


def alone(folder: Path, script: str, *words: str) -> Any:
    """What a script prints in a process that starts in a folder and finds packages there."""
    done = subprocess.run(
        [sys.executable, "-c", script, *words], cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def touching() -> eg.Model:
    """A ball on a floor."""
    m = eg.Model("touching", gravity=(0, -9.81, 0))
    ball = m.body("ball", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, ball)
    circle = {"shape": "circle", "on": ball, "radius": 0.1}
    m.contacts("floor", circle, {"shape": "half_plane", "on": m.ground}, {"stiffness": 1e4})
    m.initial(j_y=0.0999, j_x_dot=1.0)
    return m


MODELS = ("slider_crank", "touching", "double_pendulum", "rolling_disc", "satellite", "gait_leg")


@pytest.mark.parametrize("name", part_of(MODELS, lambda name: name == "slider_crank"))
def test_a_package_runs_with_numpy_alone(name: str, tmp_path: Path) -> None:
    """Its calls have the shapes that its documentation lists, its numbers are the module's."""
    model = touching() if name == "touching" else models.build(name)
    built(package(model, tmp_path))
    found, module = alone(tmp_path, ALONE.format(name=name)), model.compile(target="numpy")
    expected = module.rhs(0.0, module.x0())
    np.testing.assert_allclose(found["rhs"], expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    assert found["tried"] >= 12
    assert found["wrong"] == []
    assert "scipy" in found["told"].lower()


@pytest.mark.parametrize(("name", "forms"), [("satellite", {"dae"}), ("pendulum", {"minimal", "dae"})])
def test_a_package_lists_the_forms_that_it_has(name: str, forms: set[str], tmp_path: Path) -> None:
    """A model turned by Euler parameters has no minimal form."""
    folder = built(package(models.build(name), tmp_path))
    script = f"import {name} as m, json; print(json.dumps([n for n in m.__all__ if getattr(m, n) is not None]))"
    every = {"minimal", "canonical", "dae"}
    assert every & set(alone(tmp_path, script)) == forms
    stub = (folder / "__init__.pyi").read_text()
    assert {form for form in every if f"\n{form}: " in stub} == forms


@pytest.mark.parametrize(
    "target", part_of(["cython", "c", "casadi", "jax", "cuda"], lambda target: target in ("cython", "c"))
)
def test_packages_say_whence_they_are_and_whose(target: str, tmp_path: Path) -> None:
    m = eg.Model("swing", gravity=(0, -9.81, 0), doc='It says """hello""" \\n */ and {{ more }} ?? \x41\nsecond line')
    m.revolute("A", m.ground, m.body("bob", mass=1.0, com=(0, -1, 0)), coordinate="theta")
    folder = package(m, tmp_path, "--method", "recursive", target=target)
    facts = json.loads((folder / "model.json").read_text())
    found = facts["provenance"]
    assert (found["model"], found["options"]["target"]) == (m.name, target)
    assert found["options"]["method"] == "recursive"
    assert found["versions"]["numpy"] == np.__version__
    assert {"python", "sympy", "eomgen"} <= found["versions"].keys()
    assert found["model_digest"] == facts["model_digest"]
    text = (folder / "README.md").read_text()
    assert facts["model_digest"] in text
    assert f"| version of numpy | `{np.__version__}` |" in text
    told = (folder / "LICENSE.txt").read_text()
    assert told.endswith((models.EXAMPLES.parent / "LICENSE").read_text())
    assert "eomgen claims no right in them" in told
    for file in folder.glob("*.py"):
        compile(file.read_text(), file.name, "exec")
    if target == "cython":
        project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
        assert project["description"].startswith('It says """hello"""')
        assert (folder / "py.typed").exists()
        unbuilt = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import swing"
        done = subprocess.run([sys.executable, "-c", unbuilt], capture_output=True, text=True, check=False)
        assert done.stderr.endswith(f"; build and install the package first: pip install {folder}\n")
    if target == "c":  # as its README says for processors without an operating system, beside a program
        words = re.findall(r"`([^`]*)`", next(line for line in text.splitlines() if "gc-sections" in line))
        assert words[:2] == ["*.c", "swing_real_time.c"]
        (folder / words[1]).unlink()
        (folder / "main.c").write_text("int main(void) { return 0; }\n")
        sources = [file.name for file in folder.glob(words[0])]
        subprocess.run(["gcc", *words[-2].split(), words[-1], *sources, "-lm", "-o", "swing"], cwd=folder, check=True)


@pytest.mark.thorough
@pytest.mark.parametrize("target", ["cython", "c", "cuda"])
def test_the_same_model_gives_the_same_files_under_any_hash_seed(target: str, tmp_path: Path) -> None:
    digests = set()
    for seed in ("1", "2"):
        for name in ("slider_crank", "double_pendulum"):
            folder, file = tmp_path / seed, models.EXAMPLES / f"{name}.yaml"
            command = [sys.executable, "-m", "eomgen", "generate", str(file), "--target", target, "--out", str(folder)]
            subprocess.run(command, env={**os.environ, "PYTHONHASHSEED": seed}, check=True)
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        text = b"".join(str(path.relative_to(folder)).encode() + path.read_bytes() for path in files)
        digests.add(hashlib.sha256(text).hexdigest())
    assert len(digests) == 1


FAULTS = {
    "a figure": ("tests/recorded.json", '"call":"rhs","arguments":[0.0,[-1.57', '"call":"rhs","arguments":[0.0,[-1.56'),
    "nothing": ("model.json", "", ""),
    "a formula": ("pendulum.c", "sines + 0, cosines + 0", "cosines + 0, sines + 0"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_its_tests_see_what_is_wrong(fault: str, tmp_path: Path) -> None:
    """In the folder, where they need no installation."""
    folder = package(models.build("pendulum"), tmp_path)
    file, old, new = FAULTS[fault]
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    built(folder)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    env = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == (old == new), done.stdout
    assert ("passed" if old == new else "failed") in done.stdout


# Writing over what is there.


def files_of(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_stale_files_go_and_those_of_others_stay(tmp_path: Path) -> None:
    m = models.build("pendulum")
    folder = package(m, tmp_path, target="c")
    assert (folder / "pendulum.c").exists()
    (folder / "notes.txt").write_text("mine")
    (folder / "sub").mkdir()
    (folder / "sub" / "mine.py").write_text("mine")
    package(m, tmp_path)
    (tmp_path / "fresh").mkdir()
    fresh = package(m, tmp_path / "fresh")
    assert files_of(folder) == files_of(fresh) | {"notes.txt", "sub/mine.py"}
    assert json.loads((folder / "model.json").read_text())["target"] == "cython"
    assert folder.stat().st_mode == (folder / "sub").stat().st_mode
    assert {path.name for path in tmp_path.iterdir()} == {"pendulum", "fresh", "model.yaml"}  # nothing half written


def refused(folder: Path, words: str, target: str = "c") -> None:
    found = run("generate", models.EXAMPLES / "pendulum.yaml", "--out", folder, "--target", target)
    assert found.code in (1, 2)
    assert words in found.err


def test_a_file_of_the_user_is_never_overwritten(tmp_path: Path) -> None:
    folder = package(models.build("pendulum"), tmp_path)
    (folder / "Makefile").write_text("mine")
    refused(tmp_path, "Makefile exists and was not written by eomgen")
    assert (folder / "Makefile").read_text() == "mine"
    assert (folder / "setup.py").exists()


@pytest.mark.parametrize("held", ["{}", "not json", '["abi"]', "[" * 99999, None])
def test_a_folder_of_someone_else_is_refused(held: str | None, tmp_path: Path) -> None:
    (tmp_path / "pendulum").mkdir()
    file = tmp_path / "pendulum" / ("other.txt" if held is None else "model.json")
    file.write_text(held or "")
    refused(tmp_path, "not a generated package")
    assert file.read_text() == (held or "")


@pytest.mark.quick
def test_names_that_lead_out_of_the_folder_are_not_removed(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("")
    folder = package(models.build("pendulum"), tmp_path)
    facts = json.loads((folder / "model.json").read_text())
    facts["files"] = [*facts["files"], "../precious"]
    (folder / "model.json").write_text(json.dumps(facts))
    package(models.build("pendulum"), tmp_path)
    assert (tmp_path / "precious").exists()


# Wheels.


def wheel(folder: Path, *words: str, name: str = "pendulum") -> Path:
    done = run("generate", models.EXAMPLES / f"{name}.yaml", "--out", folder, "--wheel", *words)
    assert done.code == 0, done.err
    (made,) = folder.glob("*.whl")
    return made


@pytest.mark.quick
def test_target_numpy_is_for_a_session_and_the_refusal_names_the_wheel(tmp_path: Path) -> None:
    found = run("generate", models.EXAMPLES / "pendulum.yaml", "--out", tmp_path, "--target", "numpy")
    assert found.code == 2
    assert "--target cython --wheel" in found.err
    with pytest.raises(eg.UsageError) as error:
        generate(models.build("pendulum"), tmp_path, target="numpy")
    assert error.value.code == "EG-UNSUPPORTED"
    assert not list(tmp_path.iterdir())


BITS = """
import json, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import numpy as np, pytest
import pendulum as p
x = np.array([0.4, -1.5])
many = np.stack([x, 2 * x, 3 * x], axis=-1)
run = p.simulate((0.0, 2.0))
found = [p.rhs(0.1, x), p.rhs(t=0.1, x=x, out=np.empty(2)), p.rhs(0.1, many), p.energy(x), p.energy(x=many)]
found = [one.tolist() for one in (*found, p.jacobian(0.1, x), p.outputs(0.1, x), run.t, run.x)]
before = sys.getrefcount(type(p.rhs))
for _ in range(1000):
    p.bind(p={"m": 2.0}).rhs
assert p.step(0.0, x, 1e-6).shape == x.shape and p.Signal([0, 1], [0, 2])(0.5) == 1.0
code = pytest.main(["-q", "-p", "no:cacheprovider", "--pyargs", "pendulum"])
digest = p.metadata["provenance"]["model_digest"]
print("\\n" + json.dumps([found, int(code), sys.getrefcount(type(p.rhs)) - before, digest]))
"""


@pytest.mark.thorough
def test_a_wheel_in_c_has_the_bits_of_the_module_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two builds give the same bytes; no folder of this computer and no source is in them; its own tests pass."""
    monkeypatch.setenv("CFLAGS", "-O0")
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    made, other = (wheel(tmp_path / place, "--target", "cython") for place in ("one", "another place"))
    assert made.name == other.name
    assert made.read_bytes() == other.read_bytes()
    assert made.name.startswith("pendulum-0.1.0-cp311-abi3-")
    if sys.platform.startswith("linux"):
        assert ("manylinux" in made.name) == (util.find_spec("auditwheel") is not None)
    with zipfile.ZipFile(made) as file:
        file.extractall(tmp_path / "there")
        names, core = file.namelist(), file.read("pendulum/_native.abi3.so")
        about = file.read("pendulum-0.1.0.dist-info/METADATA").decode()
    files = {"__init__.pyi", "py.typed", "model.json", "tests/test_recorded.py", "tests/recorded.json"}
    assert {f"pendulum/{name}" for name in files} <= {*names}
    assert "pendulum-0.1.0.dist-info/licenses/LICENSE.txt" in names
    assert re.findall(r"^Requires-Dist: (\w+)", about, re.MULTILINE)[0] == "numpy"
    for place in (sys.base_prefix, str(Path.home()), str(tmp_path)):
        assert place.encode() not in core
    assert not [name for name in names if name.endswith(("setup.py", ".c", ".pyx"))]
    found, code, references, digest = alone(tmp_path / "there", BITS)
    assert (code, abs(references) < 10) == (0, True)  # kernels that are gone leave their type alone
    mod, x = models.build("pendulum").compile(), np.array([0.4, -1.5])
    many, run_here, rhs = np.stack([x, 2 * x, 3 * x], axis=-1), mod.simulate((0.0, 2.0)), mod.rhs(0.1, x)
    here = [rhs, rhs, mod.rhs(0.1, many), mod.energy(x), mod.energy(many), mod.jacobian(0.1, x), mod.outputs(0.1, x)]
    for mine, theirs in zip([*here, run_here.t, run_here.x], found, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert digest == mod.metadata["model_digest"]


@pytest.mark.quick
@pytest.mark.parametrize("target", ["c", "fmu", "casadi", "jax", "cuda"])
def test_wheels_of_other_targets_are_refused(target: str, tmp_path: Path) -> None:
    found = run("generate", models.EXAMPLES / "pendulum.yaml", "--out", tmp_path, "--target", target, "--wheel")
    assert found.code == 2
    assert "for target cython" in found.err
    assert not list(tmp_path.iterdir())


def test_flags_for_this_processor_alone_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CFLAGS", "-O2 -march=native")
    found = run("generate", models.EXAMPLES / "pendulum.yaml", "--out", tmp_path, "--target", "cython", "--wheel")
    assert found.code == 2
    assert "CFLAGS has -march=native" in found.err


@pytest.mark.thorough
def test_a_wheel_is_not_written_through_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CFLAGS", "-O0")
    (tmp_path / "elsewhere").write_text("kept")
    made = wheel(tmp_path / "out")
    made.unlink()
    made.symlink_to(tmp_path / "elsewhere")
    words = ("--out", tmp_path / "out", "--wheel")
    found = run("generate", models.EXAMPLES / "pendulum.yaml", *words)
    assert found.code in (1, 2)
    assert "symbolic link" in found.err
    assert (tmp_path / "elsewhere").read_text() == "kept"


def test_laws_of_pairs_are_short(tmp_path: Path) -> None:
    """Those of edges and corners end where nothing touches, before shares of energy; ellipsoids take few statements."""
    m = eg.Model("laws")
    body = m.body("body", mass=1, inertia=(1, 1, 1))
    m.free("joint", m.ground, body)
    egg, rod = {"shape": "ellipsoid", "semi_axes": (0.1, 0.2, 0.3)}, {"shape": "capsule", "length": 1, "radius": 0.1}
    m.contacts("eggs", {**egg, "on": body}, {**egg, "on": m.ground}, {"stiffness": 1e5})
    m.contacts("edges", {"shape": "cuboid", "size": (1, 2, 3), "on": body}, {**rod, "on": m.ground}, {"stiffness": 1e5})
    folder = package(m, tmp_path, target="c")
    laws = dict(
        law.split("(", 1) for path in folder.glob("*pairs*.c") for law in path.read_text().split("\nstatic flag ")[1:]
    )
    assert (
        sum(law.count("\n    const real ") for name, law in laws.items() if re.search("ellipsoid_[0-9_]+$", name))
        < 1750
    )
    shared = [law for name, law in laws.items() if re.search("edge_axis_|rod_rounded_corner_", name)]
    assert sum(0 < law.find("EOMGEN_REJECT(0.0 >= ") < 0.15 * len(law) for law in shared) >= 2
