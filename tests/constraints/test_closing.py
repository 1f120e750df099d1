"""Constraints that close and open: momenta, a published walker, impacts solved with NumPy, derivatives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import ModelError

G = 9.81
TARGETS = ("numpy", "cython")


def carts(**keys: object) -> eg.Model:
    """A cart runs into another, which hangs on a spring, and is latched."""
    m = eg.Model("carts")
    k = m.parameter("k", 10.0)
    a, b = m.body("a", mass=2.0), m.body("b", mass=3.0)
    m.prismatic("x1", m.ground, a, axis="x")
    m.prismatic("x2", m.ground, b, axis="x")
    m.joint_spring("spring", "x2", stiffness=k)
    latch = m.coupling("latch", {"x1": 1, "x2": -1}, closes="x2 - x1", **keys)
    m.output("F", latch.multiplier())
    m.initial(x1=-1, x1_dot=1.5)
    return m


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "LSODA"])
def test_two_carts_latch(method: str, target: str) -> None:
    """m1 v = (m1 + m2) v+, then they swing with sqrt(k / (m1 + m2)); the latch pulls with m1 x''."""
    mod = carts().compile(target=target)
    run = mod.simulate(3.0, method=method)
    hit, speed, w = 1.0 / 1.5, 2.0 * 1.5 / 5.0, np.sqrt(10.0 / 5.0)
    assert run.t_events["latch_closes"] == pytest.approx([hit], rel=1e-9)
    assert run["latch_closed"][[0, -1]] == pytest.approx([0.0, 1.0])
    late = run.t > hit + 1e-9
    assert run["x1_dot"][late] == pytest.approx(speed * np.cos(w * (run.t[late] - hit)), abs=1e-6)
    assert np.abs(run["x1"] - run["x2"])[late].max() < 1e-8
    force = mod.outputs(run.t, run.x)[0][late]
    assert force == pytest.approx(2.0 * speed * w * np.sin(w * (run.t[late] - hit)), abs=1e-5)


@pytest.mark.parametrize("target", TARGETS)
def test_a_second_latch_carries_nothing(target: str) -> None:
    """Of two that demand the same; the motion is that of one."""
    m = carts()
    again = m.coupling("again", {"x1": 2, "x2": -2}, closes="x2 - x1")
    m.output("F2", again.multiplier())
    mod, single = m.compile(target=target), carts().compile(target="numpy")
    run, other = mod.simulate(3.0), single.simulate(3.0)
    assert run["x1"][-1] == pytest.approx(other["x1"][-1], abs=1e-8)
    assert [run["latch_closed"][-1], run["again_closed"][-1]] == [1.0, 1.0]
    assert mod.outputs(run.t, run.x)[1][-1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("target", TARGETS)
def test_latch_opens_where_it_would_pull(target: str) -> None:
    """Bodies that only touch part where the spring begins to pull: after half a swing, at the speed of the impact."""
    m = carts(opens="multiplier(latch)")
    m.simulation(end=3.0)
    mod = m.compile(target=target)
    run = mod.simulate(6.0)
    hit, speed, w = 1.0 / 1.5, 2.0 * 1.5 / 5.0, np.sqrt(10.0 / 5.0)
    assert run.t_events["latch_opens"] == pytest.approx([hit + np.pi / w], rel=1e-7)
    assert run["x1_dot"][-1] == pytest.approx(-speed, rel=1e-7)
    assert len(run.t_events["latch_closes"]) == 1


def test_ensembles_and_derivatives() -> None:
    """All runs latch at their own times; the derivatives by initial values and parameters are those of differences."""
    mod = carts(opens="multiplier(latch)").compile()
    starts = {"x1_dot": np.array([1.0, 1.5, 2.0])}
    many = mod.simulate_many((0, 4.0), initial=starts, t_eval=[0.0, 4.0])
    for k, v in enumerate(starts["x1_dot"]):
        single = mod.simulate(4.0, initial={"x1_dot": v})
        assert many["x1"][-1, k] == pytest.approx(single["x1"][-1], abs=1e-7)

    def end(v: float, k: float) -> np.ndarray:
        run = mod.simulate(4.0, initial={"x1_dot": v}, parameters={"k": k}, rtol=1e-12, atol=1e-13)
        return run.x[:4, -1]

    found = mod.sensitivities(["k", "x1_dot"], 4.0)
    h = 1e-5
    by_k = (end(1.5, 10.0 + h) - end(1.5, 10.0 - h)) / (2 * h)
    by_v = (end(1.5 + h, 10.0) - end(1.5 - h, 10.0)) / (2 * h)
    slopes = found.dx[:4, :, -1]
    assert slopes[:, found.names.index("k")] == pytest.approx(by_k, abs=1e-5)
    assert slopes[:, found.names.index("x1_dot")] == pytest.approx(by_v, abs=1e-5)


@pytest.mark.parametrize("target", TARGETS)
def test_clutch_of_two_discs(target: str) -> None:
    """The discs take the common speed of their angular momentum, wherever they are, and part again at t = 2 s."""
    m = eg.Model("clutch")
    one, two = m.body("one", mass=1, inertia={"zz": 0.3}), m.body("two", mass=1, inertia={"zz": 0.5})
    m.revolute("a", m.ground, one)
    m.revolute("b", m.ground, two)
    m.torque("engine", "a", 0.4)
    m.coupling("clutch", equation="a_dot - b_dot", closes="1 - t", opens="2 - t")
    m.initial(a_dot=4.0)
    run = m.compile(target=target).simulate(3.0)
    joined = (0.3 * 4.0 + 0.4 * 1.0) / 0.8
    last = joined + 0.4 / 0.8
    assert [run["a_dot"][-1], run["b_dot"][-1]] == pytest.approx([last + 0.4 / 0.3, last], rel=1e-8)


def rimless_wheel(slope: float, spokes: int = 6, inertia: float = 0.4) -> eg.Model:
    """T. McGeer (1990), M. Coleman (1998): a wheel without rim; a spoke that comes down lets the last one go."""
    m = eg.Model("rimless", gravity=(G * np.sin(slope), -G * np.cos(slope), 0))
    wheel = m.body("wheel", mass=2.0, inertia={"zz": inertia})
    m.planar("fly", m.ground, wheel)
    for k in range(spokes):
        angle = 2 * np.pi * k / spokes
        wheel.marker(f"foot{k}", at=(-np.sin(angle), -np.cos(angle), 0))
    for k in range(spokes):
        before = (k + 1) % spokes
        m.hold(f"step{k}", m.ground, f"wheel.foot{k}", axes="xy", closes=f"y(wheel.foot{k})",
               closed=k == 0, releases=[f"step{before}"])  # fmt: skip
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_rimless_wheel(target: str) -> None:
    """Angular momentum about the new foot: w+ = w- (I + m l^2 cos 2 a) / (I + m l^2); a rolling speed in the end."""
    slope, m, inertia, a = 0.15, 2.0, 0.4, np.pi / 6
    mod = rimless_wheel(slope, inertia=inertia).compile(target=target)
    tilt = 0.02
    start = {"fly_x": np.sin(tilt), "fly_y": np.cos(tilt), "fly_3": -tilt, "fly_3_dot": -1.5}
    start |= {"fly_x_dot": 1.5 * np.cos(tilt), "fly_y_dot": -1.5 * np.sin(tilt)}
    run = mod.simulate(25.0, initial=start)
    times = np.sort(np.concatenate([run.t_events[f"step{k}_closes"] for k in range(6)]))
    assert len(times) > 15
    w = run["fly_3_dot"]
    turning = m + inertia  # about a foot, with legs of 1 m
    eta = (inertia + m * np.cos(2 * a)) / turning
    after = []
    for time in times:
        at = np.flatnonzero(np.abs(run.t - time) < 1e-9)
        assert w[at[-1]] == pytest.approx(eta * w[at[0]], rel=1e-6)
        after.append(-w[at[-1]])
    gained = 2 * m * G * (np.cos(slope - a) - np.cos(slope + a)) / turning
    assert after[-1] == pytest.approx(np.sqrt(eta**2 * gained / (1 - eta**2)), rel=1e-5)
    feet = np.sort([np.abs(run[f"step{k}_closed"][-1]) for k in range(6)])
    assert feet == pytest.approx([0, 0, 0, 0, 0, 1])


def test_latch_on_a_closed_loop_against_the_impact_of_numpy() -> None:
    """v+ = v - M^-1 J^T (J M^-1 J^T)^-1 J v with J of the loop and of the latch."""
    m = eg.Model("bars", gravity=(0, -G, 0))
    crank = m.body("crank", mass=1.0, inertia={"zz": 0.01}, com=(0.05, 0, 0))
    rod = m.body("rod", mass=0.8, inertia={"zz": 0.02}, com=(0.15, 0, 0), markers={"end": (0.2, 0.05, 0)})
    piston, block = m.body("piston", mass=0.5, inertia={"zz": 0.001}), m.body("block", mass=0.7)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod)
    m.revolute("C", rod.at(0.3, 0, 0), piston)
    m.prismatic("S", m.ground, piston, axis="x", coordinate="s")
    m.prismatic("L", m.ground, block, axis="y", coordinate="h")
    m.coupling("grip", equation="y(rod.end) - h", closes="y(rod.end) - h")
    m.guess(s=0.35)
    m.initial(theta=0.8, theta_dot=-9.0, h=0.06, h_dot=0.3)
    mod = m.compile(target="numpy")
    run = mod.simulate(0.08)
    time = run.t_events["grip_closes"][0]
    i, j = np.flatnonzero(np.abs(run.t - time) < 1e-12)[[0, -1]]
    before, after, n, nv = run.x[:, i], run.x[:, j], mod.n_q, 4
    q = before[:n]
    M, C = mod.mass_matrix(q)[:nv, :nv], mod.constraint_jacobian(q)[:, :nv]
    step = np.zeros((1, nv))
    for k in range(nv):  # of y(rod.end) - h by the coordinates of the tree
        h = np.zeros(n)
        h[k] = 1e-6
        up, down = mod.poses(q + h), mod.poses(q - h)
        level = [(p[1] @ np.array([0.2, 0.05, 0, 1]))[1] - p[3][1, 3] for p in (up, down)]
        step[0, k] = (level[0] - level[1]) / 2e-6
    J, v = np.vstack([C, step]), before[n : n + nv]
    Y = np.linalg.solve(M, J.T)
    expected = v - Y @ np.linalg.solve(J @ Y, J @ v)
    assert after[n : n + nv] == pytest.approx(expected, rel=1e-6)
    assert abs(step[0] @ v) > 0.1
    assert np.abs(mod.outputs(time, after)).size == 0


@pytest.mark.parametrize("target", TARGETS)
def test_grasp_in_space_keeps_momenta(target: str) -> None:
    """A free body takes another that flies by; both turn together after it, and what they carry is unchanged."""
    m = eg.Model("grasp")
    hand = m.body("hand", mass=3.0, com=(0.1, 0, 0.05), inertia=(0.2, 0.3, 0.25))
    ball = m.body("ball", mass=1.0, inertia=(0.02, 0.03, 0.04))
    m.free("f", m.ground, hand, rotation="euler_parameters")
    m.free("g", m.ground, ball, rotation="euler_parameters")
    m.hold("grip", hand.marker("palm", at=(0.3, 0.1, 0), rpy=(0.2, 0.4, 0.1)), ball, turning="xyz", closes="0.5 - t")
    for axis in "xyz":
        m.output(f"p{axis}", f"momentum_{axis}")
        m.output(f"L{axis}", f"angular_momentum_{axis}(ground)")
    m.initial(f_wx=0.3, f_wy=-0.5, f_wz=0.8, g_x=1.0, g_y=0.3, g_x_dot=-0.6, g_wy=1.0)
    mod = m.compile(target=target)
    run = mod.simulate(2.0, rtol=1e-10, atol=1e-12)
    y = mod.outputs(run.t, run.x)
    assert np.abs(y - y[:, :1]).max() < 1e-7
    poses = run.poses()  # (n_t, n_bodies, 4, 4) or the like
    last = np.asarray([mod.poses(run.x[: mod.n_q, k]) for k in np.flatnonzero(run.t > 0.5)[[1, -1]]])
    seen = [np.linalg.solve(pair[0], pair[1]) for pair in last]
    assert seen[0] == pytest.approx(seen[1], abs=1e-7)
    assert np.asarray(poses).size


def test_verify_file_and_component(tmp_path: Path) -> None:
    m = carts(opens="multiplier(latch)")
    m.save(tmp_path / "carts.yaml")
    assert "closes: x2 - x1" in (tmp_path / "carts.yaml").read_text()
    read = eg.load(tmp_path / "carts.yaml")
    whole = eg.Model("whole")
    whole.add(eg.load(tmp_path / "carts.yaml"), prefix="left_")
    mod = whole.compile(target="numpy")
    x, y = read.compile(target="numpy").simulate(6.0), mod.simulate(6.0)
    assert y["left_x1"][-1] == pytest.approx(x["x1"][-1], rel=1e-9)
    assert read.compile(target="numpy").verify().ok


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"closes": "x2 - x3"}, "constraints.latch.closes: unknown name 'x3'"),
        ({"closes": "x1_ddot"}, "constraints.latch.closes: the acceleration 'x1_ddot'"),
        ({"closes": "x1", "releases": ["lach"]}, r"constraints.latch.releases\[0\]: 'lach' is no other constraint"),
        ({"closes": "x1", "closed": 2}, "constraints.latch.closed"),
        ({"closes": "x1", "releases": "lach"}, "constraints.latch.releases: 'lach' is no other constraint"),
        ({"closes": "x1", "releases": "latch"}, "constraints.latch.releases: 'latch' is no other constraint"),
        ({"closes": "x1", "releases": {"a": 1}}, "constraints.latch.releases: .* is not a list of names"),
        ({"closes": "t > 1"}, "constraints.latch.closes: 't > 1' is a comparison.*1 - t for"),
        ({"opens": "t > 1 and x1 > 2"}, "constraints.latch.opens: .* is a comparison"),
        ({"closes": "0"}, "constraints.latch.closes: '0' is constant"),
        ({"closes": "2*size - 1"}, "constraints.latch.closes: .* is constant"),
        ({"closes": "x1", "stabilisation": -3}, "constraints.latch.stabilisation: is -3; must be greater than 0"),
        ({"closes": "x1", "stabilisation": "size - 2"}, "constraints.latch.stabilisation: is 0; must be greater"),
        ({"closes": "x1", "stabilisation": "x1"}, "constraints.latch.stabilisation: .*'x1'"),
    ],
)
def test_what_is_wrong_is_told(keys: dict[str, object], told: str) -> None:
    m = eg.Model("carts")
    m.parameter("size", 2.0)
    a, b = m.body("a", mass=2.0), m.body("b", mass=3.0)
    m.prismatic("x1", m.ground, a, axis="x")
    m.prismatic("x2", m.ground, b, axis="x")
    m.coupling("latch", {"x1": 1, "x2": -1}, **keys)
    with pytest.raises(ModelError, match=told):
        m.check()


def test_a_hold_that_never_changes_is_refused() -> None:
    m = eg.Model("held")
    a = m.body("a", mass=2.0)
    m.prismatic("x1", m.ground, a, axis="x")
    m.hold("grip", m.ground, a)
    with pytest.raises(ModelError, match="is neither closed nor opened; give closes, opens or closed"):
        m.check()


def test_one_name_is_released_as_a_list_of_one() -> None:
    """The second disc is held by the first clutch until the second closes; only then momenta add up anew."""

    def discs(releases: object) -> eg.Trajectory:
        m = eg.Model("discs")
        for name, size in (("a", 0.3), ("b", 0.5)):
            m.revolute(name, m.ground, m.body(f"disc_{name}", mass=1.0, inertia={"zz": size}))
        m.coupling("first", equation="a_dot + 0.1*b_dot", closed=True, opens="5 - t")
        m.coupling("second", equation="a_dot - b_dot", closes="1 - t", releases=releases)
        m.initial(a_dot=4.0, b_dot=-40.0)
        whole = eg.Model("whole")
        whole.add(m, prefix="left_")
        return whole.compile(target="numpy").simulate(2.0)

    plain, listed = discs("first"), discs(["first"])
    assert plain["left_a_dot"][-1] == pytest.approx((0.3 * 4.0 - 0.5 * 40.0) / 0.8, rel=1e-9)
    assert np.array_equal(plain.x, listed.x)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("rotation", ["euler_parameters", "euler_angles"])
def test_a_coin_lies_flat_before_it_rolls(target: str, rotation: str) -> None:
    """Rolling has no direction of contact for a disc that lies flat: it falls freely, with numbers for its slopes."""
    m = eg.Model("coin", gravity=(0, 0, -G))
    coin = m.body("coin", mass=1.0, inertia=(0.01, 0.01, 0.018))
    m.free("f", m.ground, coin, rotation=rotation)
    m.rolling("roll", "coin", radius=0.2, closes="z(coin) - 0.2")
    m.initial(f_z=2.0, f_x_dot=0.7)
    mod = m.compile(target=target)
    run = mod.simulate(0.3)
    assert [run["f_z"][-1], run["f_x"][-1]] == pytest.approx([2.0 - G * 0.045, 0.21], rel=1e-9)
    x = mod.x0()
    assert np.isfinite(mod.jacobian(0.0, x)).all()
    step, z = 1e-6 * np.eye(len(x)), slice(mod.n_q, None)
    slopes = np.array([(mod.rhs(0.0, x + d) - mod.rhs(0.0, x - d)) / 2e-6 for d in step[mod.n_q :]]).T
    assert mod.jacobian(0.0, x)[:, z] == pytest.approx(slopes, abs=1e-6)


@pytest.mark.parametrize("target", TARGETS)
def test_a_leaning_disc_closes_as_the_impact_of_numpy(target: str) -> None:
    """v+ = v - M^-1 C^T (C M^-1 C^T)^-1 C v; C by hand: the lowest point of the disc has no velocity."""
    m = eg.Model("disc", gravity=(0, 0, -G))
    disc, r, mass, I = m.body("disc", mass=1.3, inertia=(0.01, 0.01, 0.018)), 0.2, 1.3, np.diag([0.01, 0.01, 0.018])
    m.free("f", m.ground, disc)
    m.rolling("roll", "disc", radius=r, closes="z(disc) - 0.16")
    m.initial(f_1=1.1, f_z=0.5, f_x_dot=0.7, f_y_dot=-0.3, f_3_dot=2.0, f_1_dot=0.4)
    mod = m.compile(target=target)
    run = mod.simulate(0.5)
    time = run.t_events["roll_closes"][0]
    i, j = np.flatnonzero(np.abs(run.t - time) < 1e-12)[[0, -1]]

    def motion(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pose, step = mod.poses(x[: mod.n_q])[0], 1e-6
        rates = x[mod.n_q : 2 * mod.n_q]
        up, down = (mod.poses(x[: mod.n_q] + s * rates)[0] for s in (step, -step))
        spin = (up - down)[:3, :3] / (2 * step) @ pose[:3, :3].T
        return pose[:3, :3], np.array([*(up - down)[:3, 3] / (2 * step), spin[2, 1], spin[0, 2], spin[1, 0]])

    (R, before), (_, after) = motion(run.x[:, i]), motion(run.x[:, j])
    down = -np.array([0, 0, 1.0]) + R[2, 2] * R[:, 2]
    a = r * down / np.linalg.norm(down)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    C, M = np.hstack([np.eye(3), -cross]), np.zeros((6, 6))
    M[:3, :3], M[3:, 3:] = mass * np.eye(3), R @ I @ R.T
    Y = np.linalg.solve(M, C.T)
    assert after == pytest.approx(before - Y @ np.linalg.solve(C @ Y, C @ before), abs=1e-7)
    assert np.abs(C @ before).max() > 0.1


@pytest.mark.parametrize("target", TARGETS)
def test_runs_backwards_are_refused(target: str) -> None:
    mod = carts().compile(target=target)
    told = r"constraints that close and open \(latch\) goes forward in time, not from 1 s to 0 s"
    with pytest.raises(eg.UsageError, match=told):
        mod.simulate((1.0, 0.0))
    with pytest.raises(eg.UsageError, match=told):
        mod.simulate_many((1.0, 0.0), {"x1_dot": [1.0, 2.0]})


@pytest.mark.parametrize("target", TARGETS)
def test_a_start_in_disagreement_is_told_with_numbers(target: str) -> None:
    """Of an equation of positions its error and its rate; a state of another run is taken as it is."""
    m = eg.Model("pair")
    for name in ("x1", "x2"):
        m.prismatic(name, m.ground, m.body(f"b_{name}", mass=1.0), axis="x")
    m.coupling("latch", equation="x1 - x2", opens="1 - t")
    mod = m.compile(target=target)
    told = r"constraint latch is closed at the start, and its equation latch.equation {} there \(up to 1"
    for start, what in (({"x2": 0.1}, "is off by -0.1 m"), ({"x1_dot": 1.5}, "changes by 1.5 m/s")):
        for run in (mod.simulate, mod.dae.solve):
            with pytest.raises(eg.UsageError, match=told.format(what)):
                run(2.0, start)
    assert mod.simulate(2.0, {"x2": 0.1, "latch_closed": 0})["x2"][-1] == pytest.approx(0.1)
    assert mod.simulate(2.0, mod.x0(x2=0.1))["latch_closed"][-1] == 0.0
    run = mod.simulate(2.0, {"x1": 0.3, "x2": 0.3, "x1_dot": 1.5, "x2_dot": 1.5})
    assert run["x1"][-1] == pytest.approx(3.3)


@pytest.mark.parametrize("sign", ["", "-"])
def test_a_multiplier_of_0_opens_by_ida_too(sign: str) -> None:
    """Two carts that coast side by side carry nothing: the latch opens at once, and the run goes on."""
    m = eg.Model("coast")
    for name in ("x1", "x2"):
        m.prismatic(name, m.ground, m.body(f"b_{name}", mass=1.0), axis="x")
    m.coupling("latch", equation="x1 - x2", opens=f"{sign}multiplier(latch)")
    run = m.compile(target="numpy").dae.solve(2.0, {"x1_dot": 1.0, "x2_dot": 1.0})
    assert run.t_events["latch_opens"] == pytest.approx([0.0])
    assert run["latch_closed"][-1] == 0.0
    assert [run["x1"][-1], run["x2"][-1]] == pytest.approx([2.0, 2.0], rel=1e-9)


def test_closing_by_ida() -> None:
    """The same latch as by the steppers: a plastic impact, then both swing together."""
    mod = carts().compile(target="numpy")
    run = mod.dae.solve(3.0, rtol=1e-9, atol=1e-11)
    hit, speed, w = 1.0 / 1.5, 2.0 * 1.5 / 5.0, np.sqrt(10.0 / 5.0)
    assert run.t_events["latch_closes"] == pytest.approx([hit], rel=1e-8)
    assert run["x1"][-1] == pytest.approx(speed / w * np.sin(w * (3.0 - hit)), abs=1e-6)


def test_reports_and_pictures_tell_what_holds_for_a_time() -> None:
    """The report, the worked solution and the picture name the hold; a joint that should close is shown the way."""
    m = eg.Model("grasp")
    a, b = (m.body(name, mass=1.0, inertia={"zz": 0.1}) for name in "ab")
    m.planar("f", m.ground, a)
    m.planar("g", m.ground, b)
    m.hold("grip", a, b, axes="xy", turning="z", closes="1 - t", opens="2 - t")
    report = m.check()
    assert report.elements == [{"name": "grip", "type": "hold", "bodies": ["a", "b"], "holds": "for a time"}]
    assert "held for a time       grip; what follows is without them" in str(report)
    eqs = m.derive()
    told = eqs.explain().markdown
    assert "The marker does not move on the other body while it is held." in told
    assert "This holds for a time, while `grip_closed` is 1; else its force is 0." in told
    assert "It closes by a plastic impact where this falls to 0" in told
    assert "It opens where this falls to 0" in told
    mod = eqs.compile(target="numpy")
    assert [e["name"] for e in mod.metadata["picture"]["elements"]] == ["grip"]
    with pytest.raises(
        eg.UsageError, match="inline has no argument 'closes': joints without coordinates hold for good, save for welds"
    ):
        m.inline("hinge", a, b, closes="1 - t")


def test_a_joint_in_a_file_that_should_close_is_shown_the_way(tmp_path: Path) -> None:
    file = tmp_path / "c.yaml"
    file.write_text(
        "name: c\nbodies: {a: {mass: 1, inertia: {zz: 1}}}\n"
        "joints: {A: {type: revolute, between: [ground, a]}, B: {type: inline, between: [ground, a], closes: 1 - t}}\n",
        encoding="utf-8",
    )
    with pytest.raises(ModelError, match="joints.B.closes: a inline joint has no .closes.; joints without coordinates"):
        eg.load(file).check()
