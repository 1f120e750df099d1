"""Events beside corners of inputs, jumps, values that start at zero, floors that move, events by the hundred."""

from time import process_time
from typing import Any

import numpy as np
import pytest
from analysed import compiled
from sweeps import TARGETS

import eomgen as eg

G, E, END = 9.81, 0.9, 1.8
FLOOR = 1000.0 + 1.0 / 3.0  #: (m) so high that heights beside it are many roundings of time apart
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


@pytest.fixture(scope="module", params=TARGETS)
def pushed(request: pytest.FixtureRequest) -> Any:
    """A ball on a rail; an input pushes a cart beside it, whose corners split the run and leave the ball alone."""
    m = eg.Model("pushed", gravity=(0, -G, 0))
    push = m.input("push")
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.prismatic("K", m.ground, m.body("cart", mass=1.0), axis="x", coordinate="s")
    m.torque("pushing", "K", push)
    m.event("floor", "3*(h - 1000) - 1", direction=-1, reset={"h_dot": -E * m.coordinate("h_dot")})
    return m.compile(target=request.param)


@pytest.mark.parametrize("bounce", [0, 1])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau"])
def test_a_reset_beside_a_corner_of_an_input_is_one_reset(pushed: Any, method: str, bounce: int) -> None:
    """Truth: the closed form; the corner is units in the last place away from where a bounce is found."""
    for height in (0.8, 1.2):
        first = np.sqrt(2.0 * height / G)
        bounces = first * np.array([1.0, 1.0 + 2.0 * E])
        corner = float(bounces[bounce])
        for ulps in (0, 0, -2, -1, 1, 2, 8):  # the first run tells where a bounce is found
            at = corner + ulps * np.spacing(corner)
            inputs = {"push": ([0.0, at, END], [0.0, 1.0, 1.0])}
            run = pushed.simulate((0, END), {"h": FLOOR + height}, inputs=inputs, method=method, **TIGHT)
            found, error = run.t_events["floor"][:2], f"{height} m, {ulps} units"
            np.testing.assert_allclose(found, bounces, rtol=0, atol=1e-9, err_msg=error)
            assert run.t[-1] == END
            corner = float(found[bounce]) if ulps == 0 else corner


STEPPED = ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA", "RK4", "Taylor")
LOOPS = [*(("cython", method) for method in STEPPED), *(("numpy", method) for method in STEPPED[:6])]
JUMPS = 9


@pytest.fixture(scope="module")
def jumps() -> dict[str, Any]:
    """A ball that falls, with kicks at nine times."""
    m = eg.Model("thrown", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    for k in range(JUMPS):
        m.event(f"e{k}", f"1 if t > {0.1 * (k + 1)!r} else -1", reset={"h_dot": "h_dot + 1"})
    return {target: m.compile(target=target) for target in ("cython", "numpy")}


@pytest.mark.parametrize(("target", "method"), LOOPS)
def test_a_ball_thrown_up_from_the_floor_lands(target: str, method: str) -> None:
    """Also where one step holds the whole flight, as Taylor takes it."""
    lands = 2 * 5.0 / 9.81
    given = {"step": 1.2 * lands} if method == "RK4" else {"first_step": 1.2 * lands}
    given = {} if method == "Taylor" else given
    run = compiled("hopper", target).simulate(
        1.25 * lands, {"h": 0.0, "h_dot": 5.0}, method=method, rtol=1e-9, atol=1e-11, **given
    )
    assert np.asarray(run.t_events["floor"]) == pytest.approx([lands], rel=1e-6)
    rest = 0.25 * lands
    assert run["h"][-1] == pytest.approx(4.5 * rest - 9.81 / 2 * rest**2, abs=1e-5)


@pytest.mark.parametrize(("target", "method"), LOOPS)
def test_a_value_that_jumps_resets_once(jumps: dict[str, Any], target: str, method: str) -> None:
    given = {"step": 0.013} if method == "RK4" else {}
    run = jumps[target].simulate(1.5, method=method, **given)
    for k in range(JUMPS):
        assert np.asarray(run.t_events[f"e{k}"]) == pytest.approx([0.1 * (k + 1)], abs=1e-12)
    true = 1.0 - 9.81 / 2 * 1.5**2 + sum(1.5 - 0.1 * (k + 1) for k in range(JUMPS))
    assert run["h"][-1] == pytest.approx(true, abs=1e-6)


REST, SPEED = 0.6, 0.8


def ball(floor: str, **inputs: float) -> eg.Model:
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="z", coordinate="z")
    for name, value in inputs.items():
        m.input(name, value)
    m.event("bounce", f"z - {floor}", direction=-1, restitution=REST)
    return m


@pytest.mark.quick
@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
@pytest.mark.parametrize("way", ["in time", "by an input"])
def test_a_floor_that_rises(way: str, method: str) -> None:
    """Seen from the floor, z - V t falls from 1 m at the speed V and rises at e times the speed of the impact."""
    moving, given = (f"{SPEED}*t", {}) if way == "in time" else ("h", {"h": f"{SPEED}*t"})
    mod = ball(moving, **({"h": 0.0} if given else {})).compile(target="numpy")
    run = mod.simulate(0.9, {"z": 1.0, "z_dot": 0.0}, inputs=given, method=method, rtol=1e-10, atol=1e-12)
    fall = (-SPEED + np.sqrt(SPEED**2 + 2 * 9.81)) / 9.81
    hit = -(SPEED + 9.81 * fall)
    assert run.t_events["bounce"][0] == pytest.approx(fall, abs=1e-7)
    after = 0.9 - fall
    assert after < 2 * REST * abs(hit) / 9.81
    assert run["z_dot"][-1] == pytest.approx(SPEED - REST * hit - 9.81 * after, abs=1e-6)
    assert run["z"][-1] == pytest.approx(SPEED * 0.9 - REST * hit * after - 9.81 * after**2 / 2, abs=1e-6)


MANY = 120
LEVELS = (np.linspace(0.0, 0.09, MANY) + 1e-3).tolist()


@pytest.fixture(scope="module")
def crowded() -> Any:
    m = eg.Model("many", gravity=(0.0, 0.0, 0.0))
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.torque("f", "s", "-k*s + 0*u")
    m.parameter("k", 25.0)
    m.input("u")
    m.initial(s_dot=0.5)  # s = 0.1 sin 5 t
    for k, level in enumerate(LEVELS):
        m.event(f"e{k}", f"s - {level!r}")
    return m.compile(target="numpy")


def test_events_by_the_hundred(crowded: Any) -> None:
    """120 events, each found up and down; one by one they would take minutes."""
    begun = process_time()
    run = crowded.simulate(1.0, inputs={"u": lambda t, x: 3.0 * t}, rtol=1e-10, atol=1e-12)
    for k, level in enumerate(LEVELS):  # up and down within the first half period
        up = np.arcsin(level / 0.1) / 5.0
        np.testing.assert_allclose(run.t_events[k][:2], [up, np.pi / 5.0 - up], atol=1e-7)
        np.testing.assert_allclose(run.x_events[k][0], level, atol=1e-12)
    found = crowded.sensitivities("k", 0.2)
    assert sum(len(times) for times in found.trajectory.t_events) > 80
    assert process_time() - begun < 30.0


def test_events_by_the_hundred_by_ida(crowded: Any) -> None:
    pytest.importorskip("sksundae")
    run = crowded.dae.solve(0.3, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose([times[0] for times in run.t_events], np.arcsin(np.array(LEVELS) / 0.1) / 5.0, atol=1e-6)
