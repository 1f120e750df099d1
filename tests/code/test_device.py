"""Functions and runs of many states on a GPU: device code compiled for the host, by NVRTC, and on a GPU where one is.

That the functions are the module's is in test_targets.
"""

import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from command import run
from host_device import HostArray, HostDevice
from refusals import refuses

import eomgen as eg

TIGHT = {"rtol": 1e-10, "atol": 1e-10}
EXAMPLES = sorted(path.stem for path in models.EXAMPLES.glob("*.yaml"))


class OnGpu:
    """An array of another library: it says where it lies and which memory it keeps, and no more."""

    def __init__(self, array: Any) -> None:
        self.array, self.__cuda_array_interface__ = array, array.__cuda_array_interface__


@pytest.fixture(params=["host", pytest.param("gpu", marks=pytest.mark.needs("a GPU"))])
def device(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """A device of the test's own; None is the first GPU."""
    return HostDevice(tmp_path) if request.param == "host" else None


def foreign(model: Any, x: np.ndarray) -> Any:
    """Numbers that lie on the device already, as another library holds them."""
    return HostArray(x) if isinstance(model.device, HostDevice) else OnGpu(model.device.put(x))


def pair(name: str, device: Any, target: str = "numpy") -> tuple[Any, Any]:
    equations = models.build(name).derive()
    return equations.to_cuda(device), equations.compile(target=target, **(models.IN_C if target == "cython" else {}))


def starts(module: Any, count: int = 4) -> np.ndarray:
    random = np.random.default_rng(1)
    x = module.x0()
    return np.array([module.project(x + 0.05 * random.normal(size=x.size)) for _ in range(count)]).T


def test_arrays_of_the_device_stay_there(device: Any) -> None:
    model, _ = pair("double_pendulum", device)
    x = np.random.default_rng(0).normal(size=(4, 100))
    wanted = model.rhs(0.0, x)
    found = model.rhs(0.0, foreign(model, x))
    assert not isinstance(found, np.ndarray)
    np.testing.assert_array_equal(found.numpy(), wanted)
    again = model.rhs(0.0, found)  # what comes out goes in
    np.testing.assert_array_equal(again.numpy(), model.rhs(0.0, wanted))
    if isinstance(model.device, HostDevice):
        before = model.device.copies
        model.rhs(0.0, foreign(model, x))
        assert model.device.copies == before  # t and u are there from the call before
    else:
        told = found.__cuda_array_interface__
        assert (told["shape"], told["typestr"], told["version"]) == ((4, 100), "<f8", 3)


def test_times_and_inputs_of_the_last_call_are_not_those_of_the_next(device: Any) -> None:
    m = eg.Model("driven")
    m.prismatic("d", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="x")
    m.input("F", 2.0)
    m.torque("push", "d", "F*(1 + t)")
    model, x = m.derive().to_cuda(device), np.zeros((2, 3))
    for t, u, force in ((0.0, None, 2.0), (1.0, None, 4.0), (0.0, [5.0], 5.0), (0.0, None, 2.0), (3.0, [1.0], 4.0)):
        np.testing.assert_array_equal(model.rhs(t, x, u=u)[1], force)
    np.testing.assert_array_equal(model.rhs(np.array([0.0, 1.0, 2.0]), x, u=[[1.0, 2.0, 3.0]])[1], [1.0, 4.0, 9.0])
    with pytest.raises(ValueError, match="read-only"):
        model.u[0] = 3.0


def test_a_state_that_fails_leaves_the_others_alone(device: Any) -> None:
    model, module = pair("slider_crank", device)
    x = starts(module, 3)
    good, runs = model.rhs(0.0, x), model.simulate_many((0.0, 0.05), x)
    x[2, 1] = 5.0  # cannot be closed
    found, status = model.rhs(0.0, x, status=True)
    np.testing.assert_array_equal(found[:, [0, 2]], good[:, [0, 2]])
    assert np.isnan(found[:, 1]).any()
    assert ((status > 0) == [False, True, False]).all()
    failed = model.simulate_many((0.0, 0.05), x)
    np.testing.assert_array_equal(failed.x[:, [0, 2]], runs.x[:, [0, 2]])
    assert failed.status.tolist() == [0, -100, 0]
    few = model.simulate_many((0.0, 0.2), x[:, [0, 2]], max_steps=3, **TIGHT)
    assert (few.status == -104).all()
    assert (few.steps == 3).all()


def test_wrong_calls_are_refused_by_name(tmp_path: Path) -> None:
    model, _ = pair("double_pendulum", HostDevice(tmp_path))
    x = np.zeros((4, 3))
    wrong: list[tuple[Any, str]] = [
        (lambda: model.rhs(0.0, x.T), "EG-SHAPE x (4,)"),
        (lambda: model.rhs(0.0, x, np.ones((5, 2))), "EG-SHAPE p (5,)"),
        (lambda: model.rhs([0.0, 1.0], x), "EG-SHAPE t"),
        (lambda: model.rhs(0.0), "EG-MISSING x"),
        (lambda: model.mass_matrix(x[:2], x=x), "EG-NAME-UNKNOWN mass_matrix"),
        (lambda: model.inverse_dynamics(x[:2, 0], x[:2], x[:2]), "EG-SHAPE columns"),
        (lambda: model.rhs(0.0, x[:, 0], np.ones((5, 2))), "EG-SHAPE x"),
        (lambda: model.rhs(0.0, "state"), "EG-TYPE numbers"),
        (lambda: model.simulate_many(1.0, x, method="Radau"), "EG-CHOICE Radau DOP853 RK4"),
        (lambda: model.simulate_many(1.0, x, method="RK4"), "EG-MISSING RK4 step="),
        (lambda: model.simulate_many(1.0, x, t_eval=[2.0]), "EG-RANGE t_eval"),
        (lambda: model.simulate_many(1.0, x.T), "EG-SHAPE x0 (4,)"),
        (lambda: model.simulate_many(1.0, x[:, :0]), "EG-SHAPE x0"),
    ]
    for call, words in wrong:
        refuses(words, call)
    m = eg.Model("driven")
    m.prismatic("d", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="x")
    m.input("F", signal="sin(t)")
    m.torque("push", "d", "F")
    refuses("EG-UNSUPPORTED F", lambda: m.derive().to_cuda(HostDevice(tmp_path)).simulate_many(1.0, np.zeros((2, 1))))


# Runs.


@pytest.mark.parametrize("name", ["double_pendulum", pytest.param("slider_crank", marks=pytest.mark.thorough)])
def test_runs_take_the_steps_of_simulate(name: str, device: Any) -> None:
    """Each with steps, parameters and samples of its own; and back again."""
    model, module = pair(name, device, "cython")
    x0, times = starts(module), np.linspace(0.0, 0.5, 6)
    p = np.repeat(model.p[:, None], 4, axis=1) * [1.0, 1.05, 1.1, 1.0]
    runs = model.simulate_many((0.0, 0.5), x0, p, t_eval=times, method="DOP853", **TIGHT)
    assert (runs.status == 0).all()
    assert runs.samples.shape == (module.n_x, 6, 4)
    for k in range(4):
        bound = module.bind(p=p[:, k])
        one = bound.simulate((0.0, 0.5), x0[:, k], method="DOP853", t_eval=times, **TIGHT)
        assert runs.steps[k] == len(bound.simulate((0.0, 0.5), x0[:, k], method="DOP853", **TIGHT).t) - 1
        assert runs.evaluations[k] == one.nfev
        np.testing.assert_allclose(runs.samples[:, :, k], one.x, rtol=0, atol=1e-9 * np.abs(one.x).max())
    back = model.simulate_many((0.5, 0.0), runs.x, p, **TIGHT)
    np.testing.assert_allclose(back.x, x0, rtol=0, atol=1e-6)
    plain = model.simulate_many(0.25, x0, method="RK4", step=1e-3)
    assert (plain.steps == 250).all()
    one = module.simulate((0.0, 0.25), x0[:, 0], method="RK4", step=1e-3)
    np.testing.assert_allclose(plain.x[:, 0], one.x[:, -1], rtol=0, atol=1e-11 * np.abs(one.x).max())


def bouncing(**options: Any) -> eg.Model:
    m = eg.Model("ball", gravity=(0, "-g", 0))
    m.parameter("g", 10.0)
    m.prismatic("h", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="y")
    m.initial(y=1.0)
    m.event("floor", "y", direction=-1, reset={"y_dot": "-0.5*y_dot"}, **options)
    return m


@pytest.mark.parametrize("stop", [False, True])
def test_events_reset_the_state_as_the_closed_form_says(stop: bool, device: Any) -> None:
    """A ball falls from h in sqrt(2 h/g), and leaves the floor with half the speed: up and down takes as long."""
    model, g = bouncing(**({"terminal": 2} if stop else {})).derive().to_cuda(device), 10.0
    heights = np.array([1.0, 2.0, 0.5])
    end = 1.3 * float(np.sqrt(2 * 2.0 / g))
    runs = model.simulate_many((0.0, end), np.array([heights, np.zeros(3)]), **TIGHT)
    first = np.sqrt(2 * heights / g)
    np.testing.assert_allclose(runs.notes[1, 0], first, rtol=1e-9)
    happened = 1 + (2 * first < end).astype(int) + (2.5 * first < end) + (2.75 * first < end)
    if stop:
        assert runs.status.tolist() == (happened >= 2).astype(int).tolist()
        np.testing.assert_allclose(runs.t, np.minimum(2 * first, end), rtol=1e-9)
    else:
        np.testing.assert_array_equal(runs.noted, happened)
        speed = 0.5 * g * first[1] - g * (end - first[1])
        assert runs.x[1, 1] == pytest.approx(speed, abs=1e-8)


# Packages, NVRTC, and what only a GPU shows.

CHILD = """
import sys
from pathlib import Path
import numpy as np
sys.path[:0] = [{folder!r}, {tests!r}]
import slider_crank as model
from host_device import HostDevice
assert not [name for name in sys.modules if name.partition(".")[0] in ("sympy", "scipy", "eomgen", "cuda")]
loaded = model.load(HostDevice(Path({work!r})))
x = np.repeat(loaded.x0[:, None], 4, axis=1)
assert np.ptp(loaded.rhs(0.0, x), axis=1).max() == 0.0
assert (loaded.simulate_many((0.0, 0.1), x).status == 0).all()
print(loaded.rhs(0.0, x)[:, 0].tolist())
"""


def text_of(name: str, folder: Path) -> str:
    file = models.EXAMPLES / f"{name}.yaml"
    assert run("generate", file, "--out", folder, "--target", "cuda").code == 0
    return (folder / name / f"{name}.cu").read_text(encoding="utf-8")


def test_a_package_stands_alone(tmp_path: Path) -> None:
    text = text_of("slider_crank", tmp_path)
    assert "slider_crank_rhs_batch" in text
    tests, work = str(Path(__file__).parents[1]), tmp_path / "work"
    work.mkdir()
    script = CHILD.format(folder=str(tmp_path), tests=tests, work=str(work))
    done = subprocess.run([sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    module = models.build("slider_crank").compile(target="numpy")
    expected = module.rhs(0.0, module.x0())
    found = [float(x) for x in done.stdout.strip()[1:-1].split(",")]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    readme = (tmp_path / "slider_crank" / "README.md").read_text(encoding="utf-8")
    assert "`inverse_dynamics(q, v, a, p=None, u=None, t=0.0)`" in readme


def test_without_a_gpu_a_named_error_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("cuda", "cuda.bindings", "cuda.core"):
        monkeypatch.setitem(sys.modules, name, None)
    refuses("EG-PACKAGE-MISSING installed", lambda: models.build("pendulum").derive().to_cuda())


def ptx_of(text: str, wanted: list[str]) -> str:
    """What NVRTC makes of a text for an H100."""
    from cuda.bindings import nvrtc

    def check(found: Any) -> Any:
        assert found[0] == nvrtc.nvrtcResult.NVRTC_SUCCESS, found
        return found[1] if len(found) == 2 else None

    program = check(nvrtc.nvrtcCreateProgram(text.encode(), b"model.cu", 0, [], []))
    options = [b"--gpu-architecture=compute_90", b"--Ofast-compile=max", *(f"-D{name}".encode() for name in wanted)]
    check(nvrtc.nvrtcCompileProgram(program, len(options), options))
    made = b" " * check(nvrtc.nvrtcGetPTXSize(program))
    check(nvrtc.nvrtcGetPTX(program, made))
    return made.decode(errors="replace")


@pytest.mark.thorough
@pytest.mark.needs("NVRTC")
@pytest.mark.parametrize("name", EXAMPLES)
def test_nvrtc_takes_the_code_of_every_example(name: str, tmp_path: Path) -> None:
    """And the stack is known beforehand: nothing is called by a pointer, and nothing calls itself."""
    text = text_of(name, tmp_path)
    kernels = set(re.findall(r"EOMGEN_KERNEL void (\w+)\(", text))
    assert f"{name}_rhs_batch" in kernels
    wanted = sorted(set(re.findall(r"EOMGEN_WANT_\w+", text)) - {"EOMGEN_WANT_RK4"})
    ptx = ptx_of(text, wanted)
    assert set(re.findall(r"\.entry (\w+)\(", ptx)) == {kernel for kernel in kernels if "_rk4_" not in kernel}
    assert not re.search(r"^\s*call[.\w]*\s+(\([^)]*\),\s*)?%", ptx, re.MULTILINE)
    parts = re.split(r"^(?:\.\w+ )*\.(?:entry|func)\s+(?:\([^)]*\)\s*)?(\w+)\s*\(", ptx, flags=re.MULTILINE)
    call = re.compile(r"^\s*call[.\w]*\s+(?:\([^)]*\),\s*)?(\w+)", re.MULTILINE)
    calls = {name: set(call.findall(body)) for name, body in zip(parts[1::2], parts[2::2], strict=True) if "{" in body}
    tuple(TopologicalSorter(calls).static_order())  # CycleError


@pytest.mark.needs("a GPU")
def test_a_gpu_has_many_states_and_gives_memory_back() -> None:
    """Threads, blocks and the columns that the last block lacks; more than its memory, one after the other."""
    model, module = pair("double_pendulum", None)
    x = np.random.default_rng(1).normal(size=(4, 70_001))
    found = model.rhs(0.0, x)
    for k in (0, 31, 32, 127, 128, 65_535, 65_536, 70_000):
        np.testing.assert_array_equal(found[:, k], model.rhs(0.0, x[:, k]))
        np.testing.assert_allclose(found[:, k], module.rhs(0.0, x[:, k]), rtol=1e-10, atol=1e-12)
    command = ["nvidia-smi", "--query-gpu=memory.total", "--format=csv,noheader,nounits"]
    total = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]) * 1e6
    x = np.random.default_rng(1).normal(size=(4, 4_000_000))
    for _ in range(int(1.2 * total / x.nbytes / 2)):
        model.rhs(0.0, x)
