"""Where branches meet: starts at change points, dead centres without inertia, positions that rounding does not tell."""

from functools import cache
from typing import Any

import models
import numpy as np
import pytest
from refusals import refused
from scipy.integrate import solve_ivp
from sweeps import TARGETS

import eomgen as eg

# -- Starts where parallelograms lie flat ------------------------------------------------------------------------------
ARM, SPEED = 0.3, 5.0


@cache
def row_of_parallelograms(loops: int, target: str, turn: float = 0.0) -> Any:
    """Parallelograms of arms of 0.3 m and couplers of 1 m in a row; all frames turned by an angle, gravity too."""
    m = eg.Model(f"row_{loops}_{round(10 * turn)}", gravity=(9.81 * np.sin(turn), -9.81 * np.cos(turn), 0))
    base = m.ground.at(0, 0, 0, rpy=(0, 0, turn)) if turn else m.ground
    c, s = np.cos(turn), np.sin(turn)

    def bar(name: str, length: float) -> Any:
        return m.body(name, mass=1.0, com=(length / 2, 0, 0), inertia={"zz": length**2 / 12})

    arms = [bar(f"a{i}", ARM) for i in range(loops + 1)]
    couplers = [bar(f"c{i}", 1.0) for i in range(loops)]
    m.revolute("A0", base, arms[0], coordinate="th")
    for i in range(1, loops + 1):
        m.revolute(f"A{i}", m.ground.at(i * c, i * s, 0), arms[i])
    for i in range(loops):
        m.revolute(f"B{i}", arms[i].at(ARM, 0, 0), couplers[i])
        m.revolute(f"C{i}", couplers[i].at(1, 0, 0), arms[i + 1].at(ARM, 0, 0))
    return m.derive("embedding", independent=["th"]).compile(target=target)


def parallel(mod: Any, turn: float = 0.0) -> dict[str, float]:
    """All velocities of arms that stay parallel."""
    return {n: -SPEED if n.startswith(("B", "C")) else SPEED for n in mod.x_names if n.endswith("_dot")}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("loops", [1, 2])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi])
def test_velocities_of_several_branches_are_refused_by_name(loops: int, angle: float, target: str) -> None:
    mod = row_of_parallelograms(loops, target)
    with refused("EG-UNDETERMINED change") as error:
        mod.simulate((0, 0.2), initial={"th": angle, "th_dot": SPEED})
    named = str(error.value).rsplit("give ", 1)[1].split(" too")[0].split(" and ")
    assert len(named) == loops
    wanted = {name: parallel(mod)[name] for name in named}
    x = mod.x0({"th": angle, "th_dot": SPEED, **wanted})  # what the message asks for is enough
    assert np.abs(x[mod.n_q :] - np.array([parallel(mod)[n] for n in mod.x_names[mod.n_q :]])).max() <= 1e-7 * SPEED


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("loops", "turn"), [(1, 0.0), (2, 0.7)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi])
def test_all_velocities_of_a_branch_start_it(loops: int, turn: float, angle: float, target: str) -> None:
    mod = row_of_parallelograms(loops, target, turn)
    run = mod.simulate((0, 0.1), initial={"th": angle, **parallel(mod)}, rtol=1e-9, atol=1e-11)
    inertia = (loops + 1) * ARM**2 / 3 + loops * ARM**2
    weight = 9.81 * ((loops + 1) * ARM / 2 + loops * ARM)
    exact = solve_ivp(lambda t, y: [y[1], -weight / inertia * np.cos(y[0])], (0, 0.1), [angle, SPEED],
                      rtol=1e-11, atol=1e-13, dense_output=True)  # fmt: skip
    assert np.abs(run["th"] - exact.sol(run.t)[0]).max() <= 1e-7
    assert np.ptp(run["energy"]) <= 1e-7
    assert abs(run["energy"][0] - 0.5 * inertia * SPEED**2 - weight * np.sin(angle)) <= 1e-7


@cache
def slider_crank(target: str) -> Any:
    """Crank and rod of 1 m each: at 90 degrees the rod lies on the crank, and may turn with it or mirror it."""
    m = eg.Model("equal_arms", gravity=(0, -9.81, 0))
    crank = m.body("crank", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
    rod = m.body("rod", mass=2.0, com=(0.5, 0, 0), inertia={"zz": 0.2})
    slider = m.body("slider", mass=0.5)
    models.join_slider_crank(m, (crank, rod, slider), 1, 1, "th b s")
    m.guess(th=0.5, b=-1.0, s=1.8)
    m.output("acceleration", "th_ddot")
    return m.compile(target=target)


def mirrored(th: float, w: float) -> float:
    """The crank's acceleration where the rod's angle is -th: T = M(th) w^2 / 2, V = 1.5 g sin th."""
    inertia = 0.1 + 0.25 + 0.2 + 2 * (2.25 * np.sin(th) ** 2 + 0.25 * np.cos(th) ** 2) + 2.0 * np.sin(th) ** 2
    slope = (8.0 + 4.0) * np.sin(th) * np.cos(th)
    return float((-9.81 * 1.5 * np.cos(th) - 0.5 * slope * w * w) / inertia)


def together(th: float, w: float) -> float:
    """The same where the rod turns with the crank and the slider rests: a pendulum."""
    return float(-9.81 * 1.5 * np.cos(th) / (0.1 + 0.25 + 0.2 + 0.5))


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("s_dot", "law"), [(-4.0, mirrored), (0.0, together)])
def test_a_slider_crank_of_equal_arms_runs_on_both_branches(s_dot: float, law: Any, target: str) -> None:
    start = {"th": np.pi / 2, "th_dot": 2.0, "s_dot": s_dot}
    run = slider_crank(target).simulate((0, 0.9), initial=start, rtol=1e-10, atol=1e-12)
    found = solve_ivp(
        lambda t, y: [y[1], law(*y)], (0, 0.9), [np.pi / 2, 2.0], "DOP853", rtol=1e-12, atol=1e-13
    )  # fmt: skip
    assert abs(run["th"][-1] - found.y[0, -1]) < 1e-8
    assert abs(run["th_dot"][-1] - found.y[1, -1]) < 1e-7


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("s_dot", "law"), [(-4.0, mirrored), (0.0, together)])
@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-5, 0.1])
def test_outputs_follow_the_branch_too(off: float, s_dot: float, law: Any, target: str) -> None:
    mod, turn = slider_crank(target), s_dot / 4.0
    x = mod.project([np.pi / 2 + off, -np.pi + 2 * off * turn, 2 * np.sin(off) * turn, 2.0, s_dot, s_dot * np.cos(off)])
    expected = law(np.pi / 2 + off, 2.0)
    assert mod.rhs(0.0, x)[3] == pytest.approx(expected, rel=1e-5, abs=1e-11)
    assert mod.outputs(0.0, x) == pytest.approx([expected], rel=1e-5, abs=1e-11)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("off", [1e-15, 1e-12, 1e-9])
def test_what_rounding_leaves_of_rows_tells_no_accelerations(off: float, target: str) -> None:
    """Off both branches by so much no row is open by more than its square: nothing but rounding tells it."""
    x = [np.pi / 2, -np.pi + off, off, 2.0, -4.0, -4.0]
    assert np.abs(slider_crank(target).rhs(0.0, x)[3:]).max() < 1e-6


# -- A massless toggle -------------------------------------------------------------------------------------------------
R, L, MASS, TAU = 0.1, 0.35, 0.5, 1.0


@pytest.fixture(scope="module", params=TARGETS)
def toggle(request: pytest.FixtureRequest) -> Any:
    m = eg.Model("toggle")
    inertia = m.parameter("inertia", 0.0)
    crank, rod = m.body("crank", mass=m.parameter("crank_mass", 0.0), inertia={"zz": inertia}), m.body("rod", mass=0)
    slider = m.body("slider", mass=MASS)
    models.join_slider_crank(m, (crank, rod, slider), R, L, "theta - s")
    m.torque("motor", "A", TAU)
    m.initial(theta=1.0)
    return m.compile(independent=["theta"], target=request.param)


def closed_form(theta: float, rate: float) -> float:
    root = np.sqrt(L**2 - (R * np.sin(theta)) ** 2)
    slope = -R * np.sin(theta) - R**2 * np.sin(theta) * np.cos(theta) / root
    bend = -R * np.cos(theta) - R**2 * np.cos(2 * theta) / root - (R**2 * np.sin(theta) * np.cos(theta)) ** 2 / root**3
    return float((TAU - MASS * slope * bend * rate**2) / (MASS * slope**2))


@pytest.mark.parametrize("theta", [0.0, np.pi, -np.pi, 2 * np.pi])
def test_no_acceleration_is_made_up_at_the_dead_centre(toggle: Any, theta: float) -> None:
    x = toggle.x0(theta=theta, theta_dot=1.0)
    with pytest.raises(eg.SingularMassMatrixError):
        toggle.rhs(0.0, x)
    with pytest.raises(eg.SingularMassMatrixError):
        toggle.jacobian(0.0, x)
    assert np.isfinite(toggle.bind({"inertia": 1e-9}).rhs(0.0, x)).all()  # a crank of a milligram is enough


@pytest.mark.parametrize("theta", [0.3, 1e-3, 1e-6, 1e-10, np.pi - 1e-6])
def test_beside_it_the_closed_form_is_followed(toggle: Any, theta: float) -> None:
    x = toggle.x0(theta=theta, theta_dot=2.0)
    found = toggle.rhs(0.0, x)[toggle.x_names.index("theta_dot")]
    assert found == pytest.approx(closed_form(theta, 2.0), rel=1e-9 + 1e-15 / abs(np.sin(theta)))


# -- Positions that rounding does not tell -----------------------------------------------------------------------------
LENGTHS = (0.2, 0.5)  #: crank and coupler (m)


@cache
def parallelograms(scales: tuple[float, ...], method: str, target: str, turned: bool = False) -> Any:
    """Parallelograms beside each other; turned: from the other crank on, so that another joint is cut."""
    m = eg.Model("parallelograms", gravity=(0, -9.81, 0))
    for k, scale in enumerate(scales):
        crank, coupler = (scale * length for length in LENGTHS)
        a, b, c = (
            m.body(f"{name}{k}", mass=1, com=(0.5 * length, 0, 0), inertia={"zz": 0.01 * scale**2})
            for name, length in (("a", crank), ("b", coupler), ("c", crank))
        )
        ends = [m.ground, m.ground.at(coupler, 0, 0)]
        if turned:
            m.revolute(f"r{k}", ends[1], c)
            m.revolute(f"s{k}", b.at(coupler, 0, 0), c.at(crank, 0, 0))
            m.revolute(f"q{k}", a.at(crank, 0, 0), b)
            m.revolute(f"p{k}", ends[0], a)
        else:
            m.revolute(f"p{k}", ends[0], a)
            m.revolute(f"q{k}", a.at(crank, 0, 0), b)
            m.revolute(f"r{k}", ends[1], c)
            m.revolute(f"s{k}", b.at(coupler, 0, 0), c.at(crank, 0, 0))
    return m.compile(method=method, target=target)


def at(k: int, angle: float, share: float = 1.0) -> dict[str, float]:
    """Angles of the cranks of parallelogram k, the second a share of the first, closed to first order."""
    other = share * angle
    closing = LENGTHS[0] / LENGTHS[1] * (other - angle) - angle
    return {f"p{k}": angle, f"q{k}": closing, f"r{k}": other}


@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize("angle", [1e-8, 1e-10, 0.0])
@pytest.mark.parametrize("scales", [(1.0, 0.01), (1.0, 1.0), (1000.0, 1.0)])
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["embedding", "augmented"])
def test_it_is_refused(method: str, target: str, scales: tuple[float, ...], angle: float, share: float) -> None:
    mod = parallelograms(scales, method, target)
    x = mod.x0(at(0, 0.5) | at(1, angle, share))
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.rhs(0.0, x)
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.jacobian(0.0, x)


@pytest.mark.parametrize("angle", [1e-8, 1e-7, 1e-6])
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["augmented", "newton_euler"])
def test_a_position_closed_by_rounding_alone_is_refused(method: str, target: str, angle: float) -> None:
    """One crank at half the angle of the other: the loop is open by less than rounding, no motion keeps it closed."""
    mod = parallelograms((1.0,), method, target)
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.rhs(0.0, mod.x0(at(0, angle, 0.5)))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("target", TARGETS)
def test_beyond_it_is_right_to_what_closures_tell(target: str, turned: bool, scale: float) -> None:
    """Both cranks of a parallelogram turn alike: 1e-16 / s^2 of their acceleration, whatever joint is cut."""
    mod = parallelograms((scale,), "embedding", target, turned)
    names = list(mod.q_names)
    expected = 9.81 * (2 * 0.1 + 0.2) / (2 * (0.01 + 0.1**2) + 0.2**2) / scale  # two cranks and the coupler of 1 kg
    for angle in (1e-5, 1e-4, 1e-3):
        given = {name: value for name, value in at(0, angle).items() if name in names}
        x = mod.x0(given | ({"s0": angle} if "s0" in names else {}))
        found = mod.rhs(0.0, x)[mod.n_q :]
        crank = found[names.index("p0" if "p0" in names else "r0")]
        assert abs(crank) == pytest.approx(expected, rel=10 * 1e-16 / (0.1 * angle) ** 2 + angle**2)
