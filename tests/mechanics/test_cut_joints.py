"""The same mechanism with a joint in the tree and with the joint cut: equal accelerations, counts as in the book."""

from typing import Any

import numpy as np
import pytest
from judges import first
from sweeps import METHODS

import eomgen as eg

FREE = [f"f_{k}" for k in ("x", "y", "z", "1", "2", "3")]
TURNED = (0.3, -0.4, 0.5)


def model(held: dict[str, Any] | None, closing: dict[str, Any] | None = None, *more: dict[str, Any]) -> eg.Model:
    """A body on a joint (or free, with joints closing loops to ground), and a second body that swings on it."""
    m = eg.Model("pair", gravity=(0.5, -9.81, 0.7))
    body = m.body("body", mass=1.3, com=(0.1, 0.2, -0.1), inertia=[[0.2, 0.01, 0.02], [0.01, 0.3, 0], [0.02, 0, 0.25]])
    arm = m.body("arm", mass=0.6, com=(0.3, 0, 0.05), inertia=(0.02, 0.05, 0.06))
    m.revolute("r", body.at(0.1, 0.3, 0.2, rpy=(0.4, 0.1, 0)), arm, coordinate="swing")
    base, end = m.ground.at(0.2, -0.1, 0.4, rpy=TURNED), body.at(-0.1, 0.05, 0.2, rpy=(-0.2, 0.3, 0.6))
    if held is None:
        m.free("f", m.ground, body, coordinates=FREE)
    for k, joint in enumerate([held] if held is not None else [closing, *more]):
        keys = dict(joint or {})
        m.joint(keys.pop("type"), f"j{k or ''}", base, end, **keys)
    for name, marker in (("body", body.at(0.3, 0.4, 0.5)), ("arm", arm.at(1, 0, 0))):
        for k, axis in enumerate("xyz"):
            m.output(f"{name}_{axis}", marker.position[k])
            m.output(f"{name}_v{axis}", marker.velocity[k])
            m.output(f"{name}_a{axis}", marker.acceleration[k])
    return m


def same_motion(minimal: eg.Module, x: np.ndarray, constrained: eg.Module, y: np.ndarray) -> None:
    """Positions, velocities and accelerations of points of both bodies agree."""
    a, b = minimal.outputs(0.0, x), constrained.outputs(0.0, y)
    names = list(minimal.y_names)
    rates = np.array([name.split("_")[1][0] == "a" for name in names])
    assert np.abs(a - b)[~rates].max() <= 1e-10
    assert np.abs(a - b)[rates].max() <= 1e-10 * np.abs(a[rates]).max()
    assert minimal.energy(x)[0] == pytest.approx(constrained.energy(y)[0], rel=1e-10)


CUTTABLE: list[dict[str, Any]] = [
    {"type": "revolute", "axis": "x"},
    {"type": "continuous"},
    {"type": "prismatic", "axis": [1, 2, -0.5]},
    {"type": "screw", "pitch": 0.3},
    {"type": "screw", "pitch": -0.4, "axis": "-y"},
    {"type": "cylindrical", "axis": "y"},
    {"type": "universal"},
    {"type": "universal", "axis": "x"},
    {"type": "constant_velocity"},
    {"type": "constant_velocity", "axis": "y"},
    {"type": "planar", "axis": "x"},
    {"type": "spherical", "sequence": "zxz"},
]


@pytest.mark.parametrize("joint", CUTTABLE, ids=lambda j: f"{j['type']}-{j.get('axis', 'z')}")
def test_tree_and_cut_joint_agree(joint: dict[str, Any]) -> None:
    with_tree, loop = model(joint), model(None, joint)
    for coordinate, force in (("j_z", 1.3), ("j_3", -0.7)) if joint["type"] == "cylindrical" else ():
        for m in (with_tree, loop):
            m.actuator(f"along_{coordinate}", coordinate, value=force)
    tree = with_tree.compile(target="numpy")
    names = [name for name in tree.q_names if name != "swing"]
    report = loop.check()
    n = len(tree.q_names)
    assert report.loop_joints == ["j"]
    assert report.degrees_of_freedom == report.gruebler_kutzbach == n
    assert report.constraints == report.rank == 7 - n
    closed = loop.compile(target="numpy")
    others = [loop.compile(method, target="numpy") for method in METHODS[1:] if joint["type"] == "cylindrical"]
    random = np.random.default_rng(4)
    for _ in range(3):
        values = {name: float(random.uniform(0.2, 1.2)) for name in [*names, "swing"]}
        values |= {f"{name}_dot": float(random.uniform(-2, 2)) for name in [*names, "swing"]}
        x, y = tree.x0(**values), closed.x0(**values)
        for one in (closed, *others):
            same_motion(tree, x, one, y)
        assert np.abs(closed.constraints(y[: closed.n_q])).max() < 1e-10


def test_a_joint_between_two_moving_arms_stays_closed() -> None:
    """Accelerations keep C' = 0, whose differences along the motion know of no Coriolis terms."""
    m, ends = eg.Model("arms", gravity=(0, 0, -9.81)), []
    for side, y in (("a", 0.1), ("b", -0.2)):
        ends.append(m.ground.at(0, y, 0))
        for k, axis in enumerate("xyz"):
            link = m.body(f"{side}{k}", mass=1.0, com=(0.2, 0, 0.1), inertia=(0.02, 0.03, 0.04))
            m.revolute(f"{side}_{axis}", ends[-1], link, axis=axis)
            ends[-1] = link.at(0.4, 0.1, 0.05, rpy=(0.3, -0.2, 0.1))
    m.cylindrical("close", *ends)
    mod = m.compile(target="numpy")
    x = mod.project(np.concatenate([mod.x0()[: mod.n_q], [2.0, -1.5, 3.0, 1.0, -2.5, 2.0]]))
    np.testing.assert_allclose(first(mod.velocity_constraints, x, mod.rhs(0.0, x)), 0.0, atol=1e-6)


CIRCLE = ["1.3*cos(j_s)", "1.3*sin(j_s)", 0]
SPHERE = ["1.3*cos(j_u)*cos(j_v)", "1.3*sin(j_u)*cos(j_v)", "1.3*sin(j_v)"]
PAIRS: list[tuple[dict[str, Any], list[dict[str, Any]]]] = [
    ({"type": "point_on_curve", "curve": CIRCLE}, [{"type": "revolute_spherical", "length": 1.3}]),
    ({"type": "point_on_curve", "curve": [0, 0, "2*j_s"]}, [{"type": "inline"}]),
    ({"type": "point_on_surface", "surface": SPHERE}, [{"type": "distance", "length": 1.3}]),
    ({"type": "point_on_surface", "surface": ["j_u + j_v", "j_v**3 + j_v", 0]}, [{"type": "inplane"}]),
    ({"type": "curve_slider", "curve": [0, 0, "j + j**3/3"]}, [{"type": "prismatic"}]),
    ({"type": "surface_slider", "surface": ["j_u", "j_v", 0]}, [{"type": "orientation"}, {"type": "inplane"}]),
    ({"type": "revolute"}, [{"type": "spherical"}, {"type": "parallel"}]),
    ({"type": "cylindrical"}, [{"type": "inline"}, {"type": "parallel"}]),
    ({"type": "planar"}, [{"type": "inplane"}, {"type": "parallel"}]),
    ({"type": "weld"}, [{"type": "spherical"}, {"type": "orientation"}]),
]


@pytest.mark.parametrize(("joint", "constraints"), PAIRS, ids=lambda j: j["type"] if isinstance(j, dict) else "")
def test_joints_equal_the_constraints_they_imply(joint: dict[str, Any], constraints: list[dict[str, Any]]) -> None:
    tree = model(joint).compile(target="numpy")
    loop = model(None, *constraints)
    assert loop.check().degrees_of_freedom == len(tree.q_names)
    closed = loop.compile(target="numpy")
    random = np.random.default_rng(5)
    for _ in range(2):
        values = {name: float(random.uniform(0.2, 1.0)) for name in tree.q_names}
        values |= {f"{name}_dot": float(random.uniform(-2, 2)) for name in tree.q_names}
        x = tree.x0(**values)
        y = closed.project(same_pose(tree, x, closed))
        same_motion(tree, x, closed, y)


def same_pose(tree: eg.Module, x: np.ndarray, closed: eg.Module) -> np.ndarray:
    """The state of the constrained version in which its bodies are where the minimal version has them."""
    n = tree.n_q

    def free(q: np.ndarray) -> np.ndarray:
        pose = tree.poses(q)[0]
        R, r = pose[:3, :3], pose[:3, 3]
        angles = [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])]
        return np.array([*r, *angles])

    rates = first(free, x[:n], x[n:])
    values = dict(zip(FREE, free(x[:n]), strict=True)) | {"swing": x[tree.x_names.index("swing")]}
    values |= dict(zip([f"{n}_dot" for n in FREE], rates, strict=True))
    values["swing_dot"] = x[tree.x_names.index("swing_dot")]
    return np.array([values[name] for name in closed.x_names])
