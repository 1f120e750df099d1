"""Functional mock-up units, judged by FMPy, which validates and simulates them; by the module; by sanitizers."""

import ctypes
import re
import subprocess
import zipfile
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import fmpy
import models
import numpy as np
import pytest
import sympy as sp
from command import run
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.validation import validate_fmu
from refusals import refuses
from sweeps import part_of

import eomgen as eg

ABUSE = Path(__file__).with_name("fmu_abuse.c")
EXAMPLES = sorted(path.stem for path in models.EXAMPLES.glob("*.yaml"))
POINTS, VERSIONS = 21, ("2.0", "3.0")
#: Which run always: a loop in both versions, a rolling disc, a loop in space with a redundant description.
ALWAYS = {("slider_crank", "2.0"), ("slider_crank", "3.0"), ("rolling_disc", "2.0")}


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


def opened(path: Path, kind: type = FMU2Model) -> tuple[Any, dict[str, int]]:
    """An instance, and the references of its variables by name."""
    folder = extract(str(path))
    description = read_model_description(folder)
    instance = kind(guid=description.guid, unzipDirectory=folder, modelIdentifier=path.stem, instanceName="i")
    instance.instantiate()
    return instance, {v.name: v.valueReference for v in description.modelVariables}


def initialized(instance: Any) -> None:
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()


def simulated(path: Path, kind: str, end: float, names: list[str], rtol: float | None) -> tuple[Any, Any]:
    """Times and columns by FMPy, after the last event of each instant."""
    step = end / (POINTS - 1)
    options = {"output_interval": step, "relative_tolerance": rtol, "output": names}
    rows = simulate_fmu(str(path), fmi_type=kind, stop_time=end, **options)
    rows = rows[np.append(np.diff(rows["time"]) > 1e-12, True)]
    return rows["time"], {name: np.asarray(rows[name]) for name in names}


@cache
def derived(name: str) -> Any:
    """The equations of an example, for the units of both versions."""
    return models.build(name).derive()


@cache
def moved(name: str) -> tuple[list[str], float, Any]:
    """Names of its states and outputs, the end of a run, and the run by the module."""
    module = models.build(name).compile(target="numpy")
    end = min(float(module.metadata["simulation"]["end"]), 0.2)
    names = [*module.x_names, *(y for y in module.y_names if y not in module.x_names)]
    return names, end, module.simulate(end, t_eval=np.linspace(0.0, end, POINTS))


@pytest.mark.parametrize(("name", "version"), part_of(product(EXAMPLES, VERSIONS), ALWAYS.__contains__))
def test_every_example_validates_and_moves_like_simulate(name: str, version: str, tmp_path: Path) -> None:
    path = derived(name).write_fmu(tmp_path / f"{name}.fmu", version)
    assert validate_fmu(str(path)) == []
    names, end, expected = moved(name)
    for kind, rtol, bound in (("CoSimulation", None, 2e-7), ("ModelExchange", 1e-8, 2e-5)):
        times, found = simulated(path, kind, end, names, rtol)
        np.testing.assert_allclose(times, expected.t, atol=1e-12)
        for column in names:
            scale = max(1.0, float(np.abs(expected[column]).max()))
            assert np.abs(found[column] - expected[column]).max() <= bound * scale, (kind, column)


BOTH = [(ball, "2.0"), (between_walls, "3.0")]


@pytest.mark.parametrize(("model", "version"), part_of(product((ball, between_walls), VERSIONS), BOTH.__contains__))
def test_events_and_resets(model: Any, version: str, tmp_path: Path) -> None:
    """Communication points 0.02 s apart meet resets to the last digit."""
    path = model().derive().write_fmu(tmp_path / "m.fmu", version)
    module, end = model().compile(target="numpy"), 4.0
    expected = module.simulate(end, rtol=1e-10, atol=1e-12, t_eval=np.linspace(0.0, end, 201))
    name = module.x_names[0]
    for kind in ("CoSimulation", "ModelExchange"):
        options = {"output_interval": 0.02, "relative_tolerance": 1e-9, "output": [name]}
        rows = simulate_fmu(str(path), fmi_type=kind, stop_time=end, **options)
        found = np.interp(expected.t, rows["time"], np.asarray(rows[name]))
        np.testing.assert_allclose(found, expected[name], atol=1e-6)


@pytest.mark.parametrize(("speed", "version"), part_of(product((0.0, -0.1, 0.1), VERSIONS), (-0.1, "3.0").__eq__))
def test_an_input_that_jumps_over_an_event_resets_once(speed: float, version: str, tmp_path: Path) -> None:
    """A push of 0.25 m/s when the lever goes from 0 to 1, whichever way the motion changes the event's value.

    In either kind of unit and in the closed form.
    """
    path = models.switched_by_lever(speed).derive().write_fmu(tmp_path / "m.fmu", version)
    jump = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (2.0, 1.0)], dtype=[("time", float), ("lever", float)])
    for kind in ("CoSimulation", "ModelExchange"):
        rows = simulate_fmu(str(path), fmi_type=kind, stop_time=2.0, output_interval=0.1, input=jump, output=["s"])
        found = np.interp([0.5, 1.0, 2.0], rows["time"], np.asarray(rows["s"]))
        expected = np.array([0.0, 0.125, 0.375]) + speed * np.array([0.5, 1.0, 2.0])
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_terminal_event_ends_the_run(tmp_path: Path) -> None:
    """Seven ways through the centre, 2 s apart, the first at 1.5 s: 13.5 s."""
    path = between_walls().derive().write_fmu(tmp_path / "m.fmu", "3.0")
    for kind in ("CoSimulation", "ModelExchange"):
        rows = simulate_fmu(str(path), fmi_type=kind, stop_time=30.0, output_interval=0.5)
        assert rows["time"][-1] == pytest.approx(13.5, abs=0.5)


@pytest.fixture(scope="module")
def crank(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    folder = tmp_path_factory.mktemp("fmu")
    path = models.build("slider_crank").derive().write_fmu(folder / "slider_crank.fmu")
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


@pytest.mark.thorough
@pytest.mark.parametrize("version", ["2", "3"])
@pytest.mark.parametrize("model", [ball, lambda: models.build("slider_crank")], ids=["ball", "slider_crank"])
def test_random_calls_neither_crash_nor_leak(model: Any, version: str, tmp_path: Path) -> None:
    """150 sequences of calls in any order, with arguments missing, too short, too large and not finite."""
    equations = model().derive()
    with zipfile.ZipFile(equations.write_fmu(tmp_path / "m.fmu", version)) as archive:
        archive.extractall(tmp_path)
    sources = tmp_path / "sources"
    files = [str(file) for file in sorted(sources.glob("*.c")) if file.name != f"fmi{version}.c"]
    flags = "-std=c99 -O1 -fsanitize=address,undefined -fno-sanitize-recover=all -Wall -Wextra -Werror"
    command = ["gcc", *flags.split(), f"-DVERSION={version}", f"-I{sources}", str(ABUSE), *files, "-o", "abuse", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run(["./abuse", "150"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


@pytest.mark.parametrize(("model", "version"), BOTH)
def test_functions_are_those_of_the_headers_of_the_standard(model: Any, version: str, tmp_path: Path) -> None:
    """A compiler compares the declarations of the standard, as FMPy has them; every function of a unit is exported."""
    with zipfile.ZipFile(model().derive().write_fmu(tmp_path / "m.fmu", version)) as archive:
        archive.extractall(tmp_path)
    headers, source = Path(fmpy.__file__).parent / "c-code", tmp_path / "sources" / f"fmi{version[0]}.c"
    flags = ["-std=c99", "-pedantic-errors", "-DFMI_HEADERS", f"-I{headers}", "-fsyntax-only"]
    subprocess.run(["gcc", *flags, str(source)], check=True)
    declared = set(re.findall(r"\b(fmi[23]\w+)TYPE\s+fmi", (headers / f"fmi{version[0]}Functions.h").read_text()))
    library = ctypes.CDLL(str(next(tmp_path.glob("binaries/*/*"))))
    assert len(declared) > 40
    assert [name for name in sorted(declared) if not hasattr(library, name)] == []


@pytest.mark.thorough
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_sources_rebuild_elsewhere(version: str, tmp_path: Path) -> None:
    path = models.build("double_pendulum").derive().write_fmu(tmp_path / "double_pendulum.fmu", version)
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
    one, other = (ball().derive().write_fmu(tmp_path / f"{k}.fmu", "2.0") for k in "ab")
    assert one.read_bytes() == other.read_bytes()


def test_names_units_and_start_values(tmp_path: Path) -> None:
    m = models.build("engine")
    m.output("theta", "theta")
    m.simulation = {"end": 0.5, "rtol": 1e-7, "atol": 1e-5}
    path = m.derive().write_fmu(tmp_path / "engine.fmu")
    described = read_model_description(str(path))
    assert [float(getattr(described.defaultExperiment, key)) for key in ("stopTime", "tolerance")] == [0.5, 1e-7]
    variables = {v.name: v for v in described.modelVariables}
    assert variables["theta"].initial == "exact"
    assert variables["s"].initial == "approx"
    assert variables["theta_out"].causality == "output"
    r = variables["r"]
    assert (r.causality, r.variability, r.start) == ("parameter", "tunable", "0.04")
    assert (r.description, r.unit) == ("crank", "m")
    assert variables["der(theta_dot)"].unit == "rad/s^2"
    units = {u.name: u for u in read_model_description(str(path)).unitDefinitions}
    assert (units["mm"].baseUnit.m, float(units["mm"].baseUnit.factor)) == (1, 1e-3)
    assert (units["N*m*s^2"].baseUnit.kg, units["N*m*s^2"].baseUnit.m) == (1, 2)


def test_impacts_are_refused_by_name(tmp_path: Path) -> None:
    m = ball()
    m.event("gap", "h - 0.5", restitution=0.5)
    refuses("EG-UNSUPPORTED events.gap.restitution FMU", lambda: m.derive().write_fmu(tmp_path / "m.fmu"))
    assert not list(tmp_path.iterdir())


def test_the_command_replaces_its_own_file_alone(tmp_path: Path) -> None:
    example, kind = models.EXAMPLES / "slider_crank.yaml", ("--target", "fmu", "--fmi", "3.0")
    words = ("generate", example, "--out", tmp_path, *kind, "--json")
    assert run(*words).code == 0
    told = run(*words).json
    assert (told["name"], Path(told["folder"])) == ("slider_crank", tmp_path / "slider_crank.fmu")
    (tmp_path / "slider_crank.fmu").write_text("mine")
    refused = run(*words)
    assert refused.code == 2
    assert "was not written by eomgen" in refused.err
    assert (tmp_path / "slider_crank.fmu").read_text() == "mine"


def test_wrong_names_and_versions(tmp_path: Path) -> None:
    equations = ball().derive()
    refuses("EG-CHOICE 4 FMI 2.0 3.0", equations.write_fmu, tmp_path / "x.fmu", "4")
    refuses("EG-FILE .fmu", equations.write_fmu, tmp_path / "x.zip")


# Before a unit runs: start values, what follows from them, and its derivatives.


def test_derivatives_of_start_states_follow_the_loops(crank: tuple[Path, Any]) -> None:
    """In initialization mode dependent states are unknowns: by theta, its rate and the crank, of the closed form.

    s = r cos(theta) + sqrt(l^2 - r^2 sin(theta)^2).
    """
    path, module = crank
    instance, at = opened(path)
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    value = dict(zip((*module.p_names, *module.x_names), [*module.p, *module.x0()], strict=True))
    theta, r, l, w = sp.symbols("theta r l w", real=True)
    s = r * sp.cos(theta) + sp.sqrt(l**2 - r**2 * sp.sin(theta) ** 2)
    s_dot = sp.diff(s, theta) * w
    s_ddot = sp.diff(s_dot, theta) * w  # and the crank's acceleration is another unknown
    numbers = {theta: value["theta"], r: value["r"], l: value["l"], w: value["theta_dot"]}
    for known, symbol in (("theta", theta), ("theta_dot", w), ("r", r), ("l", l)):
        unknowns = [at[name] for name in ("s", "s_dot", "der(s)", "speed", "der(s_dot)", "der(theta_dot)")]
        found = instance.getDirectionalDerivative(unknowns, [at[known]], [1.0])
        of_s, of_v = (float(sp.diff(x, symbol).subs(numbers)) for x in (s, s_dot))
        np.testing.assert_allclose(found[:4], [of_s, of_v, of_v, of_v], rtol=1e-8, atol=1e-9)
        alpha = sp.Symbol("alpha")
        whole = s_ddot + sp.diff(s, theta) * alpha
        numbers[alpha] = instance.getReal([at["der(theta_dot)"]])[0]
        expected = float((sp.diff(whole, symbol) + sp.diff(s, theta) * found[5]).subs(numbers))
        assert found[4] == pytest.approx(expected, rel=1e-7, abs=1e-8)
    instance.freeInstance()


def test_rolling_keeps_the_start_values_that_hold(tmp_path: Path) -> None:
    """A disc on a plane: lean and rates as they are set, height and velocity of the centre in closed form."""
    path = models.build("rolling_disc").derive().write_fmu(tmp_path / "rolling_disc.fmu")
    instance, at = opened(path)
    r = float(next(v for v in read_model_description(str(path)).modelVariables if v.name == "r").start)
    given = {"lean": 0.6, "x": 3.0, "yaw_dot": 2.0, "lean_dot": 0.4, "spin_dot": 5.0}
    instance.setReal([at[name] for name in given], list(given.values()))
    initialized(instance)
    found = dict(zip(at, instance.getReal(list(at.values())), strict=True))
    assert {name: found[name] for name in given} == given
    assert found["z"] == pytest.approx(r * np.cos(0.6), abs=1e-12)
    assert found["z_dot"] == pytest.approx(-r * np.sin(0.6) * 0.4, abs=1e-12)
    assert found["x_dot"] == pytest.approx(r * (5.0 + 2.0 * np.sin(0.6)), abs=1e-12)
    instance.freeInstance()


def test_loops_follow_start_values_and_parameters(crank: tuple[Path, Any]) -> None:
    """The others stay on the branch of the model's own start; what cannot be assembled is an error."""
    path, module = crank
    instance, at = opened(path)
    instance.setReal([at["theta"], at["r"], at["theta_dot"]], [2.6, 0.15, 3.0])
    initialized(instance)
    found = instance.getReal([at[name] for name in module.x_names])
    expected = module.bind(p={"r": 0.15}).x0({"theta": 2.6, "theta_dot": 3.0})
    np.testing.assert_allclose(found, expected, atol=1e-12)
    instance.reset()
    instance.setReal([at["l"]], [0.01])
    with pytest.raises(Exception, match="status 3|failed"):
        initialized(instance)
    instance.reset()
    initialized(instance)
    np.testing.assert_allclose(instance.getReal([at[name] for name in module.x_names]), module.x0(), atol=0.0)
    instance.freeInstance()


def test_an_input_with_a_signal_starts_with_it(tmp_path: Path) -> None:
    """3 + 2 cos(w t) is 5 at the start; the unit's text says that others give it; given, the motion is the model's."""
    m = eg.Model("driven")
    m.parameter("w", 4.0)
    m.prismatic("J", m.ground, m.body("b", mass=2.0), axis="x", coordinate="s")
    m.torque("push", "J", m.input("F", signal="3 + 2*cos(w*t)"))
    path = m.derive().write_fmu(tmp_path / "driven.fmu", "3.0")
    force = next(v for v in read_model_description(str(path)).modelVariables if v.name == "F")
    assert float(force.start) == 5.0
    assert force.description == "its signal over time comes from outside"
    unconnected = simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=1.0, output=["s"])
    assert unconnected["s"][-1] == pytest.approx(0.5 * 5.0 / 2.0, rel=1e-8)
    t = np.linspace(0.0, 1.0, 2001)
    signal = np.array(list(zip(t, 3.0 + 2.0 * np.cos(4.0 * t), strict=True)), dtype=[("time", float), ("F", float)])
    rows = simulate_fmu(str(path), fmi_type="ModelExchange", stop_time=1.0, input=signal, output=["s"])
    expected = m.compile(target="numpy").simulate(1.0)["s"][-1]
    assert expected == pytest.approx((1.5 + 2.0 / 16.0 * (1.0 - np.cos(4.0))) / 2.0, rel=1e-8)
    assert rows["s"][-1] == pytest.approx(expected, rel=2e-3)  # FMPy holds inputs for a while


# Contacts.


def test_co_simulation_passes_over_no_contact(tmp_path: Path) -> None:
    """A ball comes back from a thin wall, though the master's step is longer than the contact."""
    m = eg.Model("thin", gravity=(0, 0, 0))
    ball = m.body("ball", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, ball)
    wall = {"shape": "segment", "on": m.ground.at(2, 0, 0, rpy=(0, 0, np.pi / 2)), "length": 3.0}
    m.contacts("wall", {"shape": "circle", "on": ball, "radius": 0.05}, wall, {"stiffness": 1e6})
    m.initial(j_x_dot=20.0)
    path = m.derive().write_fmu(tmp_path / "thin.fmu")
    names = ["j_x", "j_x_dot"]
    run = simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=0.3, output_interval=0.15, output=names)
    assert run["j_x_dot"][-1] == pytest.approx(-20.0, rel=1e-5)
    assert np.max(run["j_x"]) < 2.0


def test_states_of_pairs_are_states_of_a_unit(tmp_path: Path) -> None:
    """A sled on sand as a unit for co-simulation goes as the module does, its sinkage and shear among the variables."""
    m = eg.Model("sled", gravity=(0, -9.81, 0))
    body = m.body("sole", mass=400.0, inertia={"zz": 30.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "plate", "on": body, "length": 1.0, "width": 0.3}
    law = {"soil": "dry_sand", "dissipation": 1.0, "lateral": False}
    m.contacts("sand", shape, {"shape": "half_plane", "on": m.ground}, law)
    m.initial(j_x_dot=1.0, j_y=-0.001)
    path = m.derive().write_fmu(tmp_path / "sled.fmu")
    names = ["j_x", "sand_shear_1", "sand_sinkage_2"]
    run = simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=0.2, output_interval=0.01, output=names)
    traj = m.compile(target="numpy").simulate(0.2)
    for name in names:
        assert run[name][-1] == pytest.approx(traj[name][-1], rel=1e-4)
    assert traj["sand_sinkage_2"][-1] > 1e-3
