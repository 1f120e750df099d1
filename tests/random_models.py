"""Random mechanisms with mixed joints, planar and spatial, with loops, and the same numbers for judges from outside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import judges
import numpy as np
import rotations
from scipy.spatial.transform import Rotation

import eomgen as eg

PITCH, LENGTH = 0.7, 1.3
#: Types of joints that can be in a tree -> the endings of their coordinates (with Euler angles).
SUFFIXES = {
    "revolute": ("",),
    "continuous": ("",),
    "prismatic": ("",),
    "screw": ("",),
    "cylindrical": ("_z", "_3"),
    "universal": ("_1", "_2"),
    "constant_velocity": ("_1", "_2"),
    "spherical": ("_1", "_2", "_3"),
    "planar": ("_x", "_y", "_3"),
    "translational": ("_x", "_y", "_z"),
    "curve_slider": ("",),
    "surface_slider": ("_u", "_v"),
    "point_on_curve": ("_s", "_1", "_2", "_3"),
    "point_on_surface": ("_u", "_v", "_1", "_2", "_3"),
    "free": ("_x", "_y", "_z", "_1", "_2", "_3"),
    "weld": (),
}
SPATIAL = tuple(SUFFIXES)
#: A wound and stretched helix, and a bumpy saddle whose parameters are not at right angles.
CURVE = ("cos(2*{s}) + 0.3*{s}", "0.8*sin(2*{s})", "{s} + 0.2*{s}*{s}")
SURFACE = ("{u} + 0.2*{v}", "{v} + 0.1*sin({u})", "{u}*{v} + 0.3*{u}*{u}")
#: Of the forces: places in the bodies, a force and a torque in body axes, and the laws of a spring and a damper.
ANCHOR, TIP, CORNER = np.array([3.0, 2.0, 0.5]), np.array([0.2, -0.3, 0.4]), np.array([-0.1, 0.2, 0.3])
PUSH, TWIST = np.array([1.0, -2.0, 0.7]), np.array([0.3, 0.4, -0.6])
STIFFNESS, FREE_LENGTH, DAMPING = 20.0, 1.0, 1.5


@dataclass(frozen=True)
class Placement:
    """A marker as numbers."""

    rotation: np.ndarray
    position: np.ndarray

    def on(self, body: Any) -> Any:
        """The marker on a body of a model."""
        rpy = Rotation.from_matrix(self.rotation).as_euler("xyz")
        return body.at(*self.position.tolist(), rpy=tuple(rpy.tolist()))


@dataclass(frozen=True)
class Random:
    """A random mechanism with the numbers it was made from."""

    model: eg.Model
    parents: list[int]
    kinds: list[str]
    outer: list[Placement]
    inner: list[Placement]
    masses: np.ndarray
    centers: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray

    @property
    def rigid(self) -> judges.RigidBodies:
        return judges.RigidBodies(self.masses, self.centers, self.inertias, self.gravity)


def options_of(kind: str, name: str, rotation: str = "euler_angles") -> dict[str, Any]:
    """Keys of a joint of a type, which exercise all of its terms."""
    if kind in ("spherical", "free"):
        found: dict[str, Any] = {"rotation": rotation}
    else:
        found = {}
    if kind == "screw":
        found["pitch"] = PITCH
    if kind in ("distance", "revolute_spherical"):
        found["length"] = LENGTH
    if "curve" in kind:
        s = name if kind == "curve_slider" else f"{name}_s"
        found["curve"] = [x.format(s=s) for x in CURVE]
    if "surface" in kind:
        found["surface"] = [x.format(u=f"{name}_u", v=f"{name}_v") for x in SURFACE]
    return found


def _inertia(random: np.random.Generator) -> np.ndarray:
    """A physical tensor: second moments of a cloud of points."""
    points = random.normal(size=(6, 3)) * random.uniform(0.1, 0.4, 3)
    return np.asarray(sum(np.eye(3) * (p @ p) - np.outer(p, p) for p in points))


def _placement(random: np.random.Generator, planar: bool, kind: str) -> Placement:
    position = random.uniform(-0.8, 0.8, 3)
    if not planar:
        return Placement(Rotation.random(random_state=int(random.integers(2**31))).as_matrix(), position)
    position[2] = 0.0
    if kind == "prismatic":  # its z axis lies in the plane, on both sides alike
        return Placement(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), position)
    return Placement(Rotation.from_euler("z", random.uniform(-1, 1)).as_matrix(), position)


def random_model(
    seed: int,
    bodies: int,
    planar: bool = False,
    reverse: bool = False,
    forces: str = "",
    loop: bool = False,
    types: Sequence[str] = SPATIAL,
    rotation: str = "euler_angles",
    armature: Mapping[str, float] | None = None,
    closing: tuple[str, np.ndarray, np.ndarray] | None = None,
) -> Random:
    """A tree of mixed joints.

    Parameters
    ----------
    reverse : bool
        Some joints lead from the outer body to the inner one.
    forces : str
        ``judged``: a spring and a damper to the last body, a force and a torque in body axes, which ``Judge`` knows;
        ``more``: also a spring, a damper and a drive over time on the first coordinate.
    loop : bool
        A joint (hinge in the plane, ball in space) holds the last body to ground where the tree puts it.
    armature : mapping
        Inertia of a drive by name of a joint.
    closing : tuple
        In place of that joint a type and the pose of the last body's marker in the joint's axes.
    """
    random = np.random.default_rng(seed)
    parents: list[int] = []
    kinds: list[str] = []
    outer: list[Placement] = []
    inner: list[Placement] = []
    for k in range(bodies):
        parents.append(int(random.integers(-1, k)) if random.random() < 0.5 else k - 1)
        kinds.append(str(random.choice(("revolute", "prismatic", "revolute", "planar") if planar else types)))
        for side in (outer, inner):
            side.append(_placement(random, planar, kinds[-1]))
    if all(kind == "weld" for kind in kinds):
        kinds[0] = "revolute"
    masses = random.uniform(0.5, 2.0, bodies)
    centers = random.uniform(-0.4, 0.4, (bodies, 3)) * (np.array([1, 1, 0]) if planar else 1)
    inertias = np.array([_inertia(random) for _ in range(bodies)])
    if planar:
        inertias = np.array([np.diag(np.diag(i)) for i in inertias])
    gravity = np.array([0.3, -9.81, 0.0 if planar else 0.7])
    turned = [reverse and random.random() < 0.5 for _ in range(bodies)]

    def tree() -> tuple[eg.Model, list[Any]]:
        m = eg.Model(f"random_{seed}", gravity=tuple(gravity.tolist()))
        made = [m.body(f"b{k}", mass=float(masses[k]), com=tuple(centers[k].tolist()), inertia=inertias[k].tolist())
                for k in range(bodies)]  # fmt: skip
        for k, kind in enumerate(kinds):
            name = f"q{k}"
            ends = [outer[k].on(made[parents[k]] if parents[k] >= 0 else m.ground), inner[k].on(made[k])]
            keys = options_of(kind, name, rotation)
            if loop and SUFFIXES[kind]:  # named: they are not what is cut
                suffixes = SUFFIXES[kind]
                if keys.get("rotation") == "euler_parameters":
                    suffixes = (*suffixes[:-3], "_e0", "_e1", "_e2", "_e3")
                names = [name + suffix for suffix in suffixes]
                keys |= {"coordinates": names} if len(names) > 1 else {"coordinate": names[0]}
            if armature and name in armature:
                keys["armature"] = armature[name]
            m.joint(kind, name, *(ends[::-1] if turned[k] else ends), **keys)
        first = next(name + suffix for name, kind in ((f"q{k}", kind) for k, kind in enumerate(kinds))
                     for suffix in SUFFIXES[kind])  # fmt: skip
        if forces:
            _forces(m, made, first if forces == "more" else "")
        return m, made

    m, made = tree()
    if loop:
        bare = m.compile(target="numpy", kernels=["poses", "rhs", "project"])
        q = random.uniform(0.2, 0.7, bare.n_q)
        balls = [k for k, name in enumerate(bare.q_names) if name.endswith("_e0")]
        for k in balls:
            q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
        pose = bare.poses(q)[-1]
        m, made = tree()
        kind, turn, moved = closing or (
            "revolute" if planar else "spherical",
            pose[:3, :3] if planar else np.eye(3),
            np.zeros(3),
        )
        R = pose[:3, :3] @ turn.T
        hold = Placement(R, pose[:3, 3] - R @ moved)
        m.joint(kind, "close", hold.on(m.ground), made[-1], **options_of(kind, "close", rotation))
        m.guess(**dict(zip(bare.q_names, q.tolist(), strict=True)))
    return Random(m, parents, kinds, outer, inner, masses, centers, inertias, gravity)


def _forces(m: eg.Model, bodies: list[Any], coordinate: str) -> None:
    last = bodies[-1]
    anchor, tip = m.ground.at(*ANCHOR.tolist()), last.at(*TIP.tolist())
    m.spring("s", anchor, tip, stiffness=STIFFNESS, length=FREE_LENGTH)
    m.damper("d", anchor, tip, damping=DAMPING)
    m.force("p", bodies[0].at(*CORNER.tolist()), tuple(PUSH.tolist()), axes="body")
    m.torque("t", bodies[(len(bodies) - 1) // 2], tuple(TWIST.tolist()), axes="body")
    if coordinate:
        m.joint_spring("js", coordinate, stiffness=3.0, rest=0.2)
        m.joint_damper("jd", coordinate, damping=0.4)
        m.torque("ja", coordinate, "2*t + 0.3")


def seed_with(group: tuple[str, ...], bodies: int, chain: bool = False) -> int:
    """The first seed whose tree has a joint of each type of a group, in a chain if that is asked for."""
    for seed in range(2000):
        random = np.random.default_rng(seed)
        kinds, parents = [], []
        for k in range(bodies):  # as in random_model, without building it
            parents.append(int(random.integers(-1, k)) if random.random() < 0.5 else k - 1)
            kinds.append(str(random.choice(group)))
            for _ in range(2):
                _placement(random, False, kinds[-1])
        if set(kinds) == set(group) and (not chain or parents == list(range(-1, bodies - 1))):
            return seed
    raise AssertionError(group)


# -- judges ------------------------------------------------------------------------------------------------------------
def basis(module: Any, q: np.ndarray) -> np.ndarray:
    """N of q' = N v, from outside."""
    return np.array([rotations.coordinate_rates(module.metadata, q, e) for e in np.eye(module.n_v)]).T


def in_velocities(module: Any, q_dot: np.ndarray, N: np.ndarray, v: np.ndarray, M: np.ndarray, h: np.ndarray) -> Any:
    """M q'' + h of rates of the coordinates in terms of v': N^T M N, N^T (h + M N' v)."""
    bent = rotations.coordinate_rates(module.metadata, q_dot, v)  # N' v, linear in the Euler parameters ...
    bent[[name[-3:-1] != "_e" for name in module.q_names]] = 0.0  # ... and zero elsewhere
    return N.T @ M @ N, N.T @ (h + M @ bent)


def gamma(module: Any, x: np.ndarray, q_dot: np.ndarray) -> np.ndarray:
    """C_q' v by differences of the constraint Jacobian."""
    v = x[module.n_q :]

    def rates(columns: np.ndarray) -> np.ndarray:
        return np.einsum("ijk,j->ik", module.constraint_jacobian(columns, rows="all"), v)

    return judges.first(rates, x[: module.n_q], q_dot)


class Judge:
    """What the bodies do at a state, from differences of poses alone, and what the judged forces then are.

    Attributes
    ----------
    M, h : (n, n), (n,)
        In velocities v: M v' + h = constraint forces, by Newton and Euler and virtual power.
    power : float
        Of all that is neither gravity nor a spring, wrench times twist (W).
    """

    def __init__(self, module: Any, made: Random, x: np.ndarray, forces: bool = True) -> None:
        q, v = x[: module.n_q], x[module.n_q :]
        N = basis(module, q)
        self.q_dot = N @ v
        self.bodies = bodies = judges.Bodies(module, q, self.q_dot)
        M, h = bodies.newton_euler(made.rigid)
        self.power = 0.0
        if forces:
            last = len(made.masses) - 1
            tip, tip_rate, tip_J = bodies.point(last, TIP)
            _, corner_rate, corner_J = bodies.point(0, CORNER)
            reach = tip - ANCHOR
            length = float(np.linalg.norm(reach))
            along = reach / length
            push, twist = bodies.R[0] @ PUSH, bodies.R[last // 2] @ TWIST
            drag = -DAMPING * float(along @ tip_rate) * along
            self.power = float(drag @ tip_rate + push @ corner_rate + twist @ bodies.w[last // 2])
            pull = drag - STIFFNESS * (length - FREE_LENGTH) * along
            h = h - (tip_J.T @ pull + corner_J.T @ push + bodies.J_w[last // 2].T @ twist)
        self.M, self.h = in_velocities(module, self.q_dot, N, v, M, h)


def energy_rate(module: Any, q_dot: np.ndarray, x: np.ndarray, a: np.ndarray) -> tuple[float, float]:
    """(T + V)' along a motion by differences of the energies, and the size of its parts."""
    n, v = module.n_q, x[module.n_q :]
    moving = np.concatenate([q_dot, np.zeros(len(v))])
    pushed = np.concatenate([np.zeros(n), a])
    speed = max(float(np.abs(v).max()), 1e-3)
    parts = [
        judges.first(module.energy, x, moving, size=max(1.0, np.abs(q_dot).max())).sum(),
        judges.first(module.energy, x, pushed, size=np.abs(a).max() / speed)[0],
    ]
    return sum(parts), max(map(abs, parts))


def states_of(module: Any, seed: int, count: int) -> list[np.ndarray]:
    """Random states: of a tree anywhere, of a loop near its declared position."""
    random, start = np.random.default_rng(seed), module.x0()
    if not module.n_c:
        return [module.project(random.uniform(-1, 1, module.n_x)) for _ in range(count)]
    sizes = np.repeat([0.05, 1.0], [module.n_q, module.n_v])
    start[module.n_q :] = 0.0
    return [module.project(start + sizes * random.uniform(-1, 1, module.n_x)) for _ in range(count)]
