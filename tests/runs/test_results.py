"""Runs for other eyes and programs: plots, xarray Datasets, netCDF, Parquet, python-control."""

import io
import json
import pickle
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import control
import matplotlib
import matplotlib.pyplot as plt
import models
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from analysed import compiled
from refusals import refuses

import eomgen as eg

matplotlib.use("agg")


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def run() -> Any:
    return models.build("slider_crank").compile(target="numpy").simulate(1.0)


def pendulum(theta: float = 0.01, end: float = 8.0, **options: Any) -> Any:
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    bob = m.body("bob", mass=1, com=(0, -1, 0))
    m.revolute("hinge", m.ground, bob, coordinate="theta")
    return m.compile(target="numpy").simulate(end, initial={"theta": theta}, rtol=1e-10, atol=1e-12, **options)


def test_shape_against_shape_is_the_path_of_the_point(run: Any) -> None:
    ax = run.plot(x="pin_x", y="s")
    line = ax.lines[0].get_xydata()
    # the tip of the rod is on the slider: a straight line of 45 degrees, drawn in one scale
    assert line[:, 0] == pytest.approx(line[:, 1], abs=1e-9)
    assert ax.get_aspect() == 1.0
    assert len(line) > 500
    assert run.plot("theta", x="s").get_xlabel() == "$s$ (m)"


def test_a_phase_portrait_of_a_small_swing_is_an_ellipse() -> None:
    ax = pendulum().plot("theta", kind="phase")
    x, y = ax.lines[0].get_xydata().T
    assert (x / 0.01) ** 2 + (y / (0.01 * np.sqrt(9.81))) ** 2 == pytest.approx(1.0, abs=1e-4)
    assert ax.get_xlabel() == r"$\theta$ (rad)"
    assert ax.get_ylabel() == r"$\dot{\theta}$ (rad/s)"


def test_the_energy_between_the_steps_drifts_no_more_than_at_them() -> None:
    run = pendulum(2.0)  # 110 steps of about a fortieth of a swing; the cubics between them are off by 7e-4 J
    E = -9.81 * np.cos(2.0)  # of the closed form, at rest at 2 rad
    at_steps = run["energy"]
    drift = float(np.ptp(at_steps))
    assert drift < 1e-8
    curve = run.plot("energy").lines[0].get_ydata()
    assert len(curve) > 5 * len(at_steps)
    assert np.abs(curve - E).max() <= np.abs(at_steps - E).max() + 1e-13
    parts, change = run.plot(kind="energy")
    assert np.ptp(change.lines[0].get_ydata()) <= drift + 1e-13
    t, kinetic = parts.lines[0].get_xydata().T
    assert len(t) == len(curve)  # and smooth
    swing = np.interp(t, *run.plot("theta").lines[0].get_xydata().T)
    assert kinetic == pytest.approx(9.81 * (np.cos(swing) - np.cos(2.0)), abs=1e-3)  # T = m g l (cos - cos 2)


def test_wishes_that_do_not_go_together_are_refused(run: Any) -> None:
    for call, words in (
        ({"y": "s"}, "EG-MISSING x="),
        ({"x": "s"}, "EG-MISSING against"),
        ({"x": "s", "y": "theta", "kind": "phase"}, "EG-CONFLICT together"),
        ({"kind": "phases"}, "EG-NAME-UNKNOWN phase?"),
        ({"x": "thet", "y": "s"}, "EG-NAME-UNKNOWN theta"),
    ):
        refuses(words, run.plot, **call)
    assert plt.get_fignums() == []


@pytest.fixture(scope="module")
def ball() -> eg.Module:
    """A ball on a slide that bounces, with names that the tables would like to have themselves."""
    m = eg.Model("ball")
    m.parameter("k", 4.0, unit="N/m", doc="stiffness of the slide")
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="x", coordinate="s")
    m.torque("motor", "J", "-k*s + 0.3*sin(3*t)")
    m.torque("push", "J", m.input("f"))
    m.event("state", "s + 0.5", direction=-1, reset={"s_dot": "-0.8*s_dot"})
    m.event("top", "s_dot", direction=-1)
    m.output("run", "2*s", unit="mm", doc="twice the way")
    m.output("status", "s_dot")
    return m.compile(target="numpy")


def test_a_run_is_a_dataset(ball: eg.Module) -> None:
    traj = ball.simulate(6.0, initial={"s": 1.0})
    made = traj.to_xarray()
    assert dict(made.sizes)["t"] == len(traj.t)
    assert made.attrs["model"] == "ball"
    assert json.loads(made.attrs["metadata"])["method"] == traj.metadata["method"]
    for name in traj.names:
        assert np.array_equal(made[name], traj[name])
        assert made[name].dims == ("t",)
        assert made[name].attrs["units"] == traj.units.get(name, "")
    assert made["run"].attrs == {"units": "mm", "long_name": "twice the way"}
    assert len(traj.t_events["state"]) >= 2
    for name in ("state", "top"):
        assert np.array_equal(made[f"t_events_{name}"], traj.t_events[name])
        states = made[f"x_events_{name}"]
        assert np.array_equal(states.sel(state="s_dot"), traj.x_events[name][1])


def test_files_are_read_by_their_libraries(ball: eg.Module, tmp_path: Path) -> None:
    traj = ball.simulate(3.0, initial={"s": 1.0})
    assert traj.save(tmp_path / "run.nc") == tmp_path / "run.nc"
    with xr.open_dataset(tmp_path / "run.nc") as read:
        assert read.load().identical(traj.to_xarray()) or read.equals(traj.to_xarray())
        assert read["s_ddot"].attrs["units"] == "m/s^2"
        assert json.loads(read.attrs["metadata"]) == traj.metadata
    traj.save(tmp_path / "run.parquet")
    table = pd.read_parquet(tmp_path / "run.parquet")
    pd.testing.assert_frame_equal(table, traj.to_pandas())
    assert table.attrs["units"]["run"] == "mm"
    assert json.loads(table.attrs["metadata"]) == traj.metadata
    for name in ("run.nc", "run.parquet"):
        refuses("EG-FILE-DAMAGED .npz", eg.load_trajectory, tmp_path / name)
    refuses("EG-FILE .xls .npz .csv .nc .parquet", traj.save, tmp_path / "run.xls")


def test_a_linearization_is_a_system_of_python_control() -> None:
    """Names; poles against eigenvalues; a step response against the run of the nonlinear module."""
    m = models.build("furuta_pendulum")
    mod = m.compile(target="numpy")
    linear = mod.linearize(np.zeros(mod.n_x))
    assert linear.is_equilibrium
    system = linear.ss()
    assert system.state_labels == list(linear.states)
    assert system.input_labels == list(linear.inputs)
    assert system.output_labels == list(linear.outputs)
    assert np.allclose(np.sort_complex(system.poles()), np.sort_complex(linear.eigenvalues), atol=1e-9)
    times = np.linspace(0.0, 0.3, 31)
    small = 1e-5
    response = control.step_response(system, times, input=0, squeeze=False)
    run = mod.simulate(
        0.3, initial=np.zeros(mod.n_x), inputs={mod.u_names[0]: small}, t_eval=times, rtol=1e-11, atol=1e-14
    )
    for k, name in enumerate(linear.states):
        assert np.allclose(response.states[k, 0], (run[name] - run[name][0]) / small, atol=2e-4)


def test_every_result_gives_plain_values_a_table_and_a_page() -> None:
    crank = models.build("slider_crank").compile(target="numpy")
    state, start = crank.x0({"theta": 0.3, "theta_dot": 2.0}), {"theta": 0.3}
    measured = crank.simulate(0.1, start, t_eval=np.linspace(0, 0.1, 9))
    results = [
        crank.equilibrium(start),
        crank.linearize(start),
        crank.modes(),
        crank.actuator_forces(0.0, state),
        crank.impact(0.0, state, lock=["s"]),
        crank.motion_range("theta"),
        crank.sensitivities(["r"], 0.05, start),
        crank.fit({"t": measured.t, "s": measured["s"]}, ["r"]),
        crank.base_parameters(),
        crank.simulate_many(0.05, {"theta": [0.1, 0.2]}),
    ]
    for result in results:
        values = json.loads(json.dumps(result.to_dict(), allow_nan=False))  # an unlimited range has null limits
        assert values
        assert len(result.to_pandas())
        assert result.title in result._repr_html_()
        assert result.title in repr(result)
    assert results[1].to_pandas().loc["theta", "theta_dot"] == pytest.approx(1.0)
    assert results[0].to_dict()["coordinates"]["theta"] == results[0]["theta"]


def test_a_name_that_ends_in_a_slash_is_no_file(run: Any, tmp_path: Path) -> None:
    refuses("EG-FILE folder", run.save, f"{tmp_path}/")


# -- runs in files -----------------------------------------------------------------------------------------------------
def halves(module: eg.Module, middle: float, end: float, folder: Path, **options: Any) -> tuple[Any, Any]:
    """A run, and its second half, which goes on from the first, read from its file."""
    whole = module.simulate(end, **options)
    first = eg.load_trajectory(module.simulate(middle, **options).save(folder / "first.npz"))
    return whole, module.simulate((first.t[-1], end), initial=first, **options)


@pytest.mark.parametrize(
    ("name", "middle", "end", "options"),
    [
        ("slider_crank", 0.4, 1.0, {"rtol": 1e-11, "atol": 1e-13}),
        ("double_pendulum", 0.4, 1.0, {"method": "BDF", "rtol": 1e-9, "atol": 1e-11}),
        ("hopper_with_apex", 0.7, 2.0, {"rtol": 1e-11, "atol": 1e-13, "max_step": 1e-2}),
        ("sampled_servo", 0.375, 1.0, {"rtol": 1e-11, "atol": 1e-13}),
    ],
)
def test_a_run_goes_on_from_another(name: str, middle: float, end: float, options: Any, tmp_path: Path) -> None:
    whole, second = halves(compiled(name, "numpy"), middle, end, tmp_path, **options)
    assert second.t[0] == middle
    np.testing.assert_allclose(second.x[:, -1], whole.x[:, -1], rtol=1e-6, atol=1e-6)
    for all_times, times in zip(whole.t_events, second.t_events, strict=True):
        np.testing.assert_allclose(times, all_times[all_times > middle], rtol=1e-7)


def npz(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def members(pairs: list[tuple[str, bytes]], kind: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", kind) as archive:
        for name, data in pairs:
            archive.writestr(name, data)
    return out.getvalue()


def claim(shape: str, data: bytes = b"", kind: str = "<f8") -> bytes:
    """An .npy text that says it has a shape."""
    head = f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + data


OBJECTS = io.BytesIO()


np.save(OBJECTS, np.array([print], dtype=object), allow_pickle=True)


HOSTILE: dict[str, Any] = {
    "empty": b"",
    "text": b"no archive",
    "pickle": pickle.dumps([1]),
    "objects": members([("a.npy", OBJECTS.getvalue())]),
    "object claimed": members([("a.npy", claim("(1,)", b"12345678", "|O"))]),
    "huge shape": members([("a.npy", claim("(10**12,)"))]),
    "huge number": members([("a.npy", claim("(1000000000000,)"))]),
    "overflowing shape": members([("a.npy", claim("(4294967296, 4294967296, 2)"))]),
    "negative shape": members([("a.npy", claim("(-1,)"))]),
    "too much data": members([("a.npy", claim("(1,)", b"1" * 16))]),
    "code in head": members([("a.npy", claim("__import__('os')"))]),
    "no array": members([("a.npy", b"x" * 40)]),
    "twice": members([("a.npy", claim("(0,)")), ("a", claim("(0,)"))]),
    "bomb": lambda: members([("a.npy", claim("(37500000,)", b"\0" * 300_000_000))], zipfile.ZIP_DEFLATED),
    "half a head": members([("a.npy", claim("(1,", b"1" * 8))]),
    "head of another type": members([("a.npy", claim("(1,)", b"1" * 8).replace(b"'descr'", b"b'desc'"))]),
    "cut": npz(a=np.arange(100.0))[:500],
    "turned": npz(a=np.arange(100.0)).replace(np.array([50.0]).tobytes(), np.array([51.0]).tobytes()),
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_files_are_refused(what: str, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    data = HOSTILE[what]
    file.write_bytes(data() if callable(data) else data)
    refuses("EG-FILE-DAMAGED trajectory", eg.load_trajectory, file)


def test_every_cut_of_a_trajectory_is_refused_or_whole(tmp_path: Path) -> None:
    module = models.build("pendulum").compile(target="numpy")
    file = module.simulate(0.1, rtol=1e-3).save(tmp_path / "run.npz")
    whole = file.read_bytes()
    for length in range(0, len(whole), 61):
        file.write_bytes(whole[:length])
        with pytest.raises(eg.UsageError):
            eg.load_trajectory(file)
    random = np.random.default_rng(0)
    for _ in range(60):
        data = bytearray(whole)
        data[random.integers(len(data))] ^= 1 << random.integers(8)
        file.write_bytes(data)
        with suppress(eg.UsageError):
            assert len(eg.load_trajectory(file)) > 1  # what was turned is not read


def test_a_trajectory_with_other_arrays_is_refused_by_name(tmp_path: Path) -> None:
    module = models.build("pendulum").compile(target="numpy")
    file = module.simulate(0.1, events=[lambda t, x: x[0] - 0.3]).save(tmp_path / "run.npz")
    with np.load(file) as data:
        arrays = {name: data[name] for name in data.files}
    header = str(arrays["header"])
    damaged = [{("old" if name == one else name): x for name, x in arrays.items()} for one in arrays]
    damaged += [{**arrays, name: x} for one in "tx" for name, x in ((one, arrays[one][..., :-1]), (one, np.array("1")))]
    damaged += [{**arrays, "x": arrays["x"].astype(complex)}, {**arrays, "t_events_1": arrays["t"]}]
    for text in (header[:-9], "3", "[]", "null", header.replace("x_names", "names"), header.replace("0.1", "0.2")):
        damaged.append({**arrays, "header": np.array(text)})
    for changed in damaged:
        np.savez(file, **changed)
        refuses("EG-FILE-DAMAGED run.npz", eg.load_trajectory, file)
    np.savez(file, **arrays)  # as another program would write the same arrays
    assert eg.load_trajectory(file).t_events[0].shape == arrays["t_events_0"].shape


def test_files_that_are_no_runs(tmp_path: Path) -> None:
    np.savez(tmp_path / "y.npz", header=np.array(json.dumps({"format": "other"})))
    refuses("EG-FILE-DAMAGED format", eg.load_trajectory, tmp_path / "y.npz")
    with pytest.raises(FileNotFoundError):
        eg.load_trajectory(tmp_path / "none.npz")
