"""Random mechanisms with mixed joints, planar and spatial, with loops, and the same numbers for judges from outside."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import judges
import numpy as np
import rotations
from hypothesis import reject
from hypothesis import strategies as st
from scipy.optimize import least_squares
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


def coordinates_of(kind: str, name: str, rotation: str) -> list[str]:
    """Names of the coordinates of a joint of a type that can be in a tree, unless it is given others."""
    suffixes = SUFFIXES.get(kind, ())
    if kind in ("spherical", "free") and rotation == "euler_parameters":
        suffixes = (*suffixes[:-3], "_e0", "_e1", "_e2", "_e3")
    return [name + suffix for suffix in suffixes]


def options_of(kind: str, name: str, rotation: str = "euler_angles", L: float = 1.0) -> dict[str, Any]:
    """Keys of a joint of a type, which exercise all of its terms."""
    if kind in ("spherical", "free"):
        found: dict[str, Any] = {"rotation": rotation}
    else:
        found = {}
    if kind == "screw":
        found["pitch"] = L * PITCH
    if kind in ("distance", "revolute_spherical"):
        found["length"] = L * LENGTH
    if "curve" in kind:
        s = name if kind == "curve_slider" else f"{name}_s"
        found["curve"] = [f"{L!r}*({x.format(s=_in_metres(s, L))})" for x in CURVE]
    if "surface" in kind:
        u, v = (_in_metres(f"{name}_{k}", L) for k in "uv")
        found["surface"] = [f"{L!r}*({x.format(u=u, v=v)})" for x in SURFACE]
    return found


def _in_metres(name: str, L: float) -> str:
    return f"({name}/{L!r})"


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


# -- judges ------------------------------------------------------------------------------------------------------------
def basis(module: Any, q: np.ndarray) -> np.ndarray:
    """N of q' = N v, from outside."""
    names = {"q_names": module.q_names, "v_names": module.v_names}
    return np.array([rotations.coordinate_rates(names, q, e) for e in np.eye(module.n_v)]).T


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


# -- any mechanism, by Hypothesis --------------------------------------------------------------------------------------
ANY, TURN = (Rotation.from_rotvec(v).as_matrix() for v in ([0.4, -0.7, 0.5], [0, 0, 0.6]))
#: Joints that close a chain -> the degrees of freedom they allow (Shabana, Computational Dynamics, sec. 3.2 and 7.7;
#: ADAMS for the primitives), and a pose that they allow by their definitions: S in axes of P.
CLOSING: dict[str, tuple[int, np.ndarray, Any]] = {
    "revolute": (1, TURN, (0, 0, 0)),
    "continuous": (1, TURN, (0, 0, 0)),
    "prismatic": (1, np.eye(3), (0, 0, 0.4)),
    "screw": (1, TURN, (0, 0, PITCH * 0.6 / (2 * np.pi))),
    "cylindrical": (2, TURN, (0, 0, 0.4)),
    "universal": (2, Rotation.from_euler("XY", [0.3, 0.5]).as_matrix(), (0, 0, 0)),
    "constant_velocity": (2, Rotation.from_rotvec([0.3, 0.5, 0]).as_matrix(), (0, 0, 0)),
    "spherical": (3, ANY, (0, 0, 0)),
    "planar": (3, TURN, (0.3, -0.5, 0)),
    "translational": (3, np.eye(3), (0.3, -0.5, 0.2)),
    "weld": (0, np.eye(3), (0, 0, 0)),
    "distance": (5, ANY, (0.6 * LENGTH, 0.48 * LENGTH, 0.64 * LENGTH)),
    "revolute_spherical": (4, ANY, (0.6 * LENGTH, -0.8 * LENGTH, 0)),
    "inline": (4, ANY, (0, 0, 0.7)),
    "inplane": (5, ANY, (0.3, -0.5, 0)),
    "parallel": (4, TURN, (0.3, -0.5, 0.2)),
    "perpendicular": (5, Rotation.from_euler("xz", [np.pi / 2, 0.7]).as_matrix(), (0.3, -0.5, 0.2)),
    "orientation": (3, np.eye(3), (0.3, -0.5, 0.2)),
}
#: Of those with coordinates, which can be anywhere in a loop, what they allow.
ALLOWED = {kind: allowed for kind, (allowed, *_) in [*CLOSING.items()][:10]}
LENGTHS = ("prismatic", "curve_slider")
SINGLE = ("revolute", "continuous", "prismatic", "screw", "curve_slider")
FORCES = (
    *("spring", "damper", "push", "twist", "motors", "joint_spring", "joint_damper", "armature", "state", "event"),
    *("stop", "contact"),
)
CONSTRAINTS = ("driver", "coupling", "velocities", "knife_edge", "switched", "open", "rolling")
#: A sphere about TIP of the last body on a plane of the first one; a ball about TIP that rolls on ground; a stop.
FLOOR = Rotation.from_rotvec([0.5, -0.3, 0.2]).as_matrix()
SPHERE, DEPTH, CONTACT = 5.0, np.array([0.0, 0.0, -2.0]), {"stiffness": 4.0, "dissipation": 0.3, "friction": 0.4}
SLIDING, BALL, STOP = 0.5, 0.4, {"stiffness": 6.0, "dissipation": 0.2}
TIME, INPUT, STATE = 0.1, 0.7, 0.3
#: Joint -> ending of a coordinate -> its axis in the first marker, and whether it is a length.
AXES = {
    **{kind: {"": (2, kind == "prismatic")} for kind in ("revolute", "continuous", "prismatic", "screw")},
    "cylindrical": {"_z": (2, True), "_3": (2, False)},
    "planar": {"_x": (0, True), "_y": (1, True), "_3": (2, False)},
    "translational": {"_x": (0, True), "_y": (1, True), "_z": (2, True)},
}


@dataclass(frozen=True)
class Recipe:
    """Of what a mechanism is made; its numbers follow from the seed.

    Attributes
    ----------
    kinds, parents, turned : tuples
        By body: the type of its joint, the body (-1: ground) this leads to, and whether its ends are exchanged.
    last : int
        The body that a joint of the type ``closing`` holds to ground, behind a chain of all bodies before it.
    cut : int
        The joint of the loop without names of its coordinates, which is cut: ``last + 1`` is the closing one.
    doubled : bool
        The joint that closes is there twice, on one axis.
    away : bool
        The joint that closes is in its pose of ``CLOSING``, in place of that where its markers agree.
    """

    seed: int
    kinds: tuple[str, ...]
    parents: tuple[int, ...]
    turned: tuple[bool, ...]
    rotation: str
    last: int
    planar: bool = False
    closing: str = ""
    cut: int = 0
    doubled: bool = False
    away: bool = False
    forces: tuple[str, ...] = ()
    constraints: tuple[str, ...] = ()

    @property
    def single(self) -> list[str]:
        """Names of joints of one coordinate, each of which has that name."""
        cut = self.cut if self.closing and self.cut <= self.last else -1
        return [f"q{k}" for k, kind in enumerate(self.kinds) if kind in SINGLE and k != cut]


@dataclass(frozen=True)
class Clothes:
    """How a mechanism is described: each flag is a change that leaves the motion of its bodies as it is."""

    frames: bool = False  #: body frames turned and shifted
    units: bool = False  #: millimetres and grams
    names: bool = False  #: other names, in another order
    cut: bool = False  #: another joint of the loop is cut
    rotation: bool = False  #: Euler parameters for Euler angles, and back
    late: bool = False  #: masses, stiffness and gravity are given to each call


@dataclass(frozen=True)
class Numbers:
    """What the seed of a recipe gives."""

    outer: list[Placement]
    inner: list[Placement]
    masses: np.ndarray
    centers: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray
    values: np.ndarray
    frames: list[Placement]
    start: dict[str, float]
    hold: Placement  #: of the joint that closes, on the last body
    pose: np.ndarray  #: of the last body where the loop is made


class Made:
    """A recipe written down as a model, in given clothes, and what is known of it.

    Attributes
    ----------
    L, K : float
        Units of length and mass per metre and kilogram; F and T those of a force and a torque.
    p : dict
        Values of parameters for each call.
    """

    def __init__(self, recipe: Recipe, clothes: Clothes = Clothes(), numbers: Numbers | None = None) -> None:
        self.recipe, self.clothes = recipe, clothes
        self.numbers = numbers or numbers_of(recipe)
        self.L, self.K = (1e3, 1e3) if clothes.units else (1.0, 1.0)
        self.F, self.T = self.K * self.L, self.K * self.L**2
        self.p: dict[str, float] = {}
        self.model = m = eg.Model(f"random_{recipe.seed}")
        m.gravity = tuple(self.late(f"g{k}", self.L * g) for k, g in enumerate(self.numbers.gravity))
        self.bodies: dict[int, Any] = {-1: m.ground}
        for k in self.order(range(len(recipe.kinds))):
            A, center = self.frame(k).rotation, self.numbers.centers[k] - self.frame(k).position
            self.bodies[k] = m.body(
                self.name(f"b{k}"),
                mass=self.late(f"mass{k}", self.K * self.numbers.masses[k]),
                com=(self.L * A.T @ center).tolist(),
                inertia=(self.T * A.T @ self.numbers.inertias[k] @ A).tolist(),
            )
        self.joints: dict[str, tuple[str, int, Placement, int, Placement]] = {}  #: type, body and marker of P and of S
        self.motors: dict[str, float] = {}  #: by name of a joint of one coordinate or of a coordinate
        whole = numbers is None
        for k in self.order(range(len(recipe.kinds))):
            ends = [(recipe.parents[k], self.numbers.outer[k]), (k, self.numbers.inner[k])]
            named = not (recipe.closing and whole) or k != self.cut or k > recipe.last
            self.join(f"q{k}", recipe.kinds[k], *ends[:: -1 if recipe.turned[k] else 1], named)
        if recipe.closing and whole:
            for name in ("close", "close2")[: 1 + recipe.doubled]:
                inner = self.numbers.hold
                if name == "close2":  # further along the axis
                    inner = replace(inner, position=inner.position + 0.2 * inner.rotation[:, 2])
                R, r = self.numbers.pose[:3, :3], self.numbers.pose[:3, 3]
                _, turn, moved = CLOSING[recipe.closing if recipe.away else "weld"]
                P = R @ inner.rotation @ turn.T
                outer = Placement(P, r + R @ inner.position - P @ moved)
                self.join(name, recipe.closing, (-1, outer), (recipe.last, inner),
                          name == "close" and self.cut <= recipe.last)  # fmt: skip
        if whole and self.numbers.start:
            cut = self.cut if recipe.closing and self.cut <= recipe.last else -1
            lost = set(coordinates_of(self.kind(cut), f"q{cut}", recipe.rotation) if cut >= 0 else ())
            m.guess(**self.coordinates({name: q for name, q in self.numbers.start.items() if name not in lost}))
        if whole:
            self.loads()
            self.conditions()

    def name(self, text: str) -> str:
        return f"w{text}" if self.clothes.names else text

    def order(self, things: Iterable[Any]) -> list[Any]:
        return [*things][:: -1 if self.clothes.names else 1]

    def late(self, name: str, value: float) -> Any:
        """A number, or a parameter with another value that is given to each call."""
        if not self.clothes.late or not value:
            return float(value)
        self.p[self.name(name)] = float(value)
        return self.model.parameter(self.name(name), 1.7 * float(value))

    @property
    def rotation(self) -> str:
        names = ("euler_angles", "euler_parameters")
        return names[(names.index(self.recipe.rotation) + self.clothes.rotation) % 2]

    @property
    def cut(self) -> int:
        """The joint of the loop that is cut, by having no names of coordinates."""
        able = [k for k in range(self.recipe.last + 1) if self.recipe.kinds[k] in ALLOWED]
        able += [self.recipe.last + 1] if self.recipe.closing not in ("", "weld") else []
        return able[(able.index(self.recipe.cut) + self.clothes.cut) % len(able)]

    @property
    def loop(self) -> list[str]:
        """Names of the joints from ground to the one that closes; of a tree too, without that one."""
        return [*(self.name(f"q{k}") for k in range(self.recipe.last + 1)), self.name("close")]

    def kind(self, k: int) -> str:
        """The type of a joint of the loop."""
        return (*self.recipe.kinds[: self.recipe.last + 1], self.recipe.closing)[k]

    def frame(self, k: int) -> Placement:
        """Of body k as it is described, in the body as it was made; ground stays."""
        if k < 0 or not self.clothes.frames:
            return Placement(np.eye(3), np.zeros(3))
        return self.numbers.frames[k]

    def at(self, k: int, position: Any, rotation: Any = None) -> Any:
        """A marker on body k, -1 for ground, given in the body as it was made."""
        A = self.frame(k)
        turn = A.rotation.T @ (A.rotation if rotation is None else rotation)
        return Placement(turn, self.L * A.rotation.T @ (np.asarray(position) - A.position)).on(self.bodies[k])

    def join(self, name: str, kind: str, P: tuple[int, Placement], S: tuple[int, Placement], named: bool) -> None:
        keys = options_of(kind, self.name(name), self.rotation, self.L)
        names = coordinates_of(kind, self.name(name), self.rotation)
        if named and names:
            keys |= {"coordinates": names} if len(names) > 1 else {"coordinate": names[0]}
        if name in self.recipe.single and "armature" in self.recipe.forces and self.recipe.closing != kind:
            keys["armature"] = 0.3 * (self.K if kind in LENGTHS else self.T)
        ends = [self.at(body, placed.position, placed.rotation) for body, placed in (P, S)]
        self.model.joint(kind, self.name(name), *ends, **keys)
        self.joints[name] = (kind, *P, *S)

    def coordinates(self, values: Mapping[str, float]) -> dict[str, float]:
        """Coordinates by their names in plain clothes -> by those of these clothes."""
        found: dict[str, float] = {}
        for name, value in values.items():
            joint, _, last = name.partition("_")
            k = int(joint[1:]) if joint[1:].isdigit() else -1
            if ((k >= 0 and self.recipe.kinds[k]) or self.recipe.closing) in ("spherical", "free") and last in (
                "1", "2", "3", "e0", "e1", "e2", "e3",
            ):  # fmt: skip
                if last in ("1", "e0"):
                    found |= self._turned(joint, values)
            else:
                found[self.name(name)] = value
        lengths = {self.name(f"q{k}") for k, kind in enumerate(self.recipe.kinds) if kind in LENGTHS}
        ends = ("_x", "_y", "_z", "_s", "_u", "_v")
        return {
            name: value * (self.L if name in lengths or name.endswith(ends) else 1) for name, value in found.items()
        }

    def _turned(self, joint: str, values: Mapping[str, float]) -> dict[str, float]:
        if self.recipe.rotation == "euler_angles":
            R = Rotation.from_euler("XYZ", [values[f"{joint}_{k}"] for k in "123"])
        else:
            R = Rotation.from_quat([values[f"{joint}_e{k}"] for k in (1, 2, 3, 0)])
        if self.rotation == "euler_angles":
            return dict(zip([self.name(f"{joint}_{k}") for k in "123"], R.as_euler("XYZ"), strict=True))
        return dict(zip([self.name(f"{joint}_e{k}") for k in (1, 2, 3, 0)], R.as_quat(), strict=True))

    def loads(self) -> None:
        """Force elements; those on bodies are the ones that ``Judge`` knows."""
        m, recipe, values = self.model, self.recipe, self.numbers.values
        F, T, L, last = self.F, self.T, self.L, recipe.last
        anchor, tip = self.at(-1, ANCHOR), self.at(last, TIP)
        u = m.input(self.name("u"), INPUT)
        if "state" in recipe.forces:
            z = m.state(self.name("z"), f"1 - 2*{self.name('z')} + sin(t)", STATE)
            m.force(self.name("feed"), self.at(0, TIP), (F * z, 0, 2 * F * z))
        single = [(name, self.name(name), L if self.joints[name][0] in LENGTHS else 1.0) for name in recipe.single]
        for kind in self.order(kind for kind in FORCES if kind in recipe.forces):
            if kind == "spring":
                stiffness = self.late("k", STIFFNESS * F / L)
                m.spring(self.name("s"), anchor, tip, stiffness=stiffness, length=L * FREE_LENGTH)
            elif kind == "damper":
                m.damper(self.name("d"), anchor, tip, damping=DAMPING * F / L)
            elif kind == "push":
                m.force(self.name("p"), self.at(0, CORNER, np.eye(3)), tuple((F * PUSH).tolist()), axes="body")
            elif kind == "twist":
                twist = tuple((T * TWIST).tolist())
                m.torque(self.name("t"), self.at(last // 2, CORNER, np.eye(3)), twist, axes="body")
            elif kind == "joint_spring":
                for _, own, l in single:
                    m.joint_spring(f"js{own}", own, stiffness=3.0 * T / l**2, rest=0.2 * l)
            elif kind == "joint_damper":
                for _, own, l in single:
                    m.joint_damper(f"jd{own}", own, damping=0.4 * T / l**2)
            elif kind == "event" and single:
                m.event(self.name("passes"), single[0][1])
            elif kind == "stop":
                for _, own, l in single:
                    stiffness, dissipation = STOP["stiffness"] * T / l**2.5, STOP["dissipation"] / l
                    m.stop(f"st{own}", own, stiffness=stiffness, lower=-20.0 * l, upper=0.0, dissipation=dissipation)
            elif kind == "contact":
                law = {"stiffness": CONTACT["stiffness"] * F / L**1.5, "dissipation": CONTACT["dissipation"] / L}
                law |= {"radius": SPHERE * L, "friction": CONTACT["friction"], "smoothing": SLIDING * L}
                m.sphere_plane(self.name("contact"), self.at(self.floor, DEPTH, FLOOR), tip, **law)
            elif kind == "motors":
                for name in self.order(self.driven()):
                    kind_of = self.joints[name.partition("_")[0]][0]
                    length = kind_of in LENGTHS or name.endswith(("_x", "_y", "_z", "_s", "_u", "_v"))
                    value = float(values[sum(map(ord, name)) % 30])
                    m.actuator(f"m{self.name(name)}", self.name(name), (T / L if length else T) * value * (u + 1.0))
                    self.motors[name] = value * (INPUT + 1.0)

    @property
    def floor(self) -> int:
        """The body of the plane that a sphere touches: ground where there is but one."""
        return 0 if self.recipe.last else -1

    def driven(self) -> list[str]:
        """Each coordinate, of cut joints too where their motions are along fixed axes of the first marker."""
        found = []
        for name, (kind, *_) in self.joints.items():
            k = self.recipe.last + 1 if name == "close" else int(name[1:]) if name != "close2" else -2
            if name == "close2" or kind in ("spherical", "free"):
                continue
            if kind in SINGLE:
                found.append(name)
            elif not (self.recipe.closing and k <= self.recipe.last + (name == "close")) or kind in AXES:
                found += coordinates_of(kind, name, "euler_angles")
        return found

    def conditions(self) -> None:
        """Constraint elements."""
        m, recipe, start = self.model, self.recipe, self.numbers.start
        names = recipe.single
        size = {name: self.L if self.joints[name][0] in LENGTHS else 1.0 for name in names}
        for kind in self.order(recipe.constraints):
            if kind == "driver":
                value = f"{start.get(names[0], 0.1)!r} + 0.3*sin(2*t)"
                m.driver(self.name("driver"), coordinate=self.name(names[0]), value=f"{size[names[0]]!r}*({value})")
            elif kind == "coupling":
                a, b = names[-1], names[-2]
                offset = start.get(a, 0.0) - 0.5 * start.get(b, 0.0)
                m.coupling(
                    self.name("coupling"), {self.name(a): 1 / size[a], self.name(b): -0.5 / size[b]}, offset=offset
                )
            elif kind == "velocities":
                a, b = names[-1], names[-2]
                A, B = self.name(a), self.name(b)
                text = f"{A}_dot/{size[a]!r} - (1 + ({B}/{size[b]!r})**2)*{B}_dot/{size[b]!r}"
                m.coupling(self.name("velocities"), equation=text)
            elif kind == "knife_edge":
                m.knife_edge(self.name("knife_edge"), self.at(recipe.last, TIP, np.eye(3)))
            elif kind == "rolling":
                r = self.numbers.pose[:3, 3] + self.numbers.pose[:3, :3] @ TIP - BALL * FLOOR[:, 2]
                wheel, plane = self.at(recipe.last, TIP), self.at(-1, r, FLOOR)
                m.rolling(self.name("rolling"), wheel, plane, radius=BALL * self.L, shape="sphere")
            elif kind in ("switched", "open"):
                A = self.name(names[-1])
                m.coupling(self.name("switched"), equation=f"{A}_dot/{size[names[-1]]!r}", closed=kind == "switched",
                           closes=f"{A} - 90", opens=f"{A} + 90")  # fmt: skip
                m.output(self.name("held"), f"multiplier({self.name('switched')})")

    # -- its module
    def compile(self, method: str = "embedding", **options: Any) -> Any:
        return self.model.compile(method, **{"target": "numpy", **options})

    def call(self, kernel: Any, *where: Any, **keys: Any) -> Any:
        return kernel(*where, **keys, **({"p": self.p} if self.p else {}))

    def state(self, module: Any, which: int = 0) -> np.ndarray:
        """On the constraints at ``TIME``: of a tree anywhere, else near the place where the mechanism was made."""
        random, n, v = np.random.default_rng([self.recipe.seed, 5, which]), module.n_q, module.n_v
        x = module.x0()
        x[:n] += (0.05 if self.numbers.start else 0.6) * random.uniform(-1, 1, n)
        x[n : n + v] = random.uniform(-1, 1, v)
        try:
            return np.asarray(module.project(x, t=TIME))
        except eg.ProjectionError:
            if "driver" not in self.recipe.constraints or self.reaches(module):
                raise
            reject()

    def reaches(self, module: Any) -> bool:
        """Whether SciPy, from anywhere, brings the loop where its driver is at ``TIME``."""
        random, tight = np.random.default_rng(self.recipe.seed), dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
        starts = random.uniform(-np.pi, np.pi, (50, module.n_q))
        gaps = (least_squares(lambda q: module.constraints(q, t=TIME), q, **tight).fun for q in starts)
        return any(np.abs(gap).max() <= 1e-9 for gap in gaps)

    def places(self, module: Any) -> tuple[np.ndarray, np.ndarray]:
        """Turns and places of the bodies where a run starts, as the bodies were made, in SI units."""
        names = module.metadata["body_names"]
        poses = module.poses(module.x0()[: module.n_q])[[names.index(self.name(f"b{k}")) for k in range(len(names))]]
        frames = [self.frame(k) for k in range(len(names))]
        R = np.array([pose[:3, :3] @ A.rotation.T for pose, A in zip(poses, frames, strict=True)])
        r = poses[:, :3, 3] / self.L
        return R, r - np.array([turn @ A.position for turn, A in zip(R, frames, strict=True)])

    def motion(self, module: Any, x: np.ndarray, moves: bool = True) -> SimpleNamespace:
        """Of all bodies, by differences of poses along the module's rhs, as the bodies were made, in SI units.

        A state that is not on the constraints does not move: it has no accelerations.
        """
        n, v_n = module.n_q, module.n_v
        kinds = (module.metadata[key] for key in ("coordinate_kinds", "velocity_kinds"))
        q_size, v_size = (np.array([self.L if kind == "length" else 1.0 for kind in many]) for many in kinds)
        v_size = v_size[:v_n]

        def poses(columns: np.ndarray, t: float) -> np.ndarray:
            here = np.array(module.poses((columns.T * q_size).T, t=t))
            here[:, :3, 3] /= self.L
            return here

        q, v = x[:n] / q_size, x[n : n + v_n] / v_size
        a = self.call(module.rhs, TIME, x)[n : n + v_n] / v_size if moves else np.zeros(v_n)
        N = basis(module, q)
        q_dot = N @ v
        found = judges.Bodies(SimpleNamespace(poses=poses), q, q_dot, TIME)
        names = {"q_names": module.q_names, "v_names": module.v_names}
        bent = rotations.coordinate_rates(names, q_dot, v)
        bent[[name[-3:-1] != "_e" for name in module.q_names]] = 0.0
        q_ddot = N @ a + bent
        order = [module.metadata["body_names"].index(self.name(f"b{k}")) for k in range(len(self.recipe.kinds))]
        kept = SimpleNamespace(q=q, v=v, a=a, q_dot=q_dot, v_size=v_size, J_w=found.J_w[order] @ N, w=found.w[order])
        kept.w_dot = found.w_dot[order] + found.J_w[order] @ q_ddot
        frames = [self.frame(k) for k in range(len(order))]
        kept.R = np.array([R @ A.rotation.T for R, A in zip(found.R[order], frames, strict=True)])
        arms = -np.array([R @ A.position for R, A in zip(kept.R, frames, strict=True)])
        kept.r = found.r[order] + arms
        kept.r_dot = found.v[order] + np.cross(kept.w, arms)
        kept.J_r = found.J_r[order] @ N + np.cross(kept.J_w, arms[:, :, None], axis=1)
        kept.r_ddot = found.r_ddot[order] + found.J_r[order] @ q_ddot
        kept.r_ddot += np.cross(kept.w_dot, arms) + np.cross(kept.w, np.cross(kept.w, arms))
        return kept


@cache
def numbers_of(recipe: Recipe) -> Numbers:
    """The numbers; the place of the joint that closes, or of a plane to roll on, follows from a tree without it."""
    held = recipe.closing or "rolling" in recipe.constraints
    recipe = replace(recipe, forces=(), constraints=())
    random, bodies, planar = np.random.default_rng(recipe.seed), len(recipe.kinds), recipe.planar
    flat = np.array([1, 1, 0 if planar else 1])
    inertias = [_inertia(random) for _ in range(bodies)]
    numbers = Numbers(
        outer=[_placement(random, planar, kind) for kind in recipe.kinds],
        inner=[_placement(random, planar, kind) for kind in recipe.kinds],
        masses=random.uniform(0.5, 2.0, bodies),
        centers=random.uniform(-0.4, 0.4, (bodies, 3)) * flat,
        inertias=np.array([np.diag(np.diag(i)) if planar else i for i in inertias]),
        gravity=np.array([0.3, -9.81, 0.7]) * flat,
        values=random.uniform(0.5, 1.5, 40),
        frames=[_placement(random, False, "") for _ in range(bodies)],
        start={},
        hold=_placement(random, planar, recipe.closing),
        pose=np.eye(4),
    )
    if not held:
        return numbers
    bare = Made(recipe, numbers=numbers).compile(kernels=["poses"])
    q = random.uniform(0.2, 0.7, bare.n_q)
    for k in (k for k, name in enumerate(bare.q_names) if name.endswith("_e0")):
        q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
    start = dict(zip(bare.q_names, q.tolist(), strict=True))
    return replace(numbers, start=start, pose=bare.poses(q)[recipe.last])


def random_recipe(seed: int, kinds: Sequence[str], rotation: str = "euler_angles", **more: Any) -> Recipe:
    """Bodies on joints of these types in any order, on ground or any earlier body; in a chain if a joint closes it."""
    random, bodies = np.random.default_rng([seed, 7]), len(kinds)
    kinds = tuple(random.permutation(kinds).tolist())
    apart = random.random(bodies) < (0.0 if more.get("closing") else 0.5)
    parents = tuple(int(random.integers(-1, k)) if apart[k] and k else k - 1 for k in range(bodies))
    turned = tuple((random.random(bodies) < 0.5).tolist())
    return Recipe(seed, kinds, parents, rotation=rotation, **{"turned": turned, "last": bodies - 1, **more})


@st.composite
def mechanisms(draw: Callable[..., Any]) -> Recipe:
    """Trees and loops, planar and in space, of all joints, cuts, forces, states, rotations and constraints."""
    closing, planar = draw(st.sampled_from([("", False), ("space", False), ("plane", True)]))
    count = draw(st.integers(1, 4))
    if planar:
        kinds = draw(st.lists(st.sampled_from(("revolute", "prismatic", "planar")), min_size=count, max_size=count))
        closing = draw(st.sampled_from(("revolute", "prismatic")))
        needed = 3
    elif closing:
        kinds = draw(st.lists(st.sampled_from(tuple(ALLOWED)), min_size=count, max_size=count))
        closing = draw(st.sampled_from((*ALLOWED, "weld")))
        needed = 7 - ALLOWED.get(closing, 0)
    else:
        kinds = draw(st.lists(st.sampled_from(SPATIAL), min_size=count, max_size=count))
        needed = 1
    freedom = sum(len(SUFFIXES[kind]) for kind in kinds) - needed
    while freedom < 0:
        kinds.append("revolute" if planar else "universal" if freedom > -3 else "spherical")
        freedom += len(SUFFIXES[kinds[-1]])
    last = len(kinds) - 1
    parents = [k - 1 for k in range(last + 1)]
    if not closing:
        parents = [draw(st.integers(-1, k - 1)) for k in range(last + 1)]
    elif draw(st.booleans()):  # a body that hangs on the loop
        kinds.append("revolute")
        parents.append(draw(st.integers(0, last)))
        freedom += 1
    turned = draw(st.lists(st.booleans(), min_size=len(kinds), max_size=len(kinds)))
    able = [k for k in range(last + 1) if kinds[k] in ALLOWED] + [last + 1] * (closing in ALLOWED)
    cut = draw(st.sampled_from(able)) if closing else 0
    seed, rotation = draw(st.integers(0, 2**31)), draw(st.sampled_from(("euler_angles", "euler_parameters")))
    forces = draw(st.lists(st.sampled_from(FORCES), unique=True, max_size=len(FORCES)))
    doubled = planar and closing == "revolute" and cut <= last and draw(st.booleans())
    recipe = Recipe(
        seed, (*kinds,), (*parents,), (*turned,), rotation, last, planar, closing, cut, doubled,
        forces=tuple(sorted(forces)),
    )  # fmt: skip
    if freedom < 1:
        return recipe
    way, k = 0, last  # what the last body can do
    while k >= 0:
        way, k = way + len(SUFFIXES[kinds[k]]), parents[k]
    if not closing and way > 4 and draw(st.booleans()):
        return replace(recipe, constraints=("rolling",))
    singles, able = len(recipe.single), [""]  # none of which may contradict another
    able += ["switched", "open"] * (singles > 0) + ["coupling", "velocities"] * (singles > 1)
    found = [draw(st.sampled_from(able))]
    if singles > (found[0] in ("switched", "open")) and freedom > 1:
        found.append(draw(st.sampled_from(("", "driver"))))
    if not planar and closing != "weld" and freedom > 2:
        found.append(draw(st.sampled_from(("", "knife_edge"))))
    return replace(recipe, constraints=tuple(filter(None, found)))
