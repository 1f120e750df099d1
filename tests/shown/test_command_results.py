"""What the verbs of ``eomgen`` find, print, write and draw, against closed forms and against each other."""

import csv
import webbrowser
from collections.abc import Callable
from functools import partial
from pathlib import Path

import command
import numpy as np
import pytest
from models import EXAMPLES
from PIL import Image
from sweeps import part_of

import eomgen as eg

Call = Callable[..., command.Result]
NUMPY = ("--target", "numpy")
CRANK, FOUR_BAR, PENDULUM = (EXAMPLES / f"{name}.yaml" for name in ("slider_crank", "four_bar", "pendulum"))
DOUBLE = EXAMPLES / "double_pendulum.yaml"
MODELS = sorted(EXAMPLES.glob("*.yaml"))
#: Largest change of a coordinate (rad, m) that a run must make where it is less than 1; these stand on springs.
TRAVEL = {"car_axis": 0.15, "kapitza_pendulum": 0.35, "double_wishbone": 0.4, "half_car": 0.06, "gait_leg": 0.6}
TRAVEL["hydraulic_boom"] = 0.35


@pytest.fixture
def call(tmp_path: Path) -> Call:
    """The command in an empty folder."""
    return partial(command.run, cwd=tmp_path)


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows if row[name]]) for name in rows[0]}


# -- run --------------------------------------------------------------------------------------------------------------


@pytest.mark.quick
def test_a_run_prints_writes_and_plots(call: Call, tmp_path: Path) -> None:
    words = ("run", PENDULUM, *NUMPY, "--set", "theta=0.1", "--set", "l=2", "--end", "0.5")
    result = call(*words, "--out", "r.npz", "--plot", "new/folder/p.png")
    assert result.code == 0, result.err
    for said in ("degrees of freedom", "operations", "energy", "theta", "wrote r.npz", "wrote new/folder/p.png"):
        assert said in result.out
    for stage in ("derive", "compile", "simulate"):
        assert stage in result.err
    run = eg.load_trajectory(tmp_path / "r.npz")
    assert run["theta"][0] == pytest.approx(0.1)
    assert run["theta"][-1] == pytest.approx(0.1 * np.cos(np.sqrt(9.81 / 2) * 0.5), rel=5e-3)  # a small swing
    assert (tmp_path / "new" / "folder" / "p.png").read_bytes().startswith(b"\x89PNG")
    assert call(*words, "--out", "r.csv").code == 0
    columns = table(tmp_path / "r.csv")
    np.testing.assert_array_equal(columns["theta"], run["theta"])  # every digit is kept
    assert {"t", "theta", "theta_dot", "x", "y"} <= set(columns)


def test_solver_method_and_partition_reach_the_run(call: Call) -> None:
    words = ("run", CRANK, *NUMPY, "--end", "0.3", "--json")
    one = call(*words).json
    assert (one["integration"]["method"], one["final"]["t"], one["parameters"]["r"]) == ("DOP853", 0.3, 0.1)
    other = call(*words, "--method", "lagrange", "--independent", "s").json
    assert (other["method"], other["report"]["independent"]) == ("lagrange", ["s"])
    for name, value in one["final"].items():
        assert other["final"][name] == pytest.approx(value, rel=1e-6, abs=1e-7)
    coarse = call(*words, "--solver", "radau", "--rtol", "1e-4", "--atol", "1e-6").json
    settings = {key: coarse["integration"][key] for key in ("method", "rtol", "atol")}
    assert settings == {"method": "Radau", "rtol": 1e-4, "atol": 1e-6}
    assert coarse["integration"]["jacobians"] > 0
    assert 1e-9 < abs(coarse["final"]["theta"] - one["final"]["theta"]) < 1e-2  # the tolerance reaches the integrator
    held = call(*words, "--method", "augmented", "--baumgarte", "20,20").json
    assert held["final"]["theta"] == pytest.approx(one["final"]["theta"], abs=1e-5)


@pytest.mark.parametrize("path", part_of(MODELS, lambda path: False), ids=lambda path: path.stem)
def test_examples_move_and_keep_their_energy(call: Call, tmp_path: Path, path: Path) -> None:
    run = call("run", path, "--json", "--out", "run.npz").json
    trajectory = eg.load_trajectory(tmp_path / "run.npz")
    travel = max(np.ptp(trajectory[name]) for name in run["report"]["coordinates"])
    driven = "type: driver" in path.read_text(encoding="utf-8")
    assert travel > TRAVEL.get(path.stem, 1.0)
    assert run["loop_residual"]["projected"] < 1e-10
    balance = run["energy"]["power_balance"]
    assert balance is None if driven else balance < 1e-7


def yaml(folder: Path, text: str) -> Path:
    (folder / "model.yaml").write_text(text, encoding="utf-8")
    return folder / "model.yaml"


def test_the_work_of_an_input_that_changes_over_time_is_counted(call: Call, tmp_path: Path) -> None:
    model = yaml(
        tmp_path,
        'name: pushed\ninputs: {u: {value: 0, signal: "sin(3*t)"}}\nbodies: {b: {mass: 1}}\n'
        "joints: {s: {type: prismatic, between: [ground, b], axis: x}}\n"
        "forces: {f: {type: torque, joint: s, value: u}}\nsimulation: {end: 2}\ninitial: {s_dot: 0}\n",
    )
    energy = call("run", model, *NUMPY, "--json").json["energy"]
    speed = (1.0 - np.cos(6.0)) / 3.0  # s' = (1 - cos 3t)/3
    assert energy["work"] == pytest.approx(speed**2 / 2.0, abs=1e-9)
    assert energy["power_balance"] < 1e-8
    out = call("run", model, *NUMPY).out
    assert "work of forces and inputs" in out
    assert "kept to" not in out


def test_the_loss_of_a_plastic_impact_is_reported_and_left_out_of_the_balance(call: Call, tmp_path: Path) -> None:
    """Two wheels that couple lose J_1 J_2 / (J_1 + J_2) / 2 of the square of the slip."""
    model = yaml(
        tmp_path,
        "name: clutch\nbodies: {a: {mass: 1, inertia: {zz: 0.3}}, b: {mass: 1, inertia: {zz: 0.5}}}\n"
        "joints:\n  A: {type: revolute, between: [ground, a]}\n  B: {type: revolute, between: [ground, b]}\n"
        "constraints: {clutch: {type: coupling, equation: A_dot - B_dot, closes: 1 - t}}\n"
        "initial: {A_dot: 4}\nsimulation: {end: 2}\n",
    )
    energy = call("run", model, *NUMPY, "--json").json["energy"]
    assert energy["jumps"] == pytest.approx(-0.3 * 0.5 / 0.8 / 2 * 4**2, rel=1e-12)
    assert energy["power_balance"] < 1e-10
    assert "-1.5 J at their instants" in call("run", model, *NUMPY).out


def test_what_rests_is_reported_as_resting(call: Call, tmp_path: Path) -> None:
    """A leg that falls freely keeps its angle; what the integrator leaves of its rate is not a result."""
    model = yaml(
        tmp_path,
        "name: falling\ngravity: [0, -9.81, 0]\n"
        "bodies: {hull: {mass: 5}, leg: {mass: 0.1, com: [0.13, 0, 0], inertia: {zz: 0.001}}}\n"
        "joints: {lift: {type: prismatic, between: [ground, hull], axis: y, coordinate: h}, "
        "hip: {type: revolute, between: [hull, leg], coordinate: a}}\n"
        "forces: {spring: {type: joint_spring, joint: hip, stiffness: 40, rest: -0.4}}\n"
        "initial: {a: -0.4}\nsimulation: {end: 0.5}\n",
    )
    lines = call("run", model, *NUMPY).out.splitlines()
    assert any(line.split() == ["a_dot", "0", "rad/s"] for line in lines)
    assert any(line.split() == ["h_dot", "-4.905", "m/s"] for line in lines)


@pytest.mark.filterwarnings("default")
def test_a_warning_is_reported_without_a_place_in_python(call: Call, tmp_path: Path) -> None:
    model = yaml(
        tmp_path,
        "name: hinge\ngravity: [0, -9.81, 0]\nbodies: {rod: {mass: 1, com: [0.5, 0, 0], inertia: {zz: 0.1}}}\n"
        "joints: {a: {type: revolute, between: [ground, rod], limits: {lower: -1, upper: 1}}}\n",
    )
    lines = [line for line in call("run", model, *NUMPY, "--end", "1").err.splitlines() if "limits" in line]
    assert len(lines) == 1
    assert lines[0].startswith("warning: the run passes limits of joints: a lower -1")


# -- analyses ---------------------------------------------------------------------------------------------------------


def test_linearize_and_modes(call: Call) -> None:
    rest = ("--set", "theta1=0.2", "--set", "bend=-0.1", *NUMPY)
    found = call("linearize", DOUBLE, "--equilibrium", *rest, "--json").json
    assert found["equilibrium"]
    assert found["states"] == ["theta1", "bend", "theta1_dot", "bend_dot"]
    values = np.array(found["eigenvalues"]) @ [1, 1j]
    np.testing.assert_allclose(np.sort(np.abs(np.linalg.eigvals(np.array(found["A"])))), np.sort(np.abs(values)), 1e-9)
    assert "no steady motion" in call("linearize", DOUBLE, *rest).out
    assert len(call("linearize", CRANK, "--full", *NUMPY, "--json").json["A"]) == 6
    modes = call("modes", DOUBLE, *rest, "--json").json
    np.testing.assert_allclose(np.sort(modes["frequencies"]), np.unique(np.abs(values).round(9)), rtol=1e-8)
    assert "rad/s" in call("modes", DOUBLE, *rest).out


def test_equilibrium(call: Call) -> None:
    words = ("equilibrium", CRANK, *NUMPY, "--json")
    found = call(*words, "--hold", "theta=0.4", "--unknown", "tau").json
    assert found["coordinates"]["theta"] == 0.4
    assert set(found["unknowns"]) == {"tau"}
    held = call(*words, "--set", "theta=0.4", "--hold", "theta").json
    assert held["supports"]["theta"] == pytest.approx(found["unknowns"]["tau"], rel=1e-9)


def test_consistent(call: Call) -> None:
    words = ("consistent", CRANK, *NUMPY, "--json")
    rough = ("--set", "theta=0.3", "--set", "B=-0.2", "--set", "s=0.4", "--set", "theta_dot=5")
    held = call(*words, *rough, "--hold", "theta").json
    assert held["x"]["theta"] == held["rough"]["theta"] == 0.3
    theta, B, s = (held["x"][name] for name in ("theta", "B", "s"))
    # r sin theta + l sin(theta + B) = 0 and s = r cos theta + l cos(theta + B) with r = 0.1, l = 0.35
    assert abs(0.1 * np.sin(theta) + 0.35 * np.sin(theta + B)) < 1e-12
    assert abs(s - 0.1 * np.cos(theta) - 0.35 * np.cos(theta + B)) < 1e-12
    light, heavy = (abs(call(*words, *rough, "--weight", f"s={w}").json["change"]["s"]) for w in ("1e-4", "1e4"))
    assert heavy < 0.1 * light


def test_sensitivity(call: Call, tmp_path: Path) -> None:
    words = ("sensitivity", DOUBLE, "--end", "0.2", *NUMPY)
    assert "wrote by.csv" in call(*words, "--by", "l1", "--by", "theta1", "--out", "by.csv").out
    columns = table(tmp_path / "by.csv")
    (name,) = (name for name in columns if name.startswith("d(bend)") and "l1" in name)
    ends = []
    for l1 in (1 - 1e-5, 1 + 1e-5):
        more = ("--set", f"l1={l1}", "--rtol", "1e-11", "--atol", "1e-13")
        ends.append(call("run", DOUBLE, "--end", "0.2", *NUMPY, *more, "--json").json["final"]["bend"])
    assert columns[name][-1] == pytest.approx((ends[1] - ends[0]) / 2e-5, rel=1e-5)


def test_reactions_and_inverse(call: Call, tmp_path: Path) -> None:
    found = call("reactions", CRANK, *NUMPY, "--json").json
    assert found["joints"] == ["A", "B", "C", "D"]
    assert np.array(found["undetermined"])[:, 2:5].all()
    text = call("reactions", CRANK, *NUMPY).out
    assert "0*" in text
    assert "the constraints are redundant" in text
    peaks = call("reactions", CRANK, *NUMPY, "--end", "0.05", "--out", "r.csv", "--json").json
    columns = table(tmp_path / "r.csv")
    assert np.abs(columns["A.Fx"]).max() == pytest.approx(abs(peaks["reactions"][0][0]), rel=1e-12)
    assert columns["A.Fx"][0] == pytest.approx(found["reactions"][0][0], rel=1e-9)
    words = ("inverse", CRANK, *NUMPY, "--json", "--accelerate", "theta=3")
    forces, other = call(*words).json, call(*words, "--actuated", "tau").json
    assert forces["accelerations"]["theta_ddot"] == pytest.approx(3.0, abs=1e-12)
    assert set(other["forces"]) == {"tau"}
    np.testing.assert_allclose(other["reactions"], forces["reactions"], atol=1e-9)


def test_inverse_begins_at_the_state_requested(call: Call, tmp_path: Path) -> None:
    arm = yaml(
        tmp_path,
        "name: arm\ngravity: [0, -10, 0]\nbodies: {b: {mass: 2, com: [0, -0.5, 0]}}\n"
        "joints: {A: {type: revolute, between: [ground, b], coordinate: theta}}\n",
    )
    found = call("inverse", arm, *NUMPY, "--json", "--set", "theta=0.5").json
    assert found["forces"]["theta"] == pytest.approx(10 * np.sin(0.5))


def test_impact(call: Call, tmp_path: Path) -> None:
    words = ("impact", CRANK, *NUMPY, "--gap", "s=0.5", "--closed", "--set", "theta=0.3")
    found = call(*words, "--json").json
    assert found["rates_after"][0] == pytest.approx(-0.5 * found["rates_before"][0], rel=1e-9)
    assert found["energy_lost"] > 0.0
    ball = yaml(  # that slides all along its bounce loses mu (1 + e) of its speed
        tmp_path,
        "name: ball\nbodies: {b: {mass: 2, inertia: {zz: 1}}}\njoints: {fly: {type: planar, between: [ground, b]}}\n"
        "outputs: {gap: y(b), slide: vx(b)}\ninitial: {fly_x_dot: 1, fly_y_dot: -0.5}\n",
    )
    words = ("impact", ball, *NUMPY, "--gap", "gap=0.4", "--slip", "gap=0.3:slide")
    found = call(*words, "--json").json
    np.testing.assert_allclose(found["friction"]["gap"], [-0.3 * 1.4 * 0.5 * 2])
    np.testing.assert_allclose(found["sliding_after"]["gap"], [1 - 0.3 * 1.4 * 0.5])
    assert "friction of gap  impulse -0.42, sliding 1 -> 0.79" in call(*words).out


def test_verify_of_a_right_model_ends_with_0(call: Call) -> None:
    found = call("verify", PENDULUM, *NUMPY, "--json")
    assert found.code == 0, found.err
    assert found.json["ok"] is True


# -- kinematics -------------------------------------------------------------------------------------------------------


def test_a_driven_model_runs_over_its_own_span(call: Call, tmp_path: Path) -> None:
    words = ("kinematics", EXAMPLES / "driven_slider_crank.yaml", *NUMPY, "--out", "run.csv", "--plot", "run.png")
    result = call(*words)
    assert result.code == 0, result.err
    assert "kinematics over t: 201 points" in result.out
    columns = table(tmp_path / "run.csv")
    s = 0.1 * np.cos(columns["theta"]) + np.sqrt(0.09 - 0.01 * np.sin(columns["theta"]) ** 2)
    np.testing.assert_allclose(columns["s"], s, atol=1e-14)
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_a_range_of_a_coordinate_with_limits(call: Call, tmp_path: Path) -> None:
    words = ("--range", "psi=1.2:2.5:27", "--partial", "--limits", "psi", "--limits", "theta", "--out", "m.npz")
    found = call("kinematics", FOUR_BAR, *NUMPY, *words, "--json").json
    motion = found["motion"]
    assert set(motion) == {"points", "complete", "led", "singular", "residual", "first", "last"}
    assert (motion["points"], motion["complete"], motion["led"]) == (21, False, ["psi"])
    upper = np.pi - np.arccos((0.08**2 + 0.1**2 - 0.08**2) / (2 * 0.08 * 0.1))
    (stop,) = motion["singular"]
    assert stop["values"]["psi"] == pytest.approx(upper, abs=1e-12)
    psi, theta = found["limits"]
    assert (psi["upper"], theta["upper"]) == (pytest.approx(upper, abs=1e-12), None)
    assert len(eg.load_trajectory(tmp_path / "m.npz")) == 21


def test_coordinates_over_time(call: Call, tmp_path: Path) -> None:
    """One coordinate driven, one given: both move at once, with their rates."""
    model = yaml(
        tmp_path,
        "name: table\nbodies: {a: {mass: 0}, b: {mass: 1}}\n"
        "joints:\n  X: {type: prismatic, between: [ground, a], axis: x}\n"
        "  Y: {type: prismatic, between: [a, b], axis: y}\n"
        "constraints: {d: {type: driver, coordinate: X, value: t**2}}\n",
    )
    last = call("kinematics", model, *NUMPY, "--range", "t=0:2:5", "--range", "Y=0:1", "--json").json["motion"]["last"]
    assert (last["X"], last["X_dot"], last["Y"], last["Y_dot"]) == pytest.approx((4, 4, 1, 0.5))


# -- ensembles --------------------------------------------------------------------------------------------------------


def test_a_table_of_cases(call: Call, tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("r [m], theta\n0.1,0.3\n0.5,1.2\n0.12,0.3\n")
    words = (CRANK, *NUMPY, "--end", "0.1", "--rtol", "1e-12", "--json")
    result = call("ensemble", *words, "--cases", "cases.csv", "--out", "ends.csv")
    assert result.code == 0, result.err
    found = result.json
    assert (found["count"], found["varied"], found["t"]) == (3, ["r", "theta"], 0.1)
    assert [failure["run"] for failure in found["failures"]] == [1]
    assert "cannot close" in found["failures"][0]["message"]
    alone = call("run", *words, "--set", "r=0.12", "--set", "theta=0.3").json["final"]["theta"]
    ends = table(tmp_path / "ends.csv")["theta"]
    assert ends[-1] == pytest.approx(alone, abs=1e-11)
    assert found["summary"]["theta"]["greatest"] == pytest.approx(ends[np.isfinite(ends)].max())
    for text, message in (
        ("r\n", "a line of names and a line for each run"),
        ("r,theta\n0.1\n", "cases.csv:2: 1 values for 2 names"),
        ("r\n0.1\nx\n", "cases.csv:3: r must be a number, not 'x'"),
        ("theta [deg]\n10\n", "theta is given in deg; give values in rad"),
    ):
        (tmp_path / "cases.csv").write_text(text)
        wrong = call("ensemble", CRANK, *NUMPY, "--cases", "cases.csv")
        assert (wrong.code, message in wrong.err) == (2, True)
    for mass, code in (("0.5", 0), ("-1", 1), ("nan", 1)):  # results of the others are written, the exit code says it
        (tmp_path / "cases.csv").write_text(f"m_s\n0.5\n{mass}\n")
        result = call("ensemble", *words, "--cases", "cases.csv", "--out", "ends.csv")
        assert (result.code, result.json["count"], len(result.json["failures"])) == (code, 2, code)
        assert np.isfinite(table(tmp_path / "ends.csv")["theta"]).sum() == 2 - code


def test_values_drawn_and_on_a_grid(call: Call, tmp_path: Path) -> None:
    words = ("ensemble", DOUBLE, *NUMPY, "--vary", "theta1=-pi/8:deg(5)", "--vary", "m2=0.5:2", "--count", "8")
    text = call(*words, "--end", "0.05", "--samples", "3", "--plot", "x", "x.png", "--out", "runs.npz")
    assert text.code == 0, text.err
    assert "8 runs to t = 0.05 s; varied: m2, theta1" in text.out
    assert (tmp_path / "x.png").stat().st_size > 1000
    with np.load(tmp_path / "runs.npz") as data:
        starts = data["samples"][0, 0]
        assert data["samples"].shape == (4, 3, 8)
    assert -np.pi / 8 <= starts.min() < -0.05 < starts.max() <= np.pi / 36
    means = [
        call(*words, "--end", "0.05", "--seed", seed, "--json").json["summary"]["x"]["mean"] for seed in ("0", "0", "1")
    ]
    assert means[0] == means[1] != means[2]
    grid = ("--grid", "theta1=-1:1:3", "--grid", "m2=0.5:2:2", "--end", "0.05", "--samples", "2", "--out", "grid.csv")
    found = call("ensemble", DOUBLE, *NUMPY, *grid, "--json").json
    assert (found["count"], found["varied"]) == (6, ["m2", "theta1"])
    columns = table(tmp_path / "grid.csv")
    first = columns["t"] == 0.0
    np.testing.assert_allclose(np.unique(columns["theta1"][first]), [-1, 0, 1], atol=1e-15)
    np.testing.assert_array_equal(columns["initial_theta1"][first], columns["theta1"][first])


# -- view -------------------------------------------------------------------------------------------------------------


def test_a_range_is_shown_as_a_film_or_as_pictures(call: Call, tmp_path: Path) -> None:
    words = ("view", FOUR_BAR, *NUMPY, "--range", "theta=0:2*pi:5", "--plot", "psi", "--trace", "coupler")
    told = call(*words, "--out", "turn.gif", "--json").json
    assert told == {"name": "four_bar", "points": 5, "files": ["turn.gif"], "opened": False}
    with Image.open(tmp_path / "turn.gif") as image:
        assert image.n_frames == 5
    frames = ("view", FOUR_BAR, *NUMPY, "--range", "theta=0:1:4", "--out", "frames")
    assert call(*frames).code == 0
    assert [file.name for file in sorted((tmp_path / "frames").iterdir())] == [f"frame_{k}.png" for k in range(4)]
    assert call(*frames).code == 2  # it is not empty any more


def test_a_run_opens_in_a_browser(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)
    result = call("view", FOUR_BAR, *NUMPY, "--end", "0.5", "--fps", "8", "--set", "theta=0.5")
    assert result.code == 0, result.err
    page = Path(opened[0].removeprefix("file://"))
    assert "<title>four_bar</title>" in page.read_text()
    assert f"wrote {page}" in result.out
    page.unlink()


def test_plots_take_columns_by_their_dotted_names(call: Call, tmp_path: Path) -> None:
    model = yaml(
        tmp_path,
        "name: legs\ngravity: [0, -9.81, 0]\ncomponents:\n  leg:\n"
        "    bodies: {rod: {mass: 1, com: [0.5, 0, 0], inertia: {zz: 0.1}}}\n"
        "    joints: {hip: {type: revolute, between: [ground, rod]}}\nadd: {leg: {component: leg, for: {k: 2}}}\n",
    )
    words = ("run", model, *NUMPY, "--end", "0.2")
    for more in ("--columns leg1.hip,leg2.hip_dot", "--plot-as phase", "--columns leg1.hip_dot --against leg1.hip"):
        assert call(*words, "--plot", "a.png", *more.split()).code == 0
        (tmp_path / "a.png").unlink()
