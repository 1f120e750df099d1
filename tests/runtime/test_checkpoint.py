"""A run that was killed goes on from its checkpoint to the last bit; what is of another run, or damaged, is refused."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.runtime.arrays import read_arrays, sealed
from eomgen.simulation.checkpoint import Checkpoint

EXAMPLES = files("eomgen.examples")


class Killed(BaseException):
    """In place of a kill, right after a checkpoint was written."""


@pytest.fixture(scope="module")
def pendulum() -> Any:
    return eg.load(EXAMPLES / "double_pendulum.yaml").compile()


@pytest.fixture(scope="module")
def crank() -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile()


@pytest.fixture(scope="module")
def plain() -> Any:
    return eg.load(EXAMPLES / "double_pendulum.yaml").compile(target="numpy")


def bouncing(**event: Any) -> eg.Model:
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    ball = m.body("ball", mass=1.0)
    m.prismatic("J", m.ground, ball, axis="y", coordinate="h")
    m.initial(h=1.0)
    m.event("floor", "h", direction=-1, **event)
    m.event("apex", "h_dot", direction=-1)
    return m


@pytest.fixture(scope="module")
def ball() -> Any:
    return bouncing(reset={"h_dot": "-0.98*h_dot"}).compile()


@pytest.fixture
def killed(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Let the process end after so many writings; 0: never."""
    save = Checkpoint.save

    def kill_after(count: int) -> None:
        left = [count]

        def saving(self: Checkpoint, arrays: dict[str, Any]) -> None:
            save(self, arrays)
            left[0] -= 1
            if left[0] == 0:
                raise Killed

        monkeypatch.setattr(Checkpoint, "save", saving)

    return kill_after


def require_same(a: Any, b: Any) -> None:
    """Every bit of two trajectories."""
    assert a.t.tobytes() == b.t.tobytes()
    assert a.x.tobytes() == b.x.tobytes()
    assert [t.tobytes() for t in a.t_events] == [t.tobytes() for t in b.t_events]
    assert [x.tobytes() for x in a.x_events] == [x.tobytes() for x in b.x_events]
    assert a.metadata == b.metadata
    if a.metadata["options"] and a._sample is not None:
        times = np.linspace(a.t[0], a.t[-1], 301)
        assert a.at(times).x.tobytes() == b.at(times).x.tobytes()


def go_through(module: Any, file: Path, killed: Callable[[int], None], kills: int, **run: Any) -> None:
    """Kill a run several times, and compare what comes of it in the end, and of its finished file."""
    whole = module.simulate(**run)
    for k in range(kills):
        killed(k + 1)
        with pytest.raises(Killed):
            module.simulate(checkpoint=file, checkpoint_every=0.0, **run)
    killed(0)
    require_same(whole, module.simulate(checkpoint=file, resume=True, **run))
    require_same(whole, module.simulate(checkpoint=file, **run))


COMPILED = [
    {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14},
    {"method": "RK45", "rtol": 1e-9, "t_eval": np.linspace(0, 60, 501)},
    {"method": "RK23", "rtol": 1e-6, "dense_output": True},
    {"method": "Radau", "rtol": 1e-7, "dense_output": True, "t_eval": np.linspace(0, 60, 77)},
    {"method": "Taylor", "rtol": 1e-13, "events": {"low": "theta1", "fast": "bend_dot - 1"}},
    {"method": "RK4", "step": 5e-3},
]


@pytest.mark.parametrize("options", COMPILED, ids=lambda options: options["method"])
def test_every_compiled_method_goes_on(pendulum: Any, options: Any, tmp_path: Path, killed: Any) -> None:
    go_through(pendulum, tmp_path / "run.ckpt", killed, 3, span=60, **options)


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_a_loop_with_a_table_goes_on(crank: Any, method: str, tmp_path: Path, killed: Any) -> None:
    tau = ([0, 3, 6, 9, 20], [0, 0.1, -0.1, 0, 0.03])
    go_through(crank, tmp_path / "run.ckpt", killed, 3, span=20, method=method, rtol=1e-8, inputs={"tau": tau})


def test_resets_and_terminal_events_go_on(ball: Any, tmp_path: Path, killed: Any) -> None:
    half = {"half": {"expression": "h - 0.5", "terminal": 60}}
    go_through(ball, tmp_path / "a", killed, 3, span=40, max_step=1e-3)
    go_through(ball, tmp_path / "b", killed, 3, span=40, max_step=1e-3, t_eval=np.linspace(0, 40, 300), events=half)
    go_through(ball, tmp_path / "c", killed, 2, span=(0, 10), max_step=1e-3, events=[lambda t, x: x[0] - 0.3])


def test_a_run_that_ended_where_it_was_reset_goes_on(tmp_path: Path, killed: Any) -> None:
    m = bouncing(reset={"h_dot": "-0.98*h_dot"})
    m.event("end", "2*h", direction=-1, terminal=True)
    for target in ("cython", "numpy"):
        go_through(m.compile(target=target), tmp_path / target, killed, 1, span=2, rtol=1e-6)


def test_impacts_go_on(tmp_path: Path, killed: Any) -> None:
    module = bouncing(restitution=0.98).compile()
    go_through(module, tmp_path / "run.ckpt", killed, 3, span=20, max_step=1e-3)


SCIPY = [
    {"method": "DOP853", "rtol": 1e-7},
    {"method": "RK23", "rtol": 1e-4, "t_eval": np.linspace(0, 2, 41)},
    {"method": "Radau", "rtol": 1e-4, "events": {"low": "theta1"}},
    {"method": "BDF", "rtol": 1e-4, "t_eval": np.linspace(0, 2, 41), "events": {"low": "theta1"}},
]


@pytest.mark.parametrize("options", SCIPY, ids=lambda options: options["method"])
def test_methods_of_scipy_go_on(plain: Any, options: Any, tmp_path: Path, killed: Any) -> None:
    go_through(plain, tmp_path / "run.ckpt", killed, 4, span=2, **options)


def test_resets_by_scipy_go_on(tmp_path: Path, killed: Any) -> None:
    module = bouncing(reset={"h_dot": "-0.98*h_dot"}).compile(target="numpy")
    go_through(module, tmp_path / "a", killed, 5, span=3, method="BDF", rtol=1e-6, max_step=0.1)
    times = np.linspace(0, 3, 61)
    go_through(module, tmp_path / "b", killed, 5, span=3, method="DOP853", rtol=1e-6, max_step=0.1, t_eval=times)


def test_functions_as_inputs_go_on_and_others_are_refused(crank: Any, tmp_path: Path, killed: Any) -> None:
    def drive(size: float) -> Callable[[float, Any], float]:
        return lambda t, x: size * np.sin(t) * x[1]

    go_through(crank, tmp_path / "run.ckpt", killed, 2, span=1, rtol=1e-6, inputs={"tau": drive(0.1)})
    with pytest.raises(eg.UsageError, match=r"belongs to another run: inputs\.tau differ"):
        crank.simulate(1, rtol=1e-6, inputs={"tau": drive(0.2)}, checkpoint=tmp_path / "run.ckpt")


class Hidden:
    """A function whose number is in a slot."""

    __slots__ = ("size",)

    def __init__(self, size: float) -> None:
        self.size = size

    def __call__(self, t: float, x: Any) -> float:
        return self.size * np.sin(t)


def spline(size: float) -> Callable[[float, Any], Any]:
    from scipy.interpolate import CubicSpline

    curve = CubicSpline([0.0, 1.0, 2.0], [0.0, size, 0.0])
    return lambda t, x: float(curve(t))


DRIVES = {
    "partial": lambda size: partial(lambda t, x, size: size * np.sin(t), size=size),
    "slots": Hidden,
    "spline": spline,
}


@pytest.mark.parametrize("drive", DRIVES)
def test_functions_that_hide_their_numbers_are_told_apart(crank: Any, drive: str, tmp_path: Path) -> None:
    file, make = tmp_path / "run.ckpt", DRIVES[drive]
    first = crank.simulate(0.5, rtol=1e-6, inputs={"tau": make(0.1)}, checkpoint=file)
    require_same(first, crank.simulate(0.5, rtol=1e-6, inputs={"tau": make(0.1)}, checkpoint=file))
    with pytest.raises(eg.UsageError, match=r"belongs to another run: inputs\.tau differ"):
        crank.simulate(0.5, rtol=1e-6, inputs={"tau": make(0.2)}, checkpoint=file)


def test_a_time_asked_for_at_a_corner_after_a_reset_is_stored(tmp_path: Path) -> None:
    m = bouncing(reset={"h_dot": "-0.98*h_dot"})
    m.input("u", 0.0)
    m.force("push", m.bodies["ball"], (0, "u", 0))
    module = m.compile(target="numpy")
    times = np.linspace(0, 2, 21)
    run = module.simulate(2, t_eval=times, inputs={"u": ([0, 1, 2], [0, 1, 0])}, rtol=1e-6)
    np.testing.assert_array_equal(run.t, times)


def test_kill_9(pendulum: Any, tmp_path: Path) -> None:
    """At any time: the file is whole, nothing is left beside it, and the run goes on."""
    run = {"span": 2000.0, "rtol": 1e-12, "atol": 1e-14, "max_step": 0.002, "t_eval": np.linspace(0, 2000, 1001)}
    code = (
        "import sys, numpy as np, eomgen as eg\n"
        f"module = eg.load({str(EXAMPLES / 'double_pendulum.yaml')!r}).compile()\n"
        "module.simulate(2000.0, rtol=1e-12, atol=1e-14, max_step=0.002, t_eval=np.linspace(0, 2000, 1001),"
        "checkpoint=sys.argv[1], checkpoint_every=0.05)\n"
    )
    file, ended = tmp_path / "run.ckpt", 0
    for pause in (0.0, 0.09):
        child = subprocess.Popen([sys.executable, "-c", code, str(file)])
        start = time.monotonic()
        while not file.exists() and child.poll() is None and time.monotonic() - start < 60:
            time.sleep(0.01)
        time.sleep(pause)
        child.send_signal(signal.SIGKILL)
        ended += child.wait() == 0
    assert ended < 2
    found = pendulum.simulate(checkpoint=file, resume=True, **run)
    assert [path.name for path in tmp_path.iterdir()] == ["run.ckpt"]
    require_same(pendulum.simulate(**run), found)


CHANGES: list[tuple[dict[str, Any], str]] = [
    ({"span": 2}, r"span, corners"),
    ({"method": "RK45"}, "method"),
    ({"rtol": 1e-5}, r"options\.rtol"),
    ({"max_step": 0.1}, r"options\.max_step"),
    ({"parameters": {"m2": 1.5}}, r"initial, parameters\.m2|parameters\.m2"),
    ({"initial": {"theta1": 0.1}}, "initial"),
    ({"events": ["theta1"]}, "events"),
    ({"t_eval": [0.5]}, "t_eval"),
    ({"dense_output": True}, "dense_output"),
]


def test_another_run_is_refused_by_name(pendulum: Any, plain: Any, crank: Any, tmp_path: Path) -> None:
    file = tmp_path / "run.ckpt"
    run = {"span": 1, "rtol": 1e-6}
    pendulum.simulate(checkpoint=file, **run)
    for change, names in CHANGES:
        with pytest.raises(eg.UsageError, match=rf"belongs to another run: ({names}) differ; name another file"):
            pendulum.simulate(checkpoint=file, **(run | change))
    with pytest.raises(eg.UsageError, match="belongs to another run: code differ"):
        plain.simulate(checkpoint=file, **run)
    with pytest.raises(eg.UsageError, match="belongs to another run: model, model_digest, code"):
        crank.simulate(checkpoint=file, **run)
    again = pendulum.simulate(checkpoint=file, resume=False, **(run | {"rtol": 1e-5}))
    require_same(pendulum.simulate(checkpoint=file, **(run | {"rtol": 1e-5})), again)


def test_what_no_checkpoint_can_be_kept_of_is_refused(pendulum: Any, plain: Any, tmp_path: Path) -> None:
    file = tmp_path / "run.ckpt"
    for options, words in (
        ({"method": "LSODA"}, "a run with method LSODA cannot keep a checkpoint"),
        ({"method": "BDF", "dense_output": True}, "keeps no continuous solution"),
        ({"checkpoint_every": -1}, "checkpoint_every must be a number of seconds"),
        ({"checkpoint_every": float("nan")}, "checkpoint_every must be finite"),
        ({"resume": "yes"}, "resume must be True, False or None"),
        ({"resume": True}, "there is no checkpoint"),
        ({"checkpoint": 3}, "must be the name of a file"),
        ({"checkpoint": "a\0b"}, "must be the name of a file"),
    ):
        with pytest.raises(eg.UsageError, match=words):
            plain.simulate(1, **{"checkpoint": file, **options})
    with pytest.raises(eg.UsageError, match="resume needs checkpoint="):
        pendulum.simulate(1, resume=True)
    driven = eg.load(EXAMPLES / "driven_slider_crank.yaml").compile(target="numpy")
    if not driven.n_dof:
        with pytest.raises(eg.UsageError, match="cannot keep a checkpoint"):
            driven.simulate(1, checkpoint=file)
    assert not file.exists()


def test_a_full_disk_does_not_end_the_run(pendulum: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.ckpt"
    whole = pendulum.simulate(1, checkpoint=file, rtol=1e-6)
    kept = file.read_bytes()

    def full(*args: Any, **options: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.warns(UserWarning, match="the run goes on, but its checkpoint cannot be written"):
        again = pendulum.simulate(1, checkpoint=file, rtol=1e-6, resume=False)
    require_same(whole, again)
    assert file.read_bytes() == kept
    assert os.listdir(tmp_path) == ["run.ckpt"]


def rewritten(file: Path, **changes: Any) -> bytes:
    """A checkpoint with some arrays replaced, or left out where they are None, under a seal of its own."""
    arrays = {name: value for name, value in (read_arrays(file) | changes).items() if value is not None}
    out = io.BytesIO()
    np.savez(out, **sealed(arrays))
    return out.getvalue()


def test_hostile_numbers_are_refused(pendulum: Any, tmp_path: Path, killed: Any) -> None:
    """Whatever C would take as an index is compared with what there is; the other numbers are no more than numbers."""
    file, run = tmp_path / "run.ckpt", {"span": 150.0, "method": "Radau", "rtol": 1e-7, "events": ["theta1"]}
    killed(1)
    with pytest.raises(Killed):
        pendulum.simulate(checkpoint=file, checkpoint_every=0.0, **run)
    killed(0)
    good, (counts, block, notes) = file.read_bytes(), (np.load(file)[name] for name in ("counts", "block", "notes"))
    bad: list[dict[str, Any]] = [{"counts": np.where(np.arange(17) == i, 10**6, counts)} for i in (7, 8, 9, 10, 11, 16)]
    bad += [{"counts": np.where(np.arange(17) == i, -5, counts)} for i in (7, 8, 9, 10, 11, 16)]
    bad += [{"counts": counts[:-1]}, {"counts": counts.astype("U20")}, {"block": block[:-1]}, {"rows": None}]
    stored = np.load(file)["states"]
    bad += [{"event_counts": np.array([[1, 7, 0]])}, {"events": np.zeros((6, 2))}]
    bad += [{"states": np.zeros((len(stored) + more, 4))} for more in (-1, 1)]
    bad += [{"times": np.zeros((2, 2))}, {"notes": np.full((1, notes.shape[1]), 9.0)}, {"header": np.zeros(3)}]
    n = pendulum.n_x
    place = 22 * n + 4 * n * n + 16  # rows exchanged, whole numbers two in a double
    pivots = block.copy()
    pivots[place : place + n] = np.full(2 * n, 10**8, dtype=np.intc).view(float)
    bad += [{"block": pivots}]
    for change in bad:
        file.write_bytes(rewritten(file, **change))
        with pytest.raises(eg.UsageError, match=r"is damaged, or is not a checkpoint|belongs to another run"):
            pendulum.simulate(checkpoint=file, **run)
            pytest.fail(f"taken: {change}")
        file.write_bytes(good)
    file.write_bytes(rewritten(file, block=np.full_like(block, np.nan)))
    with pytest.raises(eg.UsageError, match="damaged"):  # NaN is no row
        pendulum.simulate(checkpoint=file, **run)


def test_sparse_factors_go_on(tmp_path: Path, killed: Any) -> None:
    """80 masses that do not know each other; places among the numbers of their factors are looked at too."""
    m = eg.Model("apart")
    for k in range(80):
        m.prismatic(f"s{k}", m.ground, m.body(f"b{k}", mass=1.0), axis="x")
        m.joint_spring(f"k{k}", f"s{k}", stiffness=1.0 + k)
        m.joint_damper(f"d{k}", f"s{k}", damping=0.1)
        m.initial(**{f"s{k}": 0.1})
    module, run = m.compile(), {"span": 3.0, "method": "Radau", "rtol": 1e-6}
    found = module.simulate(**run)["s79"][-1]
    assert found == pytest.approx(0.1 * np.exp(-0.15) * np.cos(3 * np.sqrt(80)), abs=2e-3)
    file, n = tmp_path / "run.ckpt", module.n_x
    go_through(module, tmp_path / "whole.ckpt", killed, 3, **run)
    killed(2)
    with pytest.raises(Killed):
        module.simulate(checkpoint=file, checkpoint_every=0.0, **run)
    killed(0)
    block, good = np.load(file)["block"], file.read_bytes()
    real = 22 * n + n * n
    state = 22 * n + 4 * n * n
    assert (block[state], block[state + 9]) == (3.0, 2.0 * n)  # sparse; four numbers for each mass
    filled, places = int(block[state + 9]), block[real:].view(np.intc)[2 * int(block[state + 9]) :]
    changes = [(real, 0, 10**8), (real, n, -1), (real, 2 * n + 1, 5), (real, 3 * n + 1 + filled - 1, n)]
    for start, place, value in changes:
        other = block.copy()
        other[start:].view(np.intc)[2 * filled + place] = value
        assert places[place] != value
        file.write_bytes(rewritten(file, block=other))
        with pytest.raises(eg.UsageError, match="damaged"):
            module.simulate(checkpoint=file, **run)
        file.write_bytes(good)
    for value in (np.nan, 1.0, 1e9):
        other = block.copy()
        other[state + 9] = value
        file.write_bytes(rewritten(file, block=other))
        with pytest.raises(eg.UsageError, match="damaged"):
            module.simulate(checkpoint=file, **run)
        file.write_bytes(good)
