"""Motion in Euler parameters and Euler angles against closed forms: free bodies, tops, the singularity of angles."""

from __future__ import annotations

import numpy as np
import pytest
import rotations
from models import reference
from scipy.spatial.transform import Rotation
from sweeps import part_of

import eomgen as eg
from eomgen.equations import METHODS


def free_body(rotation: str, inertia: tuple[float, float, float], sequence: str | None = None) -> eg.Model:
    m = eg.Model("thrown")
    b = m.body("b", mass=2.0, com=(0, 0, 0), inertia=inertia)
    m.free("f", m.ground, b, rotation=rotation, sequence=sequence)
    return m


def test_a_free_body_tumbles_for_a_thousand_seconds() -> None:
    """torque_free_rigid_body.json: angular velocity by Jacobi's elliptic functions; energy and momentum are kept."""
    case = reference("torque_free_rigid_body")["reference"]["jacobi_start_w2_0"]
    w0 = [float(x) for x in case["omega0"]]
    module = free_body("euler_parameters", (1, 2, 3)).compile()
    start = {"f_wx": w0[0], "f_wy": w0[1], "f_wz": w0[2], "f_x_dot": 0.1}
    times = np.unique(np.concatenate([[1, 2, 5, 10], np.linspace(0, 1000, 4001)]))
    traj = module.simulate((0, 1000), initial=start, t_eval=times, rtol=1e-13, atol=1e-14)
    w = np.array([traj[f"f_w{axis}"] for axis in "xyz"])
    for text, expected in case["omega"].items():
        k = int(np.flatnonzero(times == float(text))[0])
        np.testing.assert_allclose(w[:, k], [float(x) for x in expected], atol=1e-11)
    e = np.array([traj[f"f_e{k}"] for k in range(4)])
    np.testing.assert_allclose((e * e).sum(axis=0), 1.0, atol=1e-14)
    momentum = np.array([rotations.matrix(e[:, k]) @ ([1, 2, 3] * w[:, k]) for k in range(len(times))])
    assert np.abs(momentum - momentum[0]).max() < 1e-8 * np.linalg.norm(momentum[0])
    assert traj.energy_drift < 1e-8


def test_a_body_that_turns_over_and_over_comes_by_every_singularity_of_angles() -> None:
    """For 1,000 s near the intermediate axis: energy and angular momentum stay while all axes meet all axes.

    On the way from one half-turn to the next the outer axes come within 45 degrees of the angular momentum, where
    1 / I_x + 1 / I_z = 2 / I_y (the separatrix; Goldstein, sec. 5.6); a momentum that makes equal angles with the axes
    of ground, 54.7 degrees, then brings every axis of the body to every axis of ground.
    """
    inertia = np.array([2.0, 2.4, 3.0])
    module = free_body("euler_parameters", tuple(inertia)).compile()
    w0 = np.array([0.3, 2.0, 0.21])
    begin = Rotation.align_vectors([np.ones(3)], [inertia * w0])[0].as_quat(scalar_first=True)
    start = dict(zip(module.q_names[3:], begin, strict=True)) | dict(zip(module.v_names[3:], w0, strict=True))
    times = np.linspace(0, 1000, 20001)
    traj = module.simulate((0, 1000), initial=start, t_eval=times, rtol=1e-13, atol=1e-14)
    w, e = (np.array([traj[n] for n in names[3:]]) for names in (module.v_names, module.q_names))
    matrices = Rotation.from_quat(e.T, scalar_first=True).as_matrix()
    momentum = np.einsum("kij,jk->ki", matrices * inertia, w)
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.linalg.norm(momentum[0])
    assert traj.energy_drift < 1e-11
    assert w[1].min() < -1.9  # it does turn over
    # zxz is singular where z meets z, xyz where z meets x, and so on
    assert np.abs(matrices).max(axis=0).min() > np.cos(0.02)


def top(rotation: str, numbers: dict, sequence: str = "zxz") -> eg.Model:
    A, C, mass, length = (float(numbers[key]) for key in ("A", "C", "m", "l"))
    m = eg.Model("top", gravity=(0, 0, -float(numbers["g"])))
    b = m.body("b", mass=mass, com=(0, 0, length), inertia=(A - mass * length**2, A - mass * length**2, C))
    m.spherical("s", m.ground, b, rotation=rotation, sequence=sequence if rotation == "euler_angles" else None)
    return m


def start_of_top(rotation: str, theta: float, precession: float, spin: float) -> dict[str, float]:
    """Nutation theta, precession and spin rates as initial values."""
    if rotation == "euler_angles":
        return {"s_1": 0.0, "s_2": theta, "s_3": 0.0, "s_1_dot": precession, "s_2_dot": 0.0, "s_3_dot": spin}
    w = np.array([0.0, precession * np.sin(theta), spin + precession * np.cos(theta)])
    half = theta / 2
    return {"s_e0": np.cos(half), "s_e1": np.sin(half)} | {f"s_w{a}": x for a, x in zip("xyz", w, strict=True)}


def cosine_of_nutation(traj: eg.Trajectory, rotation: str) -> np.ndarray:
    if rotation == "euler_angles":
        return np.cos(traj["s_2"])
    return np.array([rotations.matrix(e)[2, 2] for e in np.array([traj[f"s_e{k}"] for k in range(4)]).T])


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
def test_heavy_top(rotation: str) -> None:
    """heavy_top.json (Goldstein ch. 5): steady precession stays steady; the cusped nutation of 30 degrees."""
    case = reference("heavy_top")
    p = case["parameters_SI"] | {"A": case["parameters_SI"]["A_about_fixed_point"]}
    module = top(rotation, p).compile()
    for name in ("theta20_w3_50", "theta60_w3_100"):
        theta, w3 = np.radians(float(name[5:7])), float(name.split("_w3_")[1])
        for text in case["steady_precession"][name]:
            rate = float(text)
            given = start_of_top(rotation, theta, rate, w3 - rate * np.cos(theta))
            traj = module.simulate(1.0, initial=given, rtol=1e-12, atol=1e-12)
            assert np.abs(cosine_of_nutation(traj, rotation) - np.cos(theta)).max() < 1e-9
    cusp = case["cusp_case"]
    p = {**cusp, "g": case["parameters_SI"]["g"]}
    given = start_of_top(rotation, np.radians(cusp["theta0_deg"]), 0.0, cusp["spin0"])
    times = [float(text) for text in cusp["values"]]
    traj = top(rotation, p).compile().simulate((0, max(times)), initial=given, t_eval=times, rtol=1e-13, atol=1e-13)
    wanted = [np.cos(float(values[0])) for values in cusp["values"].values()]
    np.testing.assert_allclose(cosine_of_nutation(traj, rotation), wanted, atol=1e-10)


WAYS = [(method, target) for method in sorted(METHODS) for target in ("cython", "numpy")]
SLOW = ("amalgamated", "hamilton")  #: noise may carry them through the singularity, or nearly


@pytest.mark.parametrize(
    ("sequence", "method", "target"),
    part_of(
        [*((s, *way) for s in ("xyz", "zxz") for way in WAYS if way[0] not in SLOW), ("yzx", "auto", "cython")],
        lambda case: case[0] == "yzx" or (case[0] == "xyz") == (case[2] == "numpy"),
    ),
)
def test_euler_angles_stop_at_their_singularity_and_pass_by_it(sequence: str, method: str, target: str) -> None:
    """A ball spins about a fixed axis exactly through, and nearly through, the singular orientation at t = 1 s."""
    module = free_body("euler_angles", (0.4, 0.4, 0.4), sequence).compile(method=method, target=target)
    w = np.array([0.7, -0.5, 0.9])  # in body axes, constant
    middle = np.pi / 2 if len(set(sequence)) == 3 else 0.0
    for miss in (0.0, 1e-2):
        at_one = Rotation.from_euler(sequence.upper(), [0.3, middle + miss, 0.2])
        begin = (at_one * Rotation.from_rotvec(-w)).as_matrix()
        x = module.x0(angles(begin, w, sequence))
        if not miss:
            with pytest.raises(eg.SimulationError, match="Euler angles of joint 'f'.*rotation: euler_parameters"):
                module.simulate((0, 2), initial=x, rtol=1e-10, atol=1e-12)
            continue
        traj = module.simulate((0, 2), initial=x, rtol=1e-11, atol=1e-12)
        end = module.poses(traj.x[: module.n_q, -1])[0, :3, :3]
        np.testing.assert_allclose(end, (at_one * Rotation.from_rotvec(w)).as_matrix(), atol=1e-7)
        assert traj.energy_drift < 1e-8


def angles(R: np.ndarray, w: np.ndarray, sequence: str) -> dict[str, float]:
    """Euler angles of a rotation and their rates for an angular velocity in body axes, by SciPy and differences."""
    here = Rotation.from_matrix(R).as_euler(sequence.upper())

    def turned(h: float) -> np.ndarray:
        later = (Rotation.from_matrix(R) * Rotation.from_rotvec(h * w)).as_euler(sequence.upper())
        return here + np.remainder(later - here + np.pi, 2 * np.pi) - np.pi

    h = 2e-3
    slopes = sum(c * (turned(k * h) - turned(-k * h)) for k, c in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), 1)) / h
    values = {f"f_{k + 1}": x for k, x in enumerate(here)}
    return values | {f"f_{k + 1}_dot": x for k, x in enumerate(slopes)}


@pytest.mark.parametrize(("method", "target"), WAYS)
def test_the_start_at_a_singularity_is_named(method: str, target: str) -> None:
    module = free_body("euler_angles", (1, 2, 3)).compile(method=method, target=target)
    x = np.zeros(module.n_x)
    x[module.q_names.index("f_2")] = np.pi / 2
    with pytest.raises(eg.EomgenError, match="Euler angles of joint 'f'.*f_2 = 90 deg.*euler_parameters"):
        module.rhs(0.0, x)


def test_initial_values() -> None:
    module = free_body("euler_parameters", (1, 2, 3)).compile(target="numpy")
    np.testing.assert_array_equal(module.x0()[3:7], [1, 0, 0, 0])
    half = 0.3
    x = module.x0(f_e0=np.cos(half), f_e3=np.sin(half), f_z=2.0, f_wz=1.5)
    np.testing.assert_allclose(x, [0, 0, 2, np.cos(half), 0, 0, np.sin(half), 0, 0, 0, 0, 0, 1.5], atol=1e-15)
    assert np.linalg.norm(module.x0(f_e0=0.7071068, f_e1=0.7071068)[3:7]) == pytest.approx(1.0, abs=1e-15)
    with pytest.raises(eg.AssemblyError, match=r"f_e0 = 0.5.*length 0.5, not 1.*cos\(angle/2\)"):
        module.x0(f_e0=0.5)
    with pytest.raises(eg.UsageError, match="follows from the angular velocity.*f_wx"):
        module.x0(f_e0_dot=0.5)
    with pytest.raises(eg.UsageError, match="no minimal form.*f_wx.*full state"):
        _ = module.minimal
    with pytest.raises(eg.UsageError, match="no minimal form"):
        module.kinematics(np.zeros(6))


def test_names_units_columns_and_expressions() -> None:
    m = free_body("euler_parameters", (1, 2, 3))
    m.output("twice", "2*f_e1_dot + f_wx + f_wy_dot")
    m.torque("drag", "b", ("-0.1*f_wx", 0, "0.2*f_e1"), axes="body")
    module = m.compile()
    assert module.q_names == ("f_x", "f_y", "f_z", "f_e0", "f_e1", "f_e2", "f_e3")
    assert module.v_names == ("f_x_dot", "f_y_dot", "f_z_dot", "f_wx", "f_wy", "f_wz")
    traj = module.simulate(1.0, initial={"f_wx": 1.0, "f_wy": 0.2, "f_wz": 0.3})
    assert traj.x_names == module.q_names + module.v_names
    expected = 2 * traj["f_e1_dot"] + traj["f_wx"] + traj["f_wy_dot"]
    np.testing.assert_allclose(traj["twice"], expected, atol=1e-12)
    e, w = (np.array([traj[n] for n in names]) for names in (module.q_names[3:], module.v_names[3:]))
    np.testing.assert_allclose(
        [traj[f"f_e{k}_dot"] for k in range(4)], np.array([rotations.rates(*p) for p in zip(e.T, w.T, strict=True)]).T
    )
    # Euler's equation of the first axis, from outside
    np.testing.assert_allclose(traj["f_wx_dot"], (2 - 3) * w[1] * w[2] - 0.1 * w[0], atol=1e-12)
    assert traj.units["f_wx"] == "rad/s"
    assert traj.units["f_wx_dot"] == "rad/s^2"
    assert "f_e0" not in traj.units
    assert traj.units["f_e0_dot"] == "1/s"
