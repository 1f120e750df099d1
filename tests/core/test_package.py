"""The package as people install and import it: its names, what it loads, the wheel, a clone."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.resources import files
from pathlib import Path

import pytest

import eomgen as eg
from tools.stubs import write

ROOT = Path(__file__).parents[2]
MODEL = ROOT / "examples" / "slider_crank.yaml"
TIMED = """
import sys, time
import numpy
start = time.perf_counter()
import eomgen
print(time.perf_counter() - start, *sorted({"sympy", "scipy", "rich", "click"} & set(sys.modules)))
"""
WITHOUT_SYMPY = """
import runpy, sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "sympy":
            raise ImportError("a model file must not need SymPy")

sys.meta_path.insert(0, Refuse())
runpy.run_module("eomgen", run_name="__main__")
"""


def shipped(folder: str, root: Path = ROOT) -> set[str]:
    """Files of a folder, as paths inside it."""
    top = root / folder
    return {str(p.relative_to(top)) for p in top.rglob("*") if p.is_file() and "__pycache__" not in p.parts}


def run(*words: object, cwd: Path, **variables: str) -> str:
    command, env = [sys.executable, *map(str, words)], os.environ | variables
    result = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.quick
def test_public_names() -> None:
    assert set(dir(eg)) == set(eg.__all__)
    for name in eg.__all__:
        assert getattr(eg, name) is not None
    m = eg.Model("cart")
    m.prismatic("slide", m.ground, m.body("box", mass=1.0))
    module = m.compile(target="numpy")
    kinds = (eg.Equations, eg.Module, eg.Trajectory)  # for annotations
    assert all(map(isinstance, (m.derive(), module, module.simulate(0.1)), kinds))
    tree = {k for k, value in vars(eg.errors).items() if isinstance(value, type) and issubclass(value, Exception)}
    assert tree <= set(eg.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = eg.nothing


def test_names_of_rotations() -> None:
    assert {"cos", "dot", "Any"}.isdisjoint(eg.rotations.__all__)
    assert all(getattr(eg.rotations, name) for name in eg.rotations.__all__)


def test_metadata_cannot_be_changed() -> None:
    m = eg.Model("mass")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    info = m.compile(target="numpy").layout.info
    with pytest.raises(AttributeError, match="method"):
        info.method = "x"
    assert info.latex is not type(info).latex


def test_import_is_cheap() -> None:
    runs = []
    for _ in range(8):  # the fastest of several: other processes share this machine
        seconds, *heavy = run("-c", TIMED, cwd=ROOT).split()
        assert heavy == []
        runs.append(float(seconds))
        if min(runs) < 0.1:
            break
    assert min(runs) < 0.1


@pytest.mark.parametrize("verb", ["run", "check", "derive", "generate"])
def test_a_model_file_needs_no_sympy(verb: str, tmp_path: Path) -> None:
    options = {"run": ["--end", "0.2"], "generate": ["--out", tmp_path / "made"]}.get(verb, [])
    run("-c", WITHOUT_SYMPY, verb, MODEL, *options, cwd=ROOT)
    with pytest.raises(AssertionError, match="a model file must not need SymPy"):
        run("-c", WITHOUT_SYMPY.replace("runpy.run", "import sympy; runpy.run"), verb, MODEL, cwd=ROOT)


def test_a_warm_run_loads_nothing_heavy() -> None:
    loaded = "import atexit, runpy, sys; atexit.register(lambda: print('loaded', *sys.modules)); "
    for _ in range(2):  # the first may have to compile
        code = f"{loaded}runpy.run_module('eomgen', run_name='__main__')"
        text = run("-c", code, "run", "--end", "0.2", MODEL, cwd=ROOT)
    names = {name.partition(".")[0] for name in text.rpartition("loaded ")[2].split()}
    assert "numpy" in names
    assert not names & {"scipy", "sympy", "rich", "Cython", "pandas", "matplotlib", "mujoco", "trimesh"}


def test_a_new_model_loads_what_it_uses(tmp_path: Path) -> None:
    script = f"import sys, eomgen; eomgen.load({str(MODEL)!r}).compile().simulate(0.1); print(*sys.modules)"
    loaded = run("-c", script, cwd=tmp_path, XDG_CACHE_HOME=str(tmp_path))
    names = [name for name in loaded.split() if name.partition(".")[0] == "eomgen"]
    assert len(names) <= 160
    assert not [name for name in names if "soil" in name or "muscle" in name or "components" in name]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist of a copy of this checkout, and the wheel built from that sdist."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    folder = tmp_path_factory.mktemp("copy")
    for name in listed.stdout.splitlines():
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes((ROOT / name).read_bytes())
    run("-m", "build", "--no-isolation", "--outdir", folder / "dist", folder, cwd=folder)
    return folder / "dist"


@pytest.mark.slow
@pytest.mark.thorough
def test_wheel_and_sdist_hold_everything(built: Path) -> None:
    copy = built.parent
    with zipfile.ZipFile(next(built.glob("*.whl"))) as wheel:
        names = set(wheel.namelist())
    with tarfile.open(next(built.glob("*.tar.gz"))) as sdist:
        sources = {name.partition("/")[2] for name in sdist.getnames()}
    for folder in ("templates", "examples"):
        inside = {name.removeprefix(f"eomgen/{folder}/") for name in names if f"eomgen/{folder}/" in name}
        assert inside == shipped(folder)
        assert {f"{folder}/{name}" for name in shipped(folder, copy)} <= sources
    assert {f"eomgen/{name}" for name in (*shipped("eomgen", copy), "model/element_methods.pyi", "module.pyi")} <= names
    assert sum(name.startswith("eomgen/_native.") and name.endswith(".so") for name in names) == 1
    assert not any(name.startswith(("tests/", "docs/", "benchmarks/")) for name in names)
    assert any(name.endswith("LICENSE") for name in names)


def compiled(folder: Path) -> list[str]:
    return [path.name for path in folder.glob("eomgen/_native*")]


@pytest.mark.slow
@pytest.mark.thorough
def test_the_wheel_works_away_from_the_checkout(built: Path, tmp_path: Path) -> None:
    home = tmp_path / "site"
    run("-m", "pip", "install", "--no-deps", "--quiet", "--target", home, next(built.glob("*.whl")), cwd=tmp_path)
    where = {"PYTHONPATH": str(home), "EOMGEN_CACHE_DIR": str(tmp_path / "cache")}
    origin = run("-c", "import eomgen; print(eomgen.__file__)", cwd=tmp_path, **where).strip()
    assert Path(origin).is_relative_to(home)
    run("-m", "eomgen", "examples", "pendulum", cwd=tmp_path, **where)
    out = run("-m", "eomgen", "run", "pendulum.yaml", "--end", "0.1", cwd=tmp_path, **where)
    assert "energy" in out
    listed = run("-m", "eomgen", "cache", "list", cwd=tmp_path, **where)
    assert "pendulum" in listed
    assert compiled(home) == compiled(ROOT)


@pytest.mark.slow
@pytest.mark.thorough
def test_a_build_without_a_compiler_asks_for_one(built: Path, tmp_path: Path) -> None:
    """And an editable install puts the extension module in the clone."""
    copy = built.parent
    hooks = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(*sys.argv[2:]))"
    assert "ziglang" in run("-c", hooks, "get_requires_for_build_wheel", cwd=copy, CC=str(tmp_path / "none"))
    assert "ziglang" not in run("-c", hooks, "get_requires_for_build_editable", cwd=copy)
    run("-c", hooks, "build_editable", tmp_path, cwd=copy)
    assert compiled(copy) == compiled(ROOT)


def test_the_editable_install_sees_templates_and_examples() -> None:
    for package, folder in {"eomgen.templates": "templates", "eomgen.examples": "examples"}.items():
        for name in shipped(folder):
            found = files(package).joinpath(*Path(name).parts)
            assert found.read_bytes() == (ROOT / folder / name).read_bytes()


@pytest.mark.thorough
def test_a_clone_works_with_its_own_templates_and_examples(tmp_path: Path) -> None:
    """Where eomgen is installed and Python is started in a clone, the clone's package is the one that is imported."""
    for folder in ("eomgen", "templates", "examples"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "templates" / "numpy" / "_core.py.j2").write_text("THE CLONE'S OWN = ")
    result = subprocess.run(
        [sys.executable, "-m", "eomgen", "run", "examples/pendulum.yaml", "--target", "numpy"],
        cwd=tmp_path, env=os.environ | {"EOMGEN_CACHE_DIR": str(tmp_path / "cache")}, capture_output=True, text=True,
    )  # fmt: skip
    assert "THE CLONE'S OWN" in result.stderr or "_core" in result.stderr
    assert result.returncode != 0


# -- types that a checker sees in a user's file, outside the package ---------------------------------------------------
#: An expression of a user's file -> the class that a checker must see.
SEEN = {
    "m": "Model",
    "rod": "BodyHandle",
    "m.revolute('hinge', m.ground, rod, coordinate='theta')": "JointHandle",
    "m.check()": "MechanismReport",
    "m.derive()": "Equations",
    "m.compile()": "Module",
    "eg.load('model.yaml')": "Model",
    "m.derive().velocities": "ByName",
    "m.derive().generalized_forces": "NamedSum",
    "m.derive().linearize().states[0]": "str",
    "m.derive().with_parameters(l=0.5)": "ReadingView",
    "m.derive().with_dynamicsymbols().free_bodies": "ByName",
    "mod.x0(theta=0.3)": "ndarray",
    "mod.rhs(0.0, mod.x0())": "ndarray",
    "mod.simulate(1.0)": "Trajectory",
    "mod.simulate(1.0)['theta']": "ndarray",
    "mod.simulate(1.0).q": "ndarray",
    "mod.simulate_many(1.0)": "Ensemble",
    "mod.linearize()": "Linearization",
    "mod.equilibrium()": "Equilibrium",
    "mod.modes()": "Modes",
    "mod.bind({'l': 0.5})": "Module",
    "m.compile(target='numpy', optimize=2)": "Module",
    "eg.load_example('slider_crank')": "Model",
    "m.draw(theta=0.3)": "Axes",
    "mod.draw({'theta': 0.3}, axes=True)": "Axes",
    "mod.draw_branches(theta=0.3)": "ndarray",
    "mod.page()": "InlinePage",
    "m.check().draw()": "Axes",
    "mod.simulate(1.0).plot('theta')": "Axes",
    "mod.simulate(1.0).plot('theta', kind='spectrum')": "Axes",
    "mod.simulate(1.0).plot('theta', ax=ax)": "Axes",
    "mod.simulate(1.0).animate('run.gif', fps=10, trace='rod')": "Path",
    "mod.simulate(1.0).animate(plot=['theta'])": "InlinePage",
    "mod.simulate(1.0).animate(format='gif')": "InlineFilm",
    "mod.simulate_many(1.0, rtol='1e-6').plot('theta')": "Axes",
    "mod.simulate('2*pi', rtol='1e-6', atol='1e-9', max_step='0.1', p={'l': 0.5})": "Trajectory",
    "mod.sensitivities(['l'], 1.0, rtol='1e-8')": "Sensitivities",
}
#: What may be several things, as a checker writes it.
UNIONS = {"mod.simulate(1.0).plot()": ("Axes", "ndarray"), "mod.simulate(1.0).plot('a', 'b')": ("Axes", "ndarray")}
BEGIN = """import eomgen as eg
import matplotlib.pyplot as plt
m = eg.Model("pendulum", gravity=(0, -9.81, 0))
rod = m.body("rod", mass=1, com=(0, -0.5, 0), inertia={"zz": 0.1})
mod = m.compile()
ax = plt.figure().add_subplot()
"""
#: A wrong line of a user's file -> what a checker says of it.
WRONG = {
    "mod.simulate(1.0).qq": '"Trajectory" has no attribute "qq"',
    "m.revolute('hinge', m.ground)": 'Missing positional argument "successor"',
    "mod.x0(theta=object())": "incompatible type",
    "mod.simulat(1.0)": 'Module has no attribute "simulat"; maybe "simulate"?',
    "mod.simulate(foo=1)": 'Unexpected keyword argument "foo"',
    "mod.simulate(1.0, rtol=object())": "incompatible type",
    "mod.simulate_many(1.0, foo=1)": 'Unexpected keyword argument "foo"',
    "m.hinge('A', m.ground, rod)": '"Model" has no attribute "hinge"',
    "m.gravty = (0, 0, 0)": '"Model" has no attribute "gravty"',
    "m.derive().mass_matrx": '"Equations" has no attribute "mass_matrx"',
    "m.compile(optimise=2)": 'Unexpected keyword argument "optimise"',
    "eg.load('robot.urdf', limit='off')": 'Unexpected keyword argument "limit"',
    "mod.draw(theta=[1])": "incompatible type",
    "mod.simulate(1.0).plot('theta').plott()": '"Axes" has no attribute "plott"',
    "mod.simulate(1.0).animate('run.gif', fsp=10)": 'Unexpected keyword argument "fsp"',
    "mod.simulate(1.0).animate(format='gfi')": "No overload variant",
}


def check(tmp_path: Path, text: str) -> list[str]:
    """Lines that mypy prints of a user's file, with what a wheel holds beside it."""
    write()
    site = tmp_path / "site"
    shutil.copytree(ROOT / "eomgen", site / "eomgen", ignore=shutil.ignore_patterns("__pycache__", "built"))
    (tmp_path / "mine.py").write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file=", "mine.py"]
    paths = {"MYPYPATH": str(site), "PATH": ""}
    done = subprocess.run(command, cwd=tmp_path, env=paths, capture_output=True, text=True)
    return (done.stdout + done.stderr).splitlines()


@pytest.mark.slow
@pytest.mark.thorough
def test_a_checker_names_results_and_finds_slips(tmp_path: Path) -> None:
    first = BEGIN.count("\n") + len(SEEN) + len(UNIONS) + 1
    text = BEGIN + "".join(f"reveal_type({expression})\n" for expression in (*SEEN, *UNIONS))
    lines = check(tmp_path, text + "".join(f"{line}\n" for line in WRONG))
    seen = [line.partition('Revealed type is "')[2] for line in lines if "Revealed type is" in line]
    names = [re.match(r"(?:builtins\.)?(?:[\w.]+\.)?(\w+)", one) for one in seen]
    assert dict(zip(SEEN, (name[1] if name else "" for name in names), strict=False)) == SEEN, lines
    for several, one in zip(UNIONS.values(), seen[len(SEEN) :], strict=True):
        assert all(re.search(rf"\b{name}\b", one) for name in several), one
        assert "Any" not in one.replace("tuple[Any, ...]", "").replace("dtype[Any]", ""), one
    errors: dict[int, str] = {}
    for line in lines:
        if found := re.match(r"mine\.py:(\d+): error: (.*)", line):
            errors.setdefault(int(found[1]), found[2])
    assert sorted(errors) == list(range(first, first + len(WRONG))), lines
    for (wrong, expected), said in zip(WRONG.items(), (errors[k] for k in sorted(errors)), strict=True):
        assert expected in said, wrong
