"""Euler parameters: Jacobi's elliptic functions, loops as in Euler angles, singular angles, and what is no state."""

from typing import Any

import judges
import numpy as np
import pytest
import rotations
from models import IN_C, reference
from refusals import refuses
from scipy.spatial.transform import Rotation
from sweeps import TARGETS

import eomgen as eg


def free_body(rotation: str, inertia: tuple[float, float, float], sequence: str | None = None) -> eg.Model:
    m = eg.Model("thrown")
    b = m.body("b", mass=2.0, com=(0, 0, 0), inertia=inertia)
    m.free("f", m.ground, b, rotation=rotation, sequence=sequence)
    return m


def test_a_free_body_tumbles_as_jacobi_says() -> None:
    """torque_free_rigid_body.json: angular velocity by Jacobi's elliptic functions; energy and momentum are kept."""
    case = reference("torque_free_rigid_body")["reference"]["jacobi_start_w2_0"]
    w0 = [float(x) for x in case["omega0"]]
    module = free_body("euler_parameters", (1, 2, 3)).compile(target="numpy")
    start = {"f_wx": w0[0], "f_wy": w0[1], "f_wz": w0[2], "f_x_dot": 0.1}
    times = np.unique(np.concatenate([[1, 2, 5, 10], np.linspace(0, 100, 101)]))
    traj = module.simulate((0, 100), initial=start, t_eval=times, rtol=1e-13, atol=1e-14)
    w = np.array([traj[f"f_w{axis}"] for axis in "xyz"])
    for text, expected in case["omega"].items():
        k = int(np.flatnonzero(times == float(text))[0])
        np.testing.assert_allclose(w[:, k], [float(x) for x in expected], atol=1e-11)
    e = np.array([traj[f"f_e{k}"] for k in range(4)])
    np.testing.assert_allclose((e * e).sum(axis=0), 1.0, atol=1e-14)
    momentum = np.array([rotations.matrix(e[:, k]) @ ([1, 2, 3] * w[:, k]) for k in range(len(times))])
    assert np.abs(momentum - momentum[0]).max() < 1e-8 * np.linalg.norm(momentum[0])
    assert traj.energy_drift < 1e-8


@pytest.mark.parametrize(("sequence", "method"), [("xyz", "embedding"), ("xyz", "lagrange"), ("zxz", "recursive")])
def test_euler_angles_stop_at_their_singularity_and_pass_by_it(sequence: str, method: str) -> None:
    """A ball spins about a fixed axis exactly through, and nearly through, the singular orientation at t = 1 s."""
    module = free_body("euler_angles", (0.4, 0.4, 0.4), sequence).compile(method=method, target="numpy")
    w = np.array([0.7, -0.5, 0.9])  # in body axes, constant
    middle = np.pi / 2 if len(set(sequence)) == 3 else 0.0
    for miss in (0.0, 1e-2):
        at_one = Rotation.from_euler(sequence.upper(), [0.3, middle + miss, 0.2])
        begin = (at_one * Rotation.from_rotvec(-w)).as_matrix()
        x = module.x0(angles(begin, w, sequence))
        if not miss:
            refuses("EG-STALLED f euler_parameters", module.simulate, (0, 2), initial=x, rtol=1e-10, atol=1e-12)
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


def test_initial_values() -> None:
    module = free_body("euler_parameters", (1, 2, 3)).compile(target="numpy")
    np.testing.assert_array_equal(module.x0()[3:7], [1, 0, 0, 0])
    half = 0.3
    x = module.x0(f_e0=np.cos(half), f_e3=np.sin(half), f_z=2.0, f_wz=1.5)
    np.testing.assert_allclose(x, [0, 0, 2, np.cos(half), 0, 0, np.sin(half), 0, 0, 0, 0, 0, 1.5], atol=1e-15)
    assert np.linalg.norm(module.x0(f_e0=0.7071068, f_e1=0.7071068)[3:7]) == pytest.approx(1.0, abs=1e-15)
    refuses("EG-CONTRADICTION f_e0 0.5 1", module.x0, f_e0=0.5)
    refuses("EG-NAME-UNKNOWN f_wx", module.x0, f_e0_dot=0.5)
    refuses("EG-UNSUPPORTED f_wx", getattr, module, "minimal")
    refuses("EG-UNSUPPORTED minimal", module.kinematics, np.zeros(6))


def test_names_units_columns_and_expressions() -> None:
    m = free_body("euler_parameters", (1, 2, 3))
    m.output("twice", "2*f_e1_dot + f_wx + f_wy_dot")
    m.torque("drag", "b", ("-0.1*f_wx", 0, "0.2*f_e1"), axes="body")
    module = m.compile(target="numpy")
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


def stone(rotation: str = "euler_parameters", **keys: Any) -> eg.Model:
    m = eg.Model("stone", gravity=(0, 0, -9.81))
    m.free("f", m.ground, m.body("b", mass=2.0, com=(0.1, 0.2, 0.3), inertia=(1, 2, 2.5)), rotation=rotation, **keys)
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_no_rotation_and_no_number_are_named(target: str) -> None:
    module = stone().compile(target=target, **(IN_C if target == "cython" else {}))
    start = module.x0(f_wx=1.0)
    first = module.q_names.index("f_e0")
    for size in (0.0, 1e-170):
        x = np.array(start)
        x[first : first + 4] = size
        for call in (module.rhs, module.jacobian, lambda t, x: module.project(x)):
            refuses("EG-NOT-FINITE f_e0 f_e3 1", call, 0.0, x)
    x[first : first + 4] = [1e-30, 0, 0, 0]  # of any length but zero
    module.rhs(0.0, x)
    batch = np.stack([x, x], axis=1)
    batch[first, 1] = 0.0
    refuses("EG-NOT-FINITE f_e0 f_e3", module.rhs, 0.0, batch)
    for name, value in (("f_e2", np.nan), ("f_wy", np.inf)):
        x = np.array(start)
        x[module.x_names.index(name)] = value
        for call in (module.rhs, module.jacobian):
            refuses(f"EG-NOT-FINITE {name}", call, 0.0, x)
    x = np.array(start)
    x[0] = np.nan  # no acceleration depends on it
    refuses("EG-NOT-FINITE f_x", module.simulate, 1.0, initial=x)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (
            lambda m: m.joint("free", "g", "ground", "b", rotation="quaternion"),
            "EG-CHOICE joints.g.rotation: euler_parameters",
        ),
        (lambda m: m.torque("t", "f_e1", 1.0), "EG-REFERENCE forces.t.joint: 'f_e1' body"),
        (lambda m: m.initial(f_e0_dot=1.0), "EG-NAME-UNKNOWN initial.f_e0_dot: f_wx"),
        (lambda m: m.parameter("f_wx", 1.0), "EG-NAME-TAKEN joints.f: 'f_wx'"),
        (lambda m: m.initial(f_e0=0.9, f_e1=0.9), "EG-CONTRADICTION f_e0 0.9 1.27279"),
        (lambda m: m.independent("f_e0"), "EG-PARTITION independent: 'f_e0' f_wx"),
    ],
)
def test_faults_of_descriptions(change: Any, fault: str) -> None:
    m = stone()
    change(m)
    refuses(fault, m.check)


def rssr(rotation: str) -> eg.Model:
    m = eg.Model("rssr", gravity=(0, 0, -9.81))
    crank = m.body("crank", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 2e-3, 2e-3))
    rod = m.body("rod", mass=0.7, com=(0.2, 0.01, 0), inertia=(1e-4, 3e-3, 3.1e-3))
    rocker = m.body("rocker", mass=0.9, com=(0.1, 0, 0), inertia=(1e-3, 4e-3, 4e-3))
    m.revolute("A", m.ground, crank, coordinate="th")
    m.spherical("S", crank.at(0.1, 0, 0), rod, rotation=rotation)
    m.revolute("D", m.ground.at(0.4, 0.1, 0.05), rocker, axis="y", coordinate="ph")
    m.spherical("T", rod.at(0.4, 0, 0), rocker.at(0.25, 0, 0), rotation=rotation)
    m.initial(th=0.3, th_dot=5.0)
    m.damper("d", m.ground.at(0.1, 0.1, 0.1), rod.at(0.3, 0, 0), damping=0.4)
    for k, axis in enumerate("xyz"):
        point = rod.at(0.2, 0.1, 0.05)
        m.output(f"a{axis}", point.acceleration[k])
    return m


def as_parameters(angles: Any, parameters: Any, x: np.ndarray) -> np.ndarray:
    """A state of the model in Euler angles as one in Euler parameters, by poses and their rates."""
    named = dict(zip(angles.x_names, x, strict=True))

    def relative(q: np.ndarray) -> np.ndarray:
        crank, rod = angles.poses(q)[:2, :3, :3]
        return crank.T @ rod

    q, v, h = x[: angles.n_q], x[angles.n_q :], 1e-3
    R = relative(q)
    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    R_dot = sum(c * (relative(q + k * h * v) - relative(q - k * h * v)) for k, c in enumerate(weights, 1)) / h
    W = R.T @ R_dot
    named |= {f"S_e{k}": y for k, y in enumerate(rotations.from_matrix(R))}
    named |= {"S_wx": W[2, 1], "S_wy": W[0, 2], "S_wz": W[1, 0]}
    return np.array([named[name] for name in parameters.x_names])


def test_loops_in_parameters_are_those_in_angles() -> None:
    """Outputs, energies and runs agree; accelerations are those of multipliers, the Jacobian that of differences."""
    angles, parameters = (rssr(kind).compile(target="numpy") for kind in ("euler_angles", "euler_parameters"))
    by_lagrange = rssr("euler_parameters").compile("lagrange", target="numpy", kernels=["rhs"])
    n = parameters.n_q
    for th, spin in ((0.3, 0.0), (-0.4, -3.0)):
        x = angles.x0(th=th, th_dot=5.0, S_1_dot=spin)
        y = as_parameters(angles, parameters, x)
        np.testing.assert_allclose(parameters.project(y), y, atol=1e-9)
        np.testing.assert_allclose(parameters.outputs(0.0, y), angles.outputs(0.0, x), rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(parameters.energy(y), angles.energy(x), rtol=1e-9)
        y = parameters.project(y)
        x_dot = parameters.rhs(0.0, y)
        np.testing.assert_allclose(by_lagrange.rhs(0.0, y), x_dot, rtol=0, atol=1e-9 * np.abs(x_dot).max())
        q_dot = rotations.coordinate_rates(parameters.metadata, y[:n], y[n:])
        np.testing.assert_allclose(x_dot[:n], q_dot, atol=1e-12)

        def rates(columns: np.ndarray, v: np.ndarray = y[n:]) -> np.ndarray:
            return np.einsum("ijk,j->ik", parameters.constraint_jacobian(columns, rows="all"), v)

        C_q, gamma = parameters.constraint_jacobian(y[:n], rows="all"), judges.first(rates, y[:n], q_dot)
        a = judges.augmented(parameters.mass_matrix(y[:n]), parameters.bias(0.0, y), C_q, gamma)
        np.testing.assert_allclose(x_dot[n:], a, atol=1e-8 * np.abs(a).max())
        J, h = parameters.jacobian(0.0, y), 1e-6
        slopes = [(parameters.rhs(0.0, y + h * e) - parameters.rhs(0.0, y - h * e)) / (2 * h) for e in np.eye(len(y))]
        np.testing.assert_allclose(J, np.array(slopes).T, atol=3e-7 * np.abs(J).max())
        scaled = np.array(y)
        scaled[[name[-3:-1] == "_e" for name in parameters.x_names]] *= 1.7  # the length of e means nothing
        np.testing.assert_allclose(parameters.rhs(0.0, scaled)[n:], x_dot[n:], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(parameters.project(scaled), y, atol=1e-12)
    runs = [one.simulate(0.2, initial=start, rtol=1e-10, atol=1e-12) for one, start in ((angles, x), (parameters, y))]
    for name in ("th", "ph", "ax", "energy"):
        assert runs[1][name][-1] == pytest.approx(runs[0][name][-1], rel=1e-6, abs=1e-6)
    e = np.array([runs[1][f"T_e{k}"][-1] for k in range(4)])  # of the joint that was cut
    rod, rocker = parameters.poses(runs[1].x[:n, -1])[1:, :3, :3]
    np.testing.assert_allclose(rotations.matrix(e), rod.T @ rocker, atol=1e-10)
