"""Angular velocity and acceleration of markers as outputs: closed forms, Pinocchio, and the derivative of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

import eomgen as eg
from tests.robots.shipped import EXAMPLES

NAMES = [f"w{axis}{suffix}" for suffix in ("", "_body", "_dot", "_body_dot") for axis in "xyz"]


def test_a_disc_that_spins_on_a_turning_arm(tmp_path: Path) -> None:
    """Turn Omega about z, spin sigma about e_r, both steady: w = Omega e_z + sigma e_r, w' = Omega sigma e_z x e_r."""
    m = eg.Model("spinner")
    arm = m.body("arm", mass=1, inertia=(1, 1, 1))
    disc = m.body("disc", mass=1, inertia=(1, 0.5, 0.5))
    m.revolute("turn", m.ground, arm)
    m.revolute("spin", arm, disc, axis="x")
    # own axes of the marker: x along -y of the arm, y along its x
    rim = arm.marker("rim", at=(0.3, 0, 0), rpy=(0, 0, -np.pi / 2))
    for name, handle in (("disc", disc), ("rim", rim)):
        for word, triple in (
            ("w", handle.angular_velocity), ("b", handle.body_angular_velocity),
            ("a", handle.angular_acceleration), ("c", handle.body_angular_acceleration),
        ):  # fmt: skip
            for axis, value in zip("xyz", triple, strict=True):
                m.output(f"{name}_{word}{axis}", value)
    m.output("still", m.ground.angular_velocity[0] + m.ground.angular_acceleration[2])
    mod = m.compile(target="numpy")
    phi, psi, omega, sigma = 0.4, 0.9, 1.3, 7.0
    x = mod.x0(turn=phi, spin=psi, turn_dot=omega, spin_dot=sigma)
    y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))

    def triple(name: str) -> list[float]:
        return [y[name + axis] for axis in "xyz"]

    c, s = np.cos(phi), np.sin(phi)
    cp, sp = np.cos(psi), np.sin(psi)
    assert triple("disc_w") == pytest.approx([sigma * c, sigma * s, omega], abs=1e-14)
    assert triple("disc_b") == pytest.approx([sigma, omega * sp, omega * cp], abs=1e-14)
    assert triple("disc_a") == pytest.approx([-omega * sigma * s, omega * sigma * c, 0], abs=1e-13)
    assert triple("disc_c") == pytest.approx([0, omega * sigma * cp, -omega * sigma * sp], abs=1e-13)
    assert triple("rim_w") == triple("rim_b") == pytest.approx([0, 0, omega], abs=1e-14)
    assert y["still"] == 0.0
    path = tmp_path / "spinner.yaml"
    m.save(path)
    again = eg.load(path).compile(target="numpy")
    assert again.outputs(0.0, x) == pytest.approx(mod.outputs(0.0, x), abs=1e-15)


def test_a_robot_turns_as_pinocchio_says() -> None:
    path = EXAMPLES / "panda_description" / "urdf" / "panda.urdf"
    m = eg.load(path, lock=["panda_finger_joint1", "panda_finger_joint2"])
    for name in NAMES:
        m.output(name, f"{name}(panda_link6)")
    mod = m.compile(target="numpy")
    x = np.random.default_rng(3).uniform(-1, 1, mod.n_x)
    y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
    n = mod.n_q
    q, v, a = np.zeros((3, 9))
    q[:n], v[:n], a[:n] = x[:n], x[n:], mod.rhs(0.0, x)[n:]
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    pinocchio.forwardKinematics(model, data, q, v, a)
    frame = model.getFrameId("panda_link6")
    axes = pinocchio.ReferenceFrame
    for suffix, frame_of in (("", axes.LOCAL_WORLD_ALIGNED), ("_body", axes.LOCAL)):
        velocity = pinocchio.getFrameVelocity(model, data, frame, frame_of).angular
        acceleration = pinocchio.getFrameAcceleration(model, data, frame, frame_of).angular
        assert [y[f"w{k}{suffix}"] for k in "xyz"] == pytest.approx(velocity, rel=1e-11)
        assert [y[f"w{k}{suffix}_dot"] for k in "xyz"] == pytest.approx(acceleration, rel=1e-11)


TUMBLING = """
name: tumbling
bodies:
  stone: {mass: 1, inertia: [1, 2, 3], markers: {tip: {at: [0.1, 0, 0.2], rpy: [0.3, -0.4, 0.5]}}}
joints: {fly: {type: free, between: [ground, stone], rotation: euler_parameters}}
initial: {fly_wx: 0.4, fly_wy: 2, fly_wz: -0.3}
outputs:
"""


def test_rates_are_the_derivatives_of_what_a_run_shows(tmp_path: Path) -> None:
    path = tmp_path / "tumbling.yaml"
    path.write_text(TUMBLING + "".join(f"  {name}: {name}(stone.tip)\n" for name in NAMES), encoding="utf-8")
    run = eg.load(path).compile(target="numpy").simulate(2.0, t_eval=np.linspace(0, 2, 2001), rtol=1e-12, atol=1e-13)
    for axes in ("", "_body"):
        for axis in "xyz":
            w, rate = run[f"w{axis}{axes}"], run[f"w{axis}{axes}_dot"]
            slope = (w[:-4] - 8 * w[1:-3] + 8 * w[3:-1] - w[4:]) / (12 * 1e-3)
            assert np.abs(rate).max() > 0.1
            assert np.abs(slope - rate[2:-2]).max() < 1e-8
    speeds = [np.linalg.norm([run[f"w{axis}{axes}"] for axis in "xyz"], axis=0) for axes in ("", "_body")]
    assert np.abs(speeds[0] - speeds[1]).max() < 1e-12


@pytest.mark.parametrize(("text", "message"), [("wx(com)", "has no rotation"), ("wx_body(stone.top)", "stone.top")])
def test_what_does_not_turn_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "tumbling.yaml"
    path.write_text(TUMBLING + f"  spin: {text}\n", encoding="utf-8")
    with pytest.raises(eg.ModelError, match=message):
        eg.load(path).check()
