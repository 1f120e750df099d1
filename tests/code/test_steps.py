"""Steps, events and tables of compiled runs: every coefficient beside SciPy's methods, closed forms, stiff problems.

Right-hand sides of any form are written as first-order states; with six states and more, steps take four at a time.
"""

import pickle
import re
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
import sympy as sm
from analysed import compiled
from children import HANGS
from command import run
from models import IN_C
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import eomgen as eg

STEPS = 8
TIMES, VALUES = [0.0, 0.4, 1.0, 1.7, 2.0], [1.0, -0.5, 0.3, 0.2, 2.0]


@cache
def mixed(copies: int) -> Any:
    """A free mass beside nonlinear states, pushed by an input; as many copies of the states as asked for, unlike."""
    m = eg.Model("mixed")
    m.prismatic("J", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="s")
    m.torque("push", "J", m.input("F"))
    for k in range(copies):
        w = 1.0 + 0.2 * k
        m.state(f"a{k}", f"sin(b{k}) + cos({w}*t)", initial=0.5 + 0.1 * k)
        m.state(f"b{k}", f"-0.3*a{k}*c{k}", initial=1.0)
        m.state(f"c{k}", f"exp(-t) - {w}*c{k}*a{k} + b{(k + 1) % copies}", initial=-0.3)
    m.initial(s_dot=0.2)
    return m.compile(**IN_C)


@pytest.mark.parametrize("copies", [1, 3], ids=["few states", "many states"])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau"])
def test_steps_are_those_of_scipy(method: str, copies: int) -> None:
    """Times of the steps, states at their ends and between, and how often the rates were asked for."""
    mod = mixed(copies)
    x0, options = mod.x0(), {"rtol": 1e-6, "atol": 1e-9}
    more = {"jac": mod.jacobian} if method == "Radau" else {}
    whole = solve_ivp(mod.rhs, (0.0, 8.0), x0, method=method, dense_output=True, **options, **more)
    run = mod.simulate((0.0, 8.0), x0, method=method, **options)
    assert len(run.t) == len(whole.t)
    np.testing.assert_allclose(run.t, whole.t, rtol=1e-6)  # from an estimate in which digits cancel
    first = run.t[: STEPS + 1]
    inside = (first[:-1, None] + np.diff(first)[:, None] * [0.25, 0.5, 0.75, 1.0]).ravel()
    asked = mod.simulate((0.0, 8.0), x0, method=method, t_eval=inside, **options)
    np.testing.assert_allclose(asked.x, whole.sol(inside), rtol=1e-8, atol=3e-9)
    counted = solve_ivp(mod.rhs, (0.0, 8.0), x0, method=method, **options, **more).nfev
    assert run.nfev == pytest.approx(counted, rel=0.03 if method == "Radau" else 0)


def test_an_implicit_method_halves_systems_of_second_order() -> None:
    """A stiff oscillator takes the steps of SciPy's Radau, and its Newton's method converges as fast."""
    mod = compiled("oscillator", "cython").bind({"k": 400.0, "c": 0.3})
    options = {"rtol": 1e-9, "atol": 1e-11}
    judge = solve_ivp(mod.rhs, (0.0, 2.0), [2.0, 0.0], "Radau", jac=mod.jacobian, **options)
    run = mod.simulate(2.0, [2.0, 0.0], method="Radau", **options)
    np.testing.assert_allclose(run.x[:, -1], judge.y[:, -1], atol=1e-7)
    assert len(run.t) == pytest.approx(len(judge.t), rel=0.02)
    assert run.nfev == pytest.approx(judge.nfev, rel=0.02)


def test_taylors_method_keeps_its_tolerance() -> None:
    """x' = x^2, y' = -y from 1/2 and 1: 1 / (2 - t) and exp(-t), at the ends of few steps and between."""
    m = eg.Model("series")
    m.prismatic("J", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="s")
    m.state("x", "x*x", initial=0.5)
    m.state("y", "-y", initial=1.0)
    mod = m.compile(**IN_C)
    run = mod.simulate(1.5, method="Taylor", rtol=1e-10, atol=1e-10)
    assert len(run.t) <= STEPS + 1
    inside = (run.t[:-1, None] + np.diff(run.t)[:, None] * [0.25, 0.5, 0.75, 1.0]).ravel()
    asked = mod.simulate(1.5, method="Taylor", t_eval=inside, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(asked["x"], 1.0 / (2.0 - inside), rtol=1e-9)
    np.testing.assert_allclose(asked["y"], np.exp(-inside), rtol=1e-9)
    ends = mod.simulate(1.5, method="Taylor", t_eval=np.nextafter(run.t[1:], 0.0), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(ends.x, run.x[:, 1:], rtol=1e-13, atol=1e-14)  # the series ends where the step does


def test_taylors_steps_are_judged_by_their_ends() -> None:
    """q'' = -q^3 from 0 at speed 1, where the first coefficients vanish; energy v^2/2 + q^4/4 stays."""
    mod = compiled("oscillator", "cython").bind({"a": 1.0})
    for rtol in (1e-6, 1e-9):
        run = mod.simulate(20.0, [0.0, 1.0], method="Taylor", rtol=rtol, atol=rtol)
        judge = solve_ivp(lambda t, x: [x[1], -(x[0] ** 3)], (0.0, 20.0), [0.0, 1.0], "DOP853", rtol=1e-12, atol=1e-13)
        assert np.abs(run.x[:, -1] - judge.y[:, -1]).max() <= 30 * rtol
        assert np.abs(run["s_dot"] ** 2 / 2 + run["s"] ** 4 / 4 - 0.5).max() <= 10 * rtol


def test_zeros_are_found_in_their_directions() -> None:
    """sin t rises through 0 at 2 pi and falls at pi; 1 - 1e-4 - sin t dips below 0 within a step; the run ends at 9."""
    m = eg.Model("clock")
    m.prismatic("J", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="c")
    m.initial(c_dot=1.0)
    m.state("x", "cos(t)")
    for name, text, options in (
        ("rise", "x", {"direction": 1}), ("fall", "x", {"direction": -1}), ("both", "x", {}),
        ("dip", "1 - 1e-4 - x", {}), ("end", "c - 9", {"terminal": True}),
    ):  # fmt: skip
        m.event(name, text, **options)
    run = m.compile(optimize=0).simulate(12.0, rtol=1e-12, atol=1e-13)
    width = np.arccos(1.0 - 1e-4)
    assert np.diff(run.t).mean() > 4.0 * width
    dips = [n * np.pi + side * width for n in (0.5, 2.5) for side in (-1.0, 1.0)]
    for name, zeros in {
        "rise": [2 * np.pi], "fall": [np.pi], "both": [np.pi, 2 * np.pi], "dip": dips, "end": [9.0],
    }.items():  # fmt: skip
        times = [t for t in run.t_events[name] if t > 0.0]
        assert times == pytest.approx(zeros, abs=1e-9), name
    assert run.t[-1] == pytest.approx(9.0, abs=1e-12)


def test_after_a_reset_rates_are_those_of_the_new_state() -> None:
    """A ball with restitution 0.9 beside a state that follows its speed, for 4 s and until its bounces accumulate."""
    mod = compiled("hopper", "cython")
    fall, speed = np.sqrt(2 / 9.81), np.sqrt(2 * 9.81)
    hits = fall + np.concatenate([[0.0], np.cumsum(2 * speed * 0.9 ** np.arange(1, 20) / 9.81)])
    k = int((hits < 4.0).sum())
    after, up = 4.0 - hits[k - 1], speed * 0.9**k
    for method in ("DOP853", "RK45"):
        run = mod.simulate(4.0, method=method, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(run.t_events["floor"], hits[:k], atol=1e-9)
        assert run["h"][-1] == pytest.approx(up * after - 9.81 * after**2 / 2, abs=1e-8)
        assert run["h_dot"][-1] == pytest.approx(up - 9.81 * after, abs=1e-8)
        assert len(run.t) <= 60  # steps begin anew after a reset, and are not small for long
    with pytest.raises(eg.ZenoError):
        mod.simulate(20.0)


@pytest.mark.parametrize("kind", ["zero-order", "linear", "cubic"])
def test_tables_are_read_as_scipy_reads_them(kind: str) -> None:
    """A unit mass is pushed by a table: its speed is the integral; the output reads the table itself."""
    run = compiled("oscillator", "cython").simulate(
        2.3, inputs={"F": eg.Signal(TIMES, VALUES, kind)}, t_eval=np.linspace(0.0, 2.3, 47), rtol=1e-11, atol=1e-12
    )
    t, spline = run.t, CubicSpline(TIMES, VALUES)
    last = np.clip(np.searchsorted(TIMES, t, side="right") - 1, 0, len(TIMES) - 1)
    values = {
        "zero-order": np.array(VALUES)[last], "linear": np.interp(t, TIMES, VALUES),
        "cubic": spline(np.clip(t, TIMES[0], TIMES[-1])),
    }[kind]  # fmt: skip
    np.testing.assert_allclose(run["force"], values, rtol=1e-12, atol=1e-13)
    fine = np.linspace(0.0, 2.3, 46001)
    at = np.clip(np.searchsorted(TIMES, fine[:-1] + 1e-9, side="right") - 1, 0, len(TIMES) - 1)
    middle = 0.5 * (fine[1:] + fine[:-1])
    rates = {
        "zero-order": np.array(VALUES)[at], "linear": np.interp(middle, TIMES, VALUES),
        "cubic": spline(np.clip(middle, TIMES[0], TIMES[-1])),
    }[kind]  # fmt: skip
    speed = np.concatenate([[0.0], np.cumsum(rates * np.diff(fine))])
    np.testing.assert_allclose(run["s_dot"], np.interp(t, fine, speed), atol=2e-9 if kind != "cubic" else 2e-8)


# -- Radau IIA, stiff problems of the literature
def test_one_step_multiplies_by_the_stability_function() -> None:
    """R(z) = (1 + 2z/5 + z^2/20) / (1 - 3z/5 + 3z^2/20 - z^3/60): Hairer and Wanner, section IV.3, table 3.1."""
    module = compiled("oscillator", "cython")  # q'' = -k q - c q'
    for k, c, h in ((1.0, 0.1, 0.3), (1e8, 1e4, 0.1), (1e6, 0.0, 0.05)):
        mod = module.bind({"k": k, "c": c})
        x0 = np.array([1.0, -0.5])
        solver = mod.Radau(mod.rhs, 0.0, x0, 1.0, first_step=h, max_step=h, rtol=1e-2, atol=1e9)
        solver.step()
        assert solver.t == h
        Z, one = h * np.array([[0.0, 1.0], [-k, -c]]), np.eye(2)
        top = one + 0.4 * Z + Z @ Z / 20
        bottom = one - 0.6 * Z + 0.15 * Z @ Z - Z @ Z @ Z / 60
        expected = np.linalg.solve(bottom, top @ x0)
        np.testing.assert_allclose(solver.y, expected, rtol=1e-9, atol=1e-10 * np.abs(x0 * [1, np.sqrt(k)]).max())


def test_van_der_pol() -> None:
    """E. Hairer, G. Wanner, section IV.10 and their test set: eps = 1e-6, y(0) = (2, 0), values at t = 1 and 2."""
    q, v, eps = *sm.symbols("q q_dot"), sm.Rational(1, 10**6)
    model = eg.Model.from_lagrangian("van_der_pol", eps * v**2 / 2 - q**2 / 2, [q], forces={q: (1 - q**2) * v})
    mod = model.compile(target="numpy")
    known = {1.0: (-1.863646254808130, 0.7535430865435460), 2.0: (1.706167732170456, -0.8928097010248257)}
    for t, expected in known.items():
        found = solve_ivp(mod.rhs, (0, t), [2.0, 0.0], method=mod.Radau, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(found.y[:, -1], expected, rtol=1e-10)
    assert len(solve_ivp(mod.rhs, (0, 2), [2.0, 0.0], method=mod.Radau, rtol=1e-6, atol=1e-8).t) < 1_200


@pytest.mark.thorough
def test_robertson() -> None:
    """Test set for IVP solvers (Mazzia, Magherini), problem ROBER at t = 1e11; concentrations are velocities here."""
    names = [sm.symbols(f"q{i} q{i}_dot") for i in (1, 2, 3)]
    (q1, a), (q2, b), (q3, c) = names
    slow, fast, middle = sm.Float("0.04") * a, 3 * 10**7 * b**2, 10**4 * b * c
    forces = {q1: middle - slow, q2: slow - middle - fast, q3: fast}
    model = eg.Model.from_lagrangian("robertson", (a**2 + b**2 + c**2) / 2, [q1, q2, q3], forces=forces)
    mod = model.compile(kernels=["rhs", "jacobian"], optimize=0)
    atol = np.array([1e30, 1e30, 1e30, 1e-16, 1e-20, 1e-12])
    found = solve_ivp(mod.rhs, (0, 1e11), [0, 0, 0, 1.0, 0, 0], method=mod.Radau, rtol=1e-8, atol=atol)
    assert found.success
    expected = [0.2083340149701255e-07, 0.8333360770334713e-13, 0.9999999791665050]
    np.testing.assert_allclose(found.y[3:, -1], expected, rtol=1e-5)


# -- ensembles: runs side by side, x'' = -k x + u, each with a stiffness of its own.

COUNT, SLOPE, LATE = 7, 0.6, 0.4
SAMPLES = np.linspace(0.0, 3.0, 13)
LANES = {"DOP853": 1e-8, "RK45": 1e-8, "Taylor": 1e-10}


def swings(k: int, forced: bool) -> np.ndarray:
    """x and x' at all times: about u / k, or pushed by a ramp from a time on."""
    stiffness, x, v = 2.0 + 5.0 * k, 1.0 - 0.2 * k, 0.5 * k
    w, rest = np.sqrt(stiffness), 0.0 if forced else 0.3 * k / stiffness
    c, s = np.cos(w * SAMPLES), np.sin(w * SAMPLES)
    places, speeds = rest + (x - rest) * c + v / w * s, -(x - rest) * w * s + v * c
    if forced:
        late = np.maximum(SAMPLES - LATE, 0.0)
        places = places + SLOPE / stiffness * (late - np.sin(w * late) / w)
        speeds = speeds + SLOPE / stiffness * (1.0 - np.cos(w * late)) * (SAMPLES > LATE)
    return np.stack([places, speeds])


@pytest.mark.parametrize(
    ("forced", "method"),
    [*((False, method) for method in LANES), *((True, method) for method in LANES if method != "Taylor")],
)
def test_every_run_of_an_ensemble_has_its_own_closed_form(method: str, forced: bool) -> None:
    """With about as many steps as SciPy takes: those of lanes are a ninth shorter, so that fewer are rejected.

    The first step is too long and is tried again.
    """
    mod, rtol = compiled("oscillator", "cython"), LANES[method]
    k = np.arange(COUNT)
    ramp = {"F": eg.Signal([0.0, LATE, 10.0], [0.0, 0.0, SLOPE * (10.0 - LATE)], "linear")}
    runs = mod.simulate_many(
        3.0, {"s": 1.0 - 0.2 * k, "s_dot": 0.5 * k}, parameters={"k": 2.0 + 5.0 * k},
        inputs=ramp if forced else {"F": 0.3 * k}, method=method, t_eval=SAMPLES, rtol=rtol, atol=1e-9,
        first_step=1.5,
    )  # fmt: skip
    assert runs.ok.all()
    for one in range(COUNT):
        np.testing.assert_allclose(runs.samples[:, :, one], swings(one, forced), atol=60 * rtol)
    if forced:
        return
    for one in range(COUNT):
        if method == "Taylor":  # terms (w h)^p / p! of order 16 come down to 1e-10 at w h = 1.6
            assert runs.steps[one] <= 3.0 * np.sqrt(2.0 + 5.0 * one) / 1.2 + 1
            continue
        judge = solve_ivp(
            lambda t, x, one=one: [x[1], 0.3 * one - (2.0 + 5.0 * one) * x[0]], (0.0, 3.0),
            [1.0 - 0.2 * one, 0.5 * one], method, rtol=rtol, atol=1e-9, first_step=1.5,
        )  # fmt: skip
        assert 0.95 * (len(judge.t) - 1) <= runs.steps[one] <= 1.2 * (len(judge.t) - 1) + 2


# -- batches of states in vectors and ensembles ------------------------------------------------------------------------
OTHER = """
import pickle, sys
import numpy as np
module, x = pickle.load(open(sys.argv[1], 'rb')), np.load(sys.argv[2])
np.save(sys.argv[3], module.rhs(0.0, x) if len(x[0]) > 100 else module.simulate_many(0.3, x, rtol=1e-8).x)
"""


@pytest.fixture
def named(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., eg.Model]:
    """A model whose code no other function has."""

    def make(name: str = "two_link_manipulator") -> eg.Model:
        own = request.node.originalname
        text = (models.EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8")
        (tmp_path / "named.yaml").write_text(re.sub("^name: .*", f"name: {own}", text, flags=re.MULTILINE))
        return eg.load(tmp_path / "named.yaml")

    return make


def states(k: int, n: int = 4) -> np.ndarray:
    return np.random.default_rng(k).uniform(-3.0, 3.0, (n, k))


def kinds(model: eg.Model) -> list[str]:
    """What the cache holds of a model."""
    entries = run("cache", "list", "--json").json["entries"]
    return sorted(entry["kind"] for entry in entries if entry["name"] == model.name)


def test_a_batch_brings_the_lanes_and_the_bits_stay(named: Callable[..., eg.Model]) -> None:
    model = named()
    module, x = model.compile(optimize=0), states(5000)
    few = module.rhs(0.0, x[:, :100])
    module.simulate(0.1)
    assert kinds(model) == ["model"]
    mass = module.mass_matrix(x[:2])
    assert kinds(model) == ["lanes", "model"]
    np.testing.assert_array_equal(module.rhs(0.0, x)[:, :100], few)
    heavy = module.bind({"m2": 3.0})
    np.testing.assert_array_equal(heavy.mass_matrix(x[:2])[..., 7], heavy.mass_matrix(x[:2, 7]))
    np.testing.assert_array_equal(model.compile(lanes=2, optimize=0).mass_matrix(x[:2]), mass)


@pytest.mark.parametrize("name", ["slider_crank", pytest.param("gait_leg", marks=pytest.mark.thorough)])
def test_every_column_has_the_bits_of_a_single_call(name: str) -> None:
    """With parameters, times and inputs of their own, whatever the neighbours hold: some that fail among them."""
    module, rng = compiled(name, "cython"), np.random.default_rng(1)
    start = module.x0()
    x = start[:, None] + 0.01 * rng.normal(size=(module.n_x, 4500))
    t, u = rng.uniform(0.0, 1.0, 4500), rng.normal(size=(module.n_u, 4500))
    found = module.rhs(t, x, u=u)
    for k in (0, 1, 7, 2048, 4499):
        np.testing.assert_array_equal(found[:, k], module.rhs(t[k], x[:, k].copy(), u=u[:, k]))
    if name == "slider_crank":
        x[2, 1000] = 50.0  # cannot be closed
        with pytest.raises(eg.ProjectionError):
            module.rhs(t, x, u=u)


def test_an_ensemble_is_compiled_when_it_is_requested(named: Callable[..., eg.Model], tmp_path: Path) -> None:
    """Processes and threads that need it at once wait for one build, and all have the same numbers."""
    model, x = named(), 0.3 * states(20)
    module = model.compile(optimize=0)
    (tmp_path / "module").write_bytes(pickle.dumps(module))
    np.save(tmp_path / "x.npy", x)
    command = [sys.executable, "-c", OTHER, str(tmp_path / "module"), str(tmp_path / "x.npy")]
    others = [subprocess.Popen([*command, str(tmp_path / f"{k}.npy")]) for k in range(2)]
    found: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: found.append(module.simulate_many(0.3, x, rtol=1e-8).x)) for _ in "abc"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [other.wait(timeout=HANGS) for other in others] == [0, 0]
    for k in range(2):
        np.testing.assert_array_equal(np.load(tmp_path / f"{k}.npy"), found[0])
    assert len(found) == 3
    assert all((one == found[0]).all() for one in found)
    assert kinds(model) == ["lanes", "model"]
    alone = module.simulate(0.3, x[:, 3], rtol=1e-10).x[:, -1]
    np.testing.assert_allclose(found[0][:, 3], alone, atol=1e-6)
    # what was built needs no compiler in another process
    np.save(tmp_path / "x.npy", many := states(5000))
    command[2] = "import os; os.environ['CC'] = '/nowhere/cc'\n" + OTHER
    subprocess.run([*command[:1], "-W", "error", *command[1:], str(tmp_path / "y.npy")], check=True)
    np.testing.assert_array_equal(np.load(tmp_path / "y.npy"), module.rhs(0.0, many))


@pytest.mark.parametrize("what", ["batch", "ensemble"])
@pytest.mark.parametrize("reason", ["compiler", pytest.param("cache", marks=pytest.mark.thorough)])
def test_what_cannot_be_compiled_is_done_without(
    what: str, reason: str, named: Callable[..., eg.Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One warning, and the right numbers; each time of a build of its own, which has tried nothing yet."""
    module, x = named().compile(optimize=0, extra=[f"-DTRIED={what}_{reason}"]), 0.3 * states(5000)
    attempts = Path(run("cache", "list", "--json").json["directory"]) / "attempts"
    aside = attempts.with_name("aside")
    if reason == "compiler":
        monkeypatch.setenv("CC", "/nowhere/cc")
    else:
        attempts.rename(aside)
        attempts.write_text("in the way, as for any user a read-only folder is")
    call: Callable[[], Any] = (
        (lambda: module.rhs(0.0, x)) if what == "batch" else lambda: module.simulate_many(0.2, x[:, :3], rtol=1e-10).x
    )
    try:
        words = "CC does not work" if reason == "compiler" else "cannot be written"
        with pytest.warns(RuntimeWarning, match=rf"(?s)are computed .*{words}"):
            found = call()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            np.testing.assert_array_equal(call(), found)
    finally:
        if aside.exists():
            attempts.unlink()
            aside.rename(attempts)
    for k in range(3):
        one = x[:, k].copy()
        expected = module.rhs(0.0, one) if what == "batch" else module.simulate(0.2, one, rtol=1e-10).x[:, -1]
        np.testing.assert_allclose(found[:, k], expected, rtol=0, atol=0 if what == "batch" else 1e-8)


@pytest.mark.parametrize("native", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_tables_and_native_instructions(native: bool) -> None:
    """A module for this processor alone contracts a*b + c, in lanes and in single calls alike."""
    m = eg.Model("tabled")
    points = np.linspace(-0.1, 0.1, 21)
    force = m.table("force", points, 4000 * points + 3e5 * points**3)
    m.prismatic("s", m.ground, m.body("buffer", mass=2.0), axis="x")
    m.actuator("spring", "s", -force(m.coordinate("s")))
    x = np.random.default_rng(5).uniform(-0.15, 0.15, (2, 5000))
    plain = m.compile(optimize=0)
    found = plain.rhs(0.0, x)
    np.testing.assert_array_equal(found[:, 17], plain.rhs(0.0, x[:, 17].copy()))
    if native:
        np.testing.assert_allclose(m.compile(native=True).rhs(0.0, x), found, rtol=1e-10, atol=1e-9)
