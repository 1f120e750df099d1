"""Shipped mechanisms with several loops, in the plane and in space: references, closed forms, loops and energy."""

from functools import cache
from typing import Any

import models
import numpy as np
import pytest
from refusals import refuses
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from sweeps import TARGETS, part_of

import eomgen as eg
from benchmarks.calls import FACTOR, compare
from benchmarks.models.linkages import TIMES, Motion, n_four_bar

LOOPS = 1e-10
ENERGY = 1e-8
#: Name -> what makes it conservative and move, and for how long.
FREE_MOTIONS: dict[str, dict[str, Any]] = {
    "spatial_slider_crank": {"span": 2.0},
    "spatial_four_bar": {"span": 2.0},
    "stewart_platform": {"span": 0.3, "inputs": {f"leg{k}_f": 0.0 for k in range(1, 7)}},
    "delta_robot": {"span": 0.6},  # through a singular position at 0.314 s
    "double_wishbone": {"span": 1.0},
    "excavator": {"span": 1.0},
}


def tip(module: Any, q: np.ndarray, body: str, at: Any = (0.0, 0.0, 0.0)) -> np.ndarray:
    """A point of a body in ground axes."""
    pose = module.poses(q)[module.body_names.index(body)]
    return np.asarray(pose[:3, :3] @ at + pose[:3, 3])


@pytest.mark.parametrize("name", part_of(FREE_MOTIONS, "spatial_slider_crank".__eq__))
def test_loops_stay_closed_and_energy_is_kept(name: str, module: Any) -> None:
    mod = module(name, target="cython")
    options = dict(FREE_MOTIONS[name])
    traj = mod.simulate(options.pop("span"), method="DOP853", rtol=1e-10, atol=1e-12, **options)
    assert traj.residuals.position < LOOPS
    assert max(np.abs(mod.constraints(q, rows="all")).max() for q in traj.x[: mod.n_q].T) < LOOPS
    assert traj.energy_drift < ENERGY
    assert np.ptp(traj.x[: mod.n_q], axis=1).max() > 0.1


def test_spatial_slider_crank_equals_its_reference(module: Any) -> None:
    """IFToMM benchmark library, by way of EXUDYN's test (J. Gerstmayr); known to 2e-8."""
    rows = models.reference("iftomm_spatial_slider_crank")["reference"]["U_const_angle"]["rows"]
    times = sorted(map(float, rows))
    mod = module("spatial_slider_crank", target="cython")
    traj = mod.simulate(5.0, t_eval=times, rtol=1e-12, atol=1e-13)
    place = mod.body_names.index("rod")
    for k, t in enumerate(times):
        row = rows[f"{t:g}"]
        assert traj["theta"][k] == pytest.approx(row["crank_angle"], abs=2e-7 if t > 2 else 2e-8)
        assert traj["s"][k] == pytest.approx(row["slider_x"], abs=2e-8)
        assert traj["theta_dot"][k] == pytest.approx(row["crank_rate"], abs=2e-6 if t > 2 else 2e-7)
        assert traj["s_dot"][k] == pytest.approx(row["slider_v"], abs=2e-7)
        w, x, y, z = row["conrod_quat"]
        turn = Rotation.from_matrix(mod.poses(traj.x[: mod.n_q, k])[place, :3, :3]).inv() * Rotation([x, y, z, w])
        assert turn.magnitude() < 1e-7


@pytest.mark.quick
def test_links_with_symbols_in_their_lengths_keep_their_axes() -> None:
    """With l along x of the rod M and h take 95 operations; turned, where l stood along two axes, they took 138."""
    assert eg.load_example("spatial_slider_crank").derive("embedding").operations["mass_matrix and bias"].total <= 95


@pytest.mark.quick
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("com", "tip", "most"), [("c", 1, 48 + 86), ("0.5", "2*c", 56 + 105)])
def test_symbols_along_oblique_directions_stop_no_turn(com: Any, tip: Any, most: int, seed: int) -> None:
    """A planar four-bar that lies obliquely takes as few operations as one without the choice of axes for symbols."""
    T = Rotation.random(rng=seed).as_matrix()
    x, _, z = ([repr(v) for v in row] for row in T.T.tolist())
    tensor = T @ np.diag([0.01, 0.08, 0.08]) @ T.T

    def along(size: Any) -> list[str]:
        return [f"{size}*({v})" for v in x]

    m = eg.Model("four_bar", gravity=(-9.81 * T[:, 1]).tolist())
    m.parameter("c", 0.5)
    crank, coupler, rocker = (
        m.body(name, mass=1, com=along(at), inertia=tensor)
        for name, at in [("crank", com), ("coupler", 1), ("rocker", 0.75)]
    )
    m.revolute("A", m.ground, crank, axis=z)
    m.revolute("B", crank.at(*along(tip)), coupler, axis=z)
    m.revolute("C", m.ground.at(*along(2)), rocker, axis=z)
    m.revolute("D", coupler.at(*along(2)), rocker.at(*along(1.5)), axis=z)
    m.guess(A=1.0, B=-0.5, C=1.5)
    operations = m.derive("embedding").operations
    assert operations["mass_matrix and bias"].total + operations["constraints"].total <= most


def test_spatial_four_bar_over_a_turn(module: Any) -> None:
    """The rocker follows from |pin - tip| = b: A cos phi + B sin phi = C."""
    mod = module("spatial_four_bar")
    a, b, c, d, e = (dict(zip(mod.p_names, mod.p, strict=True))[n] for n in "abcde")
    crank = np.linspace(0.3, 0.3 + 2 * np.pi, 73)
    motion = [mod.kinematics([angle]) for angle in crank]
    for angle, (q, _, _) in zip(crank, motion, strict=True):
        pin, hinge = np.array([a * np.cos(angle), a * np.sin(angle), 0.0]), np.array([d, 0.0, e])
        gap = pin - hinge  # tip - hinge = c (sin phi, 0, cos phi)
        A, B = gap[2], gap[0]
        C = (gap @ gap + c * c - b * b) / (2 * c)
        phi = np.arctan2(B, A) + np.arccos(C / np.hypot(A, B))  # the branch of the guess
        assert q[mod.q_names.index("phi")] == pytest.approx(phi, abs=1e-10)
    np.testing.assert_allclose(motion[0][0][1:], motion[-1][0][1:], atol=1e-9)  # back where it was


@pytest.mark.thorough
def test_flyball_governor_equals_its_reference(module: Any) -> None:
    """IFToMM benchmark A05, as solved by Radau at 1e-11 and 1e-12; stiff."""
    rows = models.reference("iftomm_A05_flyball_governor")["reference_rows"]
    times = [row["t"] for row in rows]
    mod = module("flyball_governor", target="cython")
    traj = mod.simulate(10.0, t_eval=times, method="Radau", rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(traj["s"], [row["s"] for row in rows], rtol=0, atol=1e-6)
    np.testing.assert_allclose(traj["s_dot"], [row["sdot"] for row in rows], rtol=0, atol=1e-5)
    np.testing.assert_allclose(traj["alpha_1"], traj["alpha_2"], rtol=0, atol=1e-9)
    assert mod.n_rows == 0  # a tree whose arms hang on springs and dampers: no loop to close
    assert (np.diff(traj["energy"]) < 1e-6 * np.abs(traj["energy"]).max()).all()  # dampers only take energy
    assert traj["energy"][-1] < traj["energy"][0]


@pytest.mark.parametrize("which", [0, 1, 2])
def test_stewart_platform_equals_its_reference(which: int, module: Any) -> None:
    """Leg lengths and rates, leg forces of a given motion, and the platform's mass matrix."""
    pose = models.reference("stewart_platform_mathworks")["poses"][which]
    mod = module("stewart_platform").bind(u={f"leg{k}_f": 0.0 for k in range(1, 7)})
    legs = [mod.q_names.index(f"leg{k}_length") for k in range(1, 7)]
    q, v, a = mod.kinematics(pose["q"], pose["qd"], pose["qdd"])
    np.testing.assert_allclose(q[legs], pose["leg_length"], rtol=1e-12)
    np.testing.assert_allclose(v[legs], pose["leg_rate"], rtol=0, atol=1e-10)
    M = np.array(pose["mass_matrix"])
    np.testing.assert_allclose(mod.embedded_mass_matrix(q), M, rtol=0, atol=1e-10 * M.max())
    B = np.column_stack([mod.kinematics(pose["q"], unit)[1] for unit in np.eye(6)])
    forces = np.linalg.solve(B[legs].T, B.T @ mod.inverse_dynamics(q, v, a))
    np.testing.assert_allclose(forces, pose["leg_force"], rtol=1e-9)


def test_the_platform_of_the_delta_robot_does_not_turn(module: Any) -> None:
    """Clavel's point; and the arms' angles follow from the platform's place in closed form."""
    mod = module("delta_robot")
    R, r, l_a, l_b = (dict(zip(mod.p_names, mod.p, strict=True))[n] for n in ("R", "r", "l_a", "l_b"))
    for angles in ([0.3, 0.4, 0.5], [0.1, 0.6, -0.1], [0.9, 0.7, 0.8]):
        q, _, _ = mod.kinematics(angles)
        pose = mod.poses(q)[mod.body_names.index("platform")]
        np.testing.assert_allclose(pose[:3, :3], np.eye(3), atol=1e-12)
        for k, theta in enumerate(angles):
            spin = 2 * np.pi * k / 3
            x = pose[:3, 3] @ [np.cos(spin), np.sin(spin), 0.0] + r - R
            y = pose[:3, 3] @ [-np.sin(spin), np.cos(spin), 0.0]
            z = pose[2, 3]  # the elbow is at (l_a cos theta, 0, -l_a sin theta): x cos - z sin = C
            C = (x * x + y * y + z * z + l_a * l_a - l_b * l_b) / (2 * l_a)
            assert np.arctan2(-z, x) - np.arccos(C / np.hypot(x, z)) == pytest.approx(theta, abs=1e-10)


def test_the_wheel_of_the_double_wishbone_follows_its_links(module: Any) -> None:
    """Its place over the bump travel, from spheres and circles alone."""
    mod = module("double_wishbone")
    low, high, arm = np.array([[0, -0.08, -0.13], [-0.03, -0.12, 0.13], [0.14, -0.09, -0.02]])
    track = np.array([0.14, 0.32, -0.06])

    def turned(hinge: list[float], ball: list[float], angle: float) -> np.ndarray:
        return np.asarray(hinge + Rotation.from_rotvec([angle, 0, 0]).apply(ball))

    guess = None
    for lift in np.linspace(0.15, -0.1, 11):
        q, _, _ = mod.kinematics([lift])
        if guess is None:
            pose = mod.poses(q)[mod.body_names.index("knuckle")]
            guess = np.concatenate([pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_rotvec(), [0.14]]) + 1e-3

        def gaps(z: np.ndarray, lift: float = lift) -> np.ndarray:
            centre, turn = z[:3], Rotation.from_rotvec(z[3:6])
            return np.concatenate([
                centre + turn.apply(low) - turned([0, 0.3, -0.12], [0.02, 0.4, -0.01], lift),
                centre + turn.apply(high) - turned([0, 0.38, 0.14], [-0.02, 0.28, 0.01], z[6]),
                [np.linalg.norm(centre + turn.apply(arm) - track) - 0.372],
            ])  # fmt: skip

        solved = least_squares(gaps, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(solved.fun).max() < 1e-12
        guess = solved.x
        np.testing.assert_allclose(tip(mod, q, "knuckle"), guess[:3], atol=1e-9)


# -- Bricard -----------------------------------------------------------------------------------------------------------
NAMES = ("x3", "y3", "z3", "x4", "y4", "z4", "angle1", "angle2", "angle3", "angle4", "angle5")


@pytest.fixture(scope="module")
def bricard() -> eg.Equations:
    return eg.load(models.EXAMPLES / "bricard.yaml").derive()


def test_the_count_says_it_cannot_move_and_the_rank_says_it_can(bricard: eg.Equations) -> None:
    report = bricard.report
    assert report.gruebler_kutzbach == 0
    assert (report.constraints, report.rank, report.degrees_of_freedom) == (5, 4, 1)
    assert len(report.redundant) == 1
    assert report.redundant[0].startswith("J6.")


@pytest.mark.parametrize("target", TARGETS)
def test_ten_seconds_of_published_motion(bricard: eg.Equations, target: str) -> None:
    values = models.reference("iftomm_A04_bricard")["values"]
    end = 10.0 if target == "cython" else 1.0
    times = np.array(sorted(float(t) for t in values if float(t) <= end))
    rows = {float(t): value for t, value in values.items()}
    expected = np.array(
        [[*rows[t]["corner3_(1,-1,0)"], *rows[t]["corner4_(1,-1,1)"], *rows[t]["angles"]] for t in times]
    ).T
    mod = bricard.compile(target=target)
    run = mod.simulate((0, end), t_eval=times)
    found = np.array([run[name] for name in NAMES])
    assert np.abs(found - expected).max() <= 1e-8
    energy = np.sum(mod.energy(run.x), axis=0)
    assert np.ptp(energy) <= 1e-8 * np.max(mod.energy(run.x)[0])
    assert np.abs(mod.constraints(run.x[: mod.n_q], rows="all")).max() <= 1e-12


# -- N four-bars -------------------------------------------------------------------------------------------------------


def crank_tip(n: int, times: np.ndarray) -> np.ndarray:
    """x and y of the first crank's tip, and the mechanism's theta rate, by the closed equation."""
    slope = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    options = {"method": "DOP853", "t_eval": times, "rtol": 3e-14, "atol": 1e-15}
    found = solve_ivp(lambda t, y: [y[1], -slope * np.cos(y[0])], (0, times[-1]), [np.pi / 2, -1.0], **options)
    return np.array([np.cos(found.y[0]), np.sin(found.y[0]), found.y[1]])


@pytest.mark.parametrize("n", [10, pytest.param(40, marks=pytest.mark.thorough)])
def test_tight_tolerances_do_not_make_steps_crawl_at_the_flat_position(n: int) -> None:
    """Steps start on the constraints, and a state that is on them to rounding is not moved by that rounding."""
    run = compiled(n).simulate((0, 10), rtol=1e-10, atol=1e-12)
    assert len(run.t) <= 400  # 142 are taken; of 10 loops 2,129 were
    x, y, _ = crank_tip(n, run.t)
    assert np.count_nonzero(np.diff(np.sign(y))) == 10  # flat ten times
    cranks = np.array([run[f"theta{k}"] for k in range(n + 1)])
    assert np.abs(cranks - cranks[0]).max() <= 1e-5  # it stays a row of parallelograms
    assert max(np.abs(run["x"] - x).max(), np.abs(run["y"] - y).max()) <= 1e-4
    assert np.ptp(run["energy"]) <= 1e-6 * run["T"].max()
    assert max(run.residuals.position, run.residuals.velocity) <= 1e-10


def test_a_state_with_more_freedoms_at_once_is_named() -> None:
    """Exactly flat, n + 1 freedoms are free at once: no accelerations of one freedom are made up."""
    mod = compiled(2)
    refuses("EG-PARTITION theta0", mod.rhs, 0.0, np.zeros(mod.n_x))


# -- Tight tolerances --------------------------------------------------------------------------------------------------
TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12)


@cache
def compiled(n: int, target: str = "cython") -> Any:
    options = {"optimize": 0} if target == "cython" else {}
    return n_four_bar(n).compile(independent=["theta0"], target=target, **options)


def test_jacobis_amplitude_is_the_published_motion() -> None:
    published = models.reference("iftomm_A02_n_four_bar")["reference_B0_xy"]["N2"]
    motion = Motion(2)
    for t, place in published.items():
        if t != "period":
            theta = motion.exact[int(np.argmin(np.abs(TIMES - float(t))))]
            assert np.abs(np.array([np.cos(theta), np.sin(theta)]) - np.array(place, dtype=float)).max() <= 1e-13


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
@pytest.mark.parametrize("n", [1, 2])
def test_the_error_is_that_of_the_closed_equation(n: int, method: str) -> None:
    for rtol in (1e-8, 1e-12) if method == "Radau" else TOLERANCES:
        found = compare(compiled(n), Motion(n), n, method, rtol)
        assert found.factor <= FACTOR, (rtol, found)
        assert found.passes == 10


@pytest.mark.parametrize(("target", "method"), [("cython", "DOP853"), ("cython", "Radau"), ("cython", "LSODA")])
def test_change_points_are_those_of_the_run_not_of_the_times_stored(target: str, method: str) -> None:
    """The loop in C, SciPy's over C, SciPy's over NumPy."""
    passed = (0.5 * np.pi - Motion(1).exact[-1] - 0.5 * np.pi) // np.pi + 1
    for times in (None, [10.0], TIMES[::20]) if target == "numpy" else (None, [10.0], TIMES[::20], TIMES):
        run = compiled(1, target).simulate((0, 10), method=method, rtol=1e-6, atol=1e-8, t_eval=times)
        points = run.change_points
        assert len(points) == passed == 10
        for point in points:
            assert point.degrees_of_freedom == 2
            assert abs(np.sin(point.coordinates["theta0"])) <= 1e-7
