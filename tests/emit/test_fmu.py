"""Functional mock-up units, judged by FMPy, which validates and simulates them; by the module; by sanitizers."""

from __future__ import annotations

import json
import subprocess
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from fmu_instances import initialized, opened
from sweeps import OF_ALL_KINDS, part_of

import eomgen as eg
from eomgen.cli import main
from eomgen.emit.fmu.variables import list_variables
from eomgen.errors import ModelError, UsageError
from eomgen.fmu import write_fmu
from eomgen.pipeline import build, derive

ABUSE = Path(__file__).parent / "fmu_abuse"
EXAMPLES = sorted(path.stem for path in models.EXAMPLES.glob("*.yaml"))
POINTS = 21
#: In one version each, and one example in both: what an example has is compiled from the same text in either.
IN_TURN = {(name, ("2.0", "3.0")[k % 2]) for k, name in enumerate(OF_ALL_KINDS)} | {
    ("slider_crank", "2.0"),
    ("slider_crank", "3.0"),
}


def ball() -> eg.Model:
    """A ball that jumps on the floor."""
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    m.parameter("e", 0.9)
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    m.event("floor", "h", direction=-1, reset={"h_dot": "-e*h_dot"})
    m.event("apex", "h_dot", direction=-1)
    return m


def between_walls() -> eg.Model:
    """A body between two walls, whose event has no direction; the run ends at its seventh way through the centre."""
    m = eg.Model("between_walls")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.initial(s=0.5, s_dot=1.0)
    m.event("wall", "(1 - s)*(1 + s)", reset={"s_dot": "-s_dot"})
    m.event("centre", "s", terminal=7)
    return m


def simulated(path: Path, kind: str, end: float, names: list[str], rtol: float | None) -> tuple[Any, Any]:
    """Times and columns by FMPy, after the last event of each instant."""
    rows = simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=end,
        output_interval=end / (POINTS - 1),
        relative_tolerance=rtol,
        output=names,
    )
    rows = rows[np.append(np.diff(rows["time"]) > 1e-12, True)]
    return rows["time"], {name: np.asarray(rows[name]) for name in names}


@cache
def derived(name: str) -> Any:
    """The equations of an example, for the units of both versions."""
    return derive(models.build(name), "auto")


@cache
def moved(name: str) -> tuple[list[str], float, Any]:
    """Names of its states and outputs, the end of a run, and the run by the module."""
    module = models.build(name).compile(target="numpy")
    end = min(float(module.metadata["simulation"]["end"]), 0.2)
    names = [*module.x_names, *(y for y in module.y_names if y not in module.x_names)]
    return names, end, module.simulate(end, t_eval=np.linspace(0.0, end, POINTS))


@pytest.mark.parametrize(
    ("name", "version"), part_of([(name, v) for name in EXAMPLES for v in ("2.0", "3.0")], IN_TURN.__contains__)
)
def test_every_example_validates_and_moves_like_simulate(name: str, version: str, tmp_path: Path) -> None:
    path = write_fmu(derived(name), tmp_path / f"{name}.fmu", version)
    assert validate_fmu(str(path)) == []
    names, end, expected = moved(name)
    for kind, rtol, bound in (("CoSimulation", None, 2e-7), ("ModelExchange", 1e-8, 2e-5)):
        times, found = simulated(path, kind, end, names, rtol)
        np.testing.assert_allclose(times, expected.t, atol=1e-12)
        for column in names:
            scale = max(1.0, float(np.abs(expected[column]).max()))
            assert np.abs(found[column] - expected[column]).max() <= bound * scale, (kind, column)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("model", [ball, between_walls])
def test_events_and_resets(model: Any, version: str, tmp_path: Path) -> None:
    """Communication points 0.02 s apart meet resets to the last digit."""
    path = write_fmu(derive(model(), "auto"), tmp_path / "m.fmu", version)
    module, end = model().compile(target="numpy"), 4.0
    expected = module.simulate(end, rtol=1e-10, atol=1e-12, t_eval=np.linspace(0.0, end, 201))
    name = module.x_names[0]
    for kind in ("CoSimulation", "ModelExchange"):
        rows = simulate_fmu(
            str(path), fmi_type=kind, stop_time=end, output_interval=0.02, relative_tolerance=1e-9, output=[name]
        )
        found = np.interp(expected.t, rows["time"], np.asarray(rows[name]))
        np.testing.assert_allclose(found, expected[name], atol=1e-6)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("speed", [0.0, -0.1, 0.1])
def test_an_input_that_jumps_over_an_event_resets_once(speed: float, version: str, tmp_path: Path) -> None:
    """A push of 0.25 m/s when the lever goes from 0 to 1, whichever way the motion changes the event's value.

    In either kind of unit and in the closed form.
    """
    m = eg.Model("switched")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.torque("nothing", "J", 0 * m.input("lever"))
    m.initial(s=0.0, s_dot=speed)
    m.event("on", "lever - 0.5 + s", direction=1, reset={"s_dot": "s_dot + 0.25"})
    path = write_fmu(derive(m, "auto"), tmp_path / "m.fmu", version)
    jump = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (2.0, 1.0)], dtype=[("time", float), ("lever", float)])
    for kind in ("CoSimulation", "ModelExchange"):
        rows = simulate_fmu(str(path), fmi_type=kind, stop_time=2.0, output_interval=0.1, input=jump, output=["s"])
        found = np.interp([0.5, 1.0, 2.0], rows["time"], np.asarray(rows["s"]))
        expected = np.array([0.0, 0.125, 0.375]) + speed * np.array([0.5, 1.0, 2.0])
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_terminal_event_ends_the_run(tmp_path: Path) -> None:
    """Seven ways through the centre, 2 s apart, the first at 1.5 s: 13.5 s."""
    path = write_fmu(derive(between_walls(), "auto"), tmp_path / "m.fmu", "3.0")
    for kind in ("CoSimulation", "ModelExchange"):
        rows = simulate_fmu(str(path), fmi_type=kind, stop_time=30.0, output_interval=0.5)
        assert rows["time"][-1] == pytest.approx(13.5, abs=0.5)


@pytest.fixture(scope="module")
def crank(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    folder = tmp_path_factory.mktemp("fmu")
    path = write_fmu(derive(models.build("slider_crank"), "auto"), folder / "slider_crank.fmu")
    return path, models.build("slider_crank").compile(target="numpy")


def test_directional_derivatives_are_the_modules(crank: tuple[Path, Any]) -> None:
    path, module = crank
    instance, at = opened(path)
    initialized(instance)
    rates = [at[f"der({name})"] for name in module.x_names]
    x = module.x0()

    def columns(unknowns: list[int], names: tuple[str, ...]) -> Any:
        return np.array([instance.getDirectionalDerivative(unknowns, [at[name]], [1.0]) for name in names]).T

    np.testing.assert_allclose(columns(rates, module.x_names), module.jacobian(0.0, x), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(columns(rates, module.u_names), module.input_jacobian(0.0, x), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(columns(rates, module.p_names), module.parameter_jacobian(0.0, x), rtol=1e-12, atol=1e-9)
    # speed is s_dot of the state on the constraints: along the motion it changes by the slider's acceleration
    slopes = module.rhs(0.0, x)
    found = instance.getDirectionalDerivative([at["speed"]], [at[name] for name in module.x_names], list(slopes))
    assert found[0] == pytest.approx(slopes[list(module.x_names).index("s_dot")], rel=1e-10)
    instance.freeInstance()


def test_a_copied_state_goes_on_to_the_same_bits(crank: tuple[Path, Any]) -> None:
    path, _ = crank
    slave, _ = opened(path, FMU2Slave)
    initialized(slave)

    def go_on(start: float) -> list[float]:
        for k in range(5):
            slave.doStep(start + 0.05 * k, 0.05)
        return list(slave.getReal(list(range(6))))

    go_on(0.0)
    state = slave.getFMUState()
    data = slave.serializeFMUstate(state)
    first = go_on(0.25)
    slave.setFMUState(state)
    assert go_on(0.25) == first
    again = slave.deSerializeFMUstate(data)
    slave.setFMUState(again)
    assert go_on(0.25) == first
    other, _ = opened(path)
    with pytest.raises(Exception, match="status 3|failed"):  # one of co-simulation is none of model exchange
        other.setFMUState(again)
    for kept in (state, again):
        slave.freeFMUState(kept)
    slave.freeInstance()
    other.freeInstance()


@pytest.mark.parametrize(
    ("model", "version"),
    [
        (ball, "2"),
        pytest.param(ball, "3", marks=pytest.mark.thorough),
        pytest.param(lambda: models.build("slider_crank"), "2", marks=pytest.mark.thorough),
        (lambda: models.build("slider_crank"), "3"),
    ],
)
def test_random_calls_neither_crash_nor_leak(model: Any, version: str, tmp_path: Path) -> None:
    """150 sequences of calls in any order, with arguments missing, too short, too large and not finite."""
    equations = derive(model(), "auto")
    with zipfile.ZipFile(write_fmu(equations, tmp_path / "m.fmu", version)) as archive:
        archive.extractall(tmp_path)
    sources = tmp_path / "sources"
    files = [str(file) for file in sorted(sources.glob("*.c")) if file.name != f"fmi{version}.c"]
    flags = [
        "-std=c99",
        "-O1",
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
        "-Wall",
        "-Wextra",
        "-Werror",
    ]
    command = ["gcc", *flags, f"-I{sources}", str(ABUSE / f"abuse{version}.c"), *files, "-o", "abuse", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run(["./abuse", "150"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_sources_rebuild_elsewhere(version: str, tmp_path: Path) -> None:
    path = write_fmu(derive(models.build("double_pendulum"), "auto"), tmp_path / "double_pendulum.fmu", version)
    before = simulate_fmu(str(path), stop_time=1.0)
    folder = Path(extract(str(path), unzipdir=str(tmp_path / "unpacked")))
    for binary in folder.glob("binaries/*/*"):
        binary.unlink()
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, build_dir=tmp_path / "build")
    after = simulate_fmu(str(folder), stop_time=1.0)
    for name in before.dtype.names:
        np.testing.assert_allclose(after[name], before[name], rtol=1e-9, atol=1e-9)


def test_the_same_model_gives_the_same_bytes(tmp_path: Path) -> None:
    one, other = (write_fmu(derive(ball(), "auto"), tmp_path / f"{k}.fmu", "3") for k in "ab")
    assert one.read_bytes() == other.read_bytes()


def test_names_units_and_start_values(tmp_path: Path) -> None:
    m = models.build("engine")
    m.output("theta", "theta")
    path = write_fmu(derive(m, "auto"), tmp_path / "engine.fmu")
    variables = {v.name: v for v in read_model_description(str(path)).modelVariables}
    assert variables["theta"].initial == "exact"
    assert variables["s"].initial == "approx"
    assert variables["theta_out"].causality == "output"
    assert (variables["r"].causality, variables["r"].variability, variables["r"].start) == (
        "parameter",
        "tunable",
        "0.04",
    )
    assert (variables["r"].description, variables["r"].unit) == ("crank", "m")
    assert variables["der(theta_dot)"].unit == "rad/s^2"
    units = {u.name: u for u in read_model_description(str(path)).unitDefinitions}
    assert (units["mm"].baseUnit.m, float(units["mm"].baseUnit.factor)) == (1, 1e-3)
    assert (units["N*m*s^2"].baseUnit.kg, units["N*m*s^2"].baseUnit.m) == (1, 2)


def test_references_follow_the_order_of_the_header() -> None:
    program = build(derive(ball(), "auto"), "c")
    names = [v.name for v in list_variables(program, [1.0, 0.0])]
    assert names == ["h", "h_dot", "der(h)", "der(h_dot)", "e", "time", "event(floor)", "event(apex)"]


def test_impacts_are_refused_by_name(tmp_path: Path) -> None:
    m = ball()
    m.event("gap", "h - 0.5", restitution=0.5)
    with pytest.raises(ModelError, match=r"events\.gap\.restitution: an FMU cannot hold an impact; describe"):
        write_fmu(derive(m, "auto"), tmp_path / "m.fmu")
    assert not list(tmp_path.iterdir())


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = str(models.EXAMPLES / "pendulum.yaml")
    arguments = ["generate", model, "--out", str(tmp_path), "--target", "fmu", "--fmi", "3.0", "--json"]

    def call() -> int:
        with pytest.raises(SystemExit) as left:
            main(arguments)
        return int(left.value.code or 0)

    assert (call(), call()) == (0, 0)  # its own file is replaced
    told = json.loads(capsys.readouterr().out.partition("}\n")[2])
    assert (told["name"], Path(told["folder"])) == ("pendulum", tmp_path / "pendulum.fmu")
    (tmp_path / "pendulum.fmu").write_text("mine")
    assert call() == 2
    assert "was not written by eomgen" in capsys.readouterr().err
    assert (tmp_path / "pendulum.fmu").read_text() == "mine"


def test_wrong_names_and_versions(tmp_path: Path) -> None:
    equations = derive(ball(), "auto")
    with pytest.raises(UsageError, match=r"no version '4' of FMI here; there are 2\.0, 3\.0"):
        write_fmu(equations, tmp_path / "x.fmu", "4")
    with pytest.raises(UsageError, match=r"ends in \.fmu"):
        write_fmu(equations, tmp_path / "x.zip")
