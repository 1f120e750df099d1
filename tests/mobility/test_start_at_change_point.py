"""Runs that start where parallelograms lie flat, against the motion of arms that stay parallel, in closed form."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg

ARM, SPEED = 0.3, 5.0
TARGETS = ("numpy", "cython")


@cache
def compiled(loops: int, target: str, turn: float = 0.0) -> Any:
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
    mod = compiled(loops, target)
    with pytest.raises(eg.AssemblyError, match=r"change point .*give .*_dot.* too, or start a little beside") as error:
        mod.simulate((0, 0.2), initial={"th": angle, "th_dot": SPEED})
    named = str(error.value).rsplit("give ", 1)[1].split(" too")[0].split(" and ")
    assert len(named) == loops
    wanted = {name: parallel(mod)[name] for name in named}
    x = mod.x0({"th": angle, "th_dot": SPEED, **wanted})  # what the message asks for is enough
    assert np.abs(x[mod.n_q :] - np.array([parallel(mod)[n] for n in mod.x_names[mod.n_q :]])).max() <= 1e-7 * SPEED


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("loops", "turn"), [(1, 0.0), (2, 0.0), (2, 0.7)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi])
def test_all_velocities_of_a_branch_start_it(loops: int, turn: float, angle: float, target: str) -> None:
    mod = compiled(loops, target, turn)
    run = mod.simulate((0, 0.1), initial={"th": angle, **parallel(mod)}, rtol=1e-9, atol=1e-11)
    inertia = (loops + 1) * ARM**2 / 3 + loops * ARM**2
    weight = 9.81 * ((loops + 1) * ARM / 2 + loops * ARM)
    exact = solve_ivp(lambda t, y: [y[1], -weight / inertia * np.cos(y[0])], (0, 0.1), [angle, SPEED],
                      rtol=1e-11, atol=1e-13, dense_output=True)  # fmt: skip
    assert np.abs(run["th"] - exact.sol(run.t)[0]).max() <= 1e-7
    assert np.ptp(run["energy"]) <= 1e-7
    assert abs(run["energy"][0] - 0.5 * inertia * SPEED**2 - weight * np.sin(angle)) <= 1e-7


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_mixtures_of_branches_are_refused_also_as_states(turn: float, target: str) -> None:
    """Tangents at th = 0 to rounding, and of no motion: halfway between both branches of each loop."""
    mod = compiled(2, target, turn)
    start = mod.x0({"th": 0.0, **parallel(mod)})
    J = mod.constraint_jacobian(start[: mod.n_q])
    across = np.linalg.svd(J)[2][np.linalg.matrix_rank(J, 1e-9) :]
    pure = across @ start[mod.n_q :]
    mixed = start.copy()
    mixed[mod.n_q :] = across.T @ (pure + np.array([0.3, -0.7, 0.5]) * SPEED)
    assert np.abs(mod.velocity_constraints(mixed)).max() <= (1e-8 if turn else 1e-12)
    if not turn:  # turned, rounding leaves 1e-10 of the position, and project() brings the state onto a branch itself
        with pytest.raises(eg.AssemblyError, match="no motion goes on with the given velocities"):
            mod.simulate((0, 1), initial=mixed)
    with pytest.raises(eg.AssemblyError, match="no motion goes on with the given velocities"):
        mod.x0(dict(zip(mod.x_names, mixed, strict=True)))


@pytest.mark.parametrize("target", TARGETS)
def test_at_rest_every_branch_has_the_velocities(target: str) -> None:
    assert not compiled(2, target).x0(th=0.0)[compiled(2, target).n_q :].any()


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("wheel", ["alone", "geared", "ground"])
def test_a_fast_wheel_hides_no_mixture_of_branches(wheel: str, target: str) -> None:
    """The wheel turns 1000 times as fast: alone, geared to the crank, or as the ground of the parallelogram."""
    mod, fast = beside_a_wheel(wheel, target), {"w_dot": 1000.0 * SPEED}
    start = {"th": 0.0, "th_dot": SPEED, **fast}
    for given in ({}, {"psi_dot": 0.85 * SPEED}):
        with pytest.raises(eg.AssemblyError, match=r"change point of C\.r_x, "):
            mod.x0({**start, **given})
    # cranks of 0.3 m on a coupler of 1 m: 1.3 / 0.7 times as fast against each other
    for ratio in (1.0, -1.3 / 0.7):
        x = mod.x0({**start, "psi_dot": ratio * SPEED})
        assert abs(x[mod.x_names.index("psi_dot")] - ratio * SPEED) <= 1e-9 * SPEED


@cache
def beside_a_wheel(wheel: str, target: str) -> Any:
    m = eg.Model(f"beside_{wheel}")
    a, b, c, w = (m.body(n, mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.1}) for n in "abcw")
    ground = w if wheel == "ground" else m.ground
    shaft = m.revolute("W", m.ground, w, coordinate="w")
    crank = m.revolute("A", ground, a, coordinate="th")
    m.revolute("D", ground.at(1, 0, 0), c, coordinate="psi")
    m.revolute("B", a.at(ARM, 0, 0), b)
    m.revolute("C", b.at(1, 0, 0), c.at(ARM, 0, 0))
    if wheel == "geared":
        m.gear("mesh", shaft, crank, radii=(1, 1000), internal=True)
    m.guess(th=1.0, psi=1.0, B=-1.0, **({"w": 1000.0} if wheel == "geared" else {}))
    return m.compile(target=target)


@pytest.mark.parametrize("away", [1.0, 0.3, 1e-3])
def test_a_declared_flat_position_is_found_as_well_as_any_other(away: float) -> None:
    """From a guess beside it Newton's steps halve the distance, and residuals tell its square."""
    m = flat(0.3)
    m.guess(th=away, bend=-away, psi=away)
    m.initial(th=0.0)
    mod = m.compile(target="numpy")
    assert np.abs(mod.x0()[:3]).max() <= 1e-12
    x = mod.x0(th_dot=SPEED, psi_dot=SPEED)
    assert np.abs(x[3:] - SPEED * np.array([1, -1, 1])).max() <= 1e-9 * SPEED
    with pytest.raises(eg.AssemblyError, match="do not tell its branches apart: branches found have"):
        mod.x0(th_dot=SPEED)


def test_branches_are_found_from_midway_between_them() -> None:
    """Least velocities with those of the coupler lie midway where cranks are short: psi_dot = 1.0 and -1.0 of it."""
    mod = flat(0.003).compile(target="numpy")
    with pytest.raises(eg.AssemblyError, match="branches found have") as error:
        mod.x0(th=0.0, bend_dot=-SPEED)
    assert "(psi_dot = -5) or (psi_dot = 5); give psi_dot too" in str(error.value)


def flat(arm: float) -> eg.Model:
    m = eg.Model("flat", gravity=(0, -9.81, 0))
    a, b, c = (m.body(n, mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.1}) for n in "abc")
    m.revolute("A", m.ground, a, coordinate="th")
    m.revolute("B", a.at(arm, 0, 0), b, coordinate="bend")
    m.revolute("D", m.ground.at(1, 0, 0), c, coordinate="psi")
    m.revolute("C", b.at(1, 0, 0), c.at(arm, 0, 0))
    return m


@cache
def slider_crank(target: str) -> Any:
    """Crank and rod of 1 m each: at 90 degrees the rod lies on the crank, and may turn with it or mirror it."""
    m = eg.Model("equal_arms", gravity=(0, -9.81, 0))
    crank = m.body("crank", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
    rod = m.body("rod", mass=2.0, com=(0.5, 0, 0), inertia={"zz": 0.2})
    slider = m.body("slider", mass=0.5)
    m.revolute("A", m.ground, crank, coordinate="th")
    m.revolute("B", crank.at(1, 0, 0), rod, coordinate="b")
    m.revolute("C", rod.at(1, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.guess(th=0.5, b=-1.0, s=1.8)
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
@pytest.mark.parametrize("off", [1e-15, 1e-12, 1e-9])
def test_what_rounding_leaves_of_rows_tells_no_accelerations(off: float, target: str) -> None:
    """Off both branches by so much no row is open by more than its square: nothing but rounding tells it."""
    x = [np.pi / 2, -np.pi + off, off, 2.0, -4.0, -4.0]
    assert np.abs(slider_crank(target).rhs(0.0, x)[3:]).max() < 1e-6
