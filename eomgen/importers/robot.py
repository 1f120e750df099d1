"""Importers, robots: the data between a robot file and a model, in numbers with their lines; options of a load."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypedDict

import numpy as np

from ..base.files import as_name
from ..base.limits.numbers import QUARTER
from ..base.value_rules import CHECKS, word_of_check
from ..elements.scalars import cosine_and_sine, matrix_from_roll_pitch_yaw, skew
from ..errors import Problem, ill_typed, no_choice, no_such
from ..expr.records import Record
from ..model.expressions import constant
from ..model.names import nearest
from .limits import LARGEST

Place = tuple[str, int]  # file, line
Numbers = np.ndarray | Sequence[float]
Range = tuple[float, float]  # lowest and highest value
Parts = tuple[tuple[str, float], ...]  # joints and their factors
#: Suffix of a file that another program converts -> how.
CONVERTED = {
    ".sdf": "convert it to MJCF first: sdf2mjcf FILE.sdf FILE.xml (pip install sdformat-mjcf); it leaves out joints "
    "that close loops: add them as <equality> of the MJCF file, or write the robot as URDF with <loop_joint>",
    ".xacro": "expand it first: xacro FILE.xacro > FILE.urdf",
}
#: Options that take one of some words.
PHRASES = {
    "mimic": ("coupling", "independent"),
    "rotation": ("euler_angles", "euler_parameters"),
    "limits": ("note", "stop", "off"),
}


class RobotKeywords(TypedDict, total=False):
    """Fields of :class:`RobotOptions`, which calls pass on, besides ``check_inertia``."""

    floating: bool
    rotation: str
    gravity: Any
    mimic: str
    lock: Any
    merge: bool
    symbolic: bool
    actuate: Any
    friction: Any
    snap: float
    assets: str | None
    limits: str


class LoadOptions(RobotKeywords, total=False):
    """What :func:`eomgen.load` takes."""

    allow_native: bool
    check_inertia: bool | str | None


# -- options -----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class RobotOptions:
    """Options for loading a robot file, of ``eomgen.load`` and of the command line.

    Attributes
    ----------
    floating : bool
        The root link moves freely (a joint ``base`` of type free) instead of standing on the ground.
    rotation : str
        How free and ball joints turn: ``euler_angles`` or ``euler_parameters``.
    gravity : three numbers, optional
        In ground axes (m/s^2); (0, 0, -9.81) for URDF, the file's own for MJCF.
    mimic : {'coupling', 'independent'}
        Whether a joint that mimics another is tied to it by a constraint, or keeps a coordinate of its own.
    lock : names, or mapping of names to values
        Joints held at a value (0 unless given): they become welds.
    merge : bool
        Whether links that are welded together become one body, with their frames as its markers; otherwise each link is
        a body.
    symbolic : bool
        Whether masses, centres of mass and inertias become parameters; otherwise they stay numbers, which gives shorter
        code.
    actuate : bool or names
        Inputs ``tau_<joint>`` on all joints of one degree, or on these.
    friction : bool or float
        Whether the dry friction of joints acts, smoothed below this velocity (rad/s or m/s; True: 0.01); otherwise it
        does not act.
    snap : float
        Angles that differ by less than this (rad) from a multiple of pi/2 are rounded to that multiple.
    check_inertia : {'error', 'note', 'off'} or bool
        What happens to masses and inertias that no body can have, and to joints that move no mass: they are refused,
        noted, or accepted silently.  By default principal moments of which one exceeds the sum of the others are noted,
        and other impossible inertias are refused.  A robot without any mass is loaded for kinematics, with a note.
    limits : {'note', 'stop', 'off'}
        What limits of joints do: a run that passes one warns, elastic stops act there, or nothing happens.
    assets : str, optional
        Folder that holds an MJCF file and the files that it names; its own folder by default.
    """

    floating: bool = False
    rotation: str = "euler_angles"
    gravity: Any = None
    mimic: str = "coupling"
    lock: Any = ()
    merge: bool = True
    symbolic: bool = False
    actuate: Any = False
    friction: Any = False
    snap: float = 1e-11
    assets: str | None = None
    check_inertia: Any = None
    limits: str = "note"

    @property
    def check(self) -> str:
        """What becomes of inertias that no body can have, but for excess moments: error, note or off."""
        return self.check_inertia or "error"

    @property
    def smoothing(self) -> float:
        """The velocity below which dry friction is smoothed; 0 where it does not act."""
        return 0.01 if self.friction is True else float(self.friction)


def make_options(raw: dict[str, Any]) -> RobotOptions:
    """Checked options; ``lock`` as a mapping, ``actuate`` as a tuple unless it is True or False."""
    known = [field.name for field in fields(RobotOptions)]
    for key in raw:
        if key not in known:
            raise no_such(f"no option {key!r} for a robot file; {nearest(key, known, 'options')}")
    options = RobotOptions(**raw)
    for key, allowed in PHRASES.items():
        if not isinstance(word := getattr(options, key), str) or word not in allowed:
            raise no_choice(f"{key} must be one of {', '.join(allowed)}, not {word!r}")
    check, friction = options.check_inertia, options.friction
    word = None if check is None else word_of_check(check)
    if word is None and check is not None:
        raise no_choice(f"check_inertia must be one of {', '.join(CHECKS)}, True, False, not {check!r}")
    if not isinstance(friction, bool | int | float) or not 0 <= friction < math.inf:
        rule = "True, or the velocity (rad/s or m/s) below which it is smoothed"
        raise ill_typed(f"friction must be {rule}, not {friction!r}")
    for key in ("floating", "merge", "symbolic"):
        if not isinstance(getattr(options, key), bool | np.bool_):
            raise ill_typed(f"{key} must be True or False, not {getattr(options, key)!r}")
    actuate, lock = options.actuate, options.lock
    if not isinstance(actuate, bool | np.bool_):
        actuate = _names(actuate, "actuate", "True")
    if not isinstance(lock, Mapping):
        lock = dict.fromkeys(_names(lock, "lock", "a mapping of names to values"), 0.0)
    lock = {name: constant(x, f"lock of {name}") if isinstance(x, str) else x for name, x in lock.items()}
    for name, value in lock.items():
        if not _is_number(value):
            message = f"the value must be a finite number (rad or m), at most {LARGEST:g}"
            raise ill_typed(f"lock={{{name!r}: {value!r}}}: {message}")
    if not _is_number(options.snap) or options.snap < 0.0:
        raise ill_typed(f"snap must be an angle (rad), 0 or positive, not {options.snap!r}")
    if options.assets is not None:
        as_name("assets", options.assets)
    locked = {str(name): float(value) for name, value in lock.items()}
    return replace(options, check_inertia=word, actuate=actuate, lock=locked)


def _is_number(value: Any) -> bool:
    """Whether a value is a finite number that the reader's products stay finite with."""
    size: Any = abs(value) if isinstance(value, int | float | np.integer | np.floating) else math.inf
    return bool(size <= LARGEST)


def _names(raw: Any, key: str, also: str) -> tuple[str, ...]:
    """Names of joints, one or several."""
    raw = [raw] if isinstance(raw, str) else raw
    names = tuple(raw) if isinstance(raw, Iterable) and not isinstance(raw, Mapping) else (None,)
    if not all(isinstance(name, str) for name in names):
        raise ill_typed(f"{key} must be names of joints, or {also}, not {raw!r}")
    return names


# -- frames and inertias -----------------------------------------------------------------------------------------------
class Placement(Record):
    """A frame in another: ``rotation`` (3, 3) takes its axes to the other's, ``position`` (3,) is in those (m)."""

    rotation: np.ndarray
    position: np.ndarray

    def __matmul__(self, inner: Placement) -> Placement:
        """A frame in this one, seen from outside."""
        return Placement(self.rotation @ inner.rotation, self.position + self.rotation @ inner.position)

    def inverse(self) -> Placement:
        """The outer frame in this one."""
        return Placement(self.rotation.T, -(self.rotation.T @ self.position))

    def reference(self, body: str) -> str | dict[str, object]:
        """This frame in a body, as a model file writes a marker."""
        placed = self.placed()
        return {"body": body, **placed} if placed else body

    def placed(self) -> dict[str, object]:
        """``at`` and ``rpy``, what is zero left out."""
        result: dict[str, object] = {}
        if self.position.any():
            result["at"] = numbers(self.position)
        if not np.array_equal(self.rotation, np.eye(3)):
            result["rpy"] = numbers(_roll_pitch_yaw(self.rotation))
        return result


def _roll_pitch_yaw(R: np.ndarray) -> list[float]:
    """Fixed-axis angles of a rotation matrix, good to rounding at any pitch.

    The yaw is read first and the roll from what it leaves, so that an uncertain yaw near pitch = +-pi/2 does no harm
    (the order of Eigen's Euler angles).
    """
    horizontal = math.hypot(R[0, 0], R[1, 0])
    yaw = math.atan2(R[1, 0], R[0, 0]) if horizontal > 0 else 0.0
    c, s = cosine_and_sine(yaw)
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return [roll, math.atan2(-R[2, 0], horizontal), yaw]


IDENTITY = Placement(np.eye(3), np.zeros(3))


def numbers(values: Numbers) -> list[float]:
    """Plain floats; minus zero becomes zero."""
    return [float(x) + 0.0 for x in values]


def moved(position: Numbers) -> Placement:
    """A frame that is moved only."""
    return Placement(np.eye(3), np.array(position, dtype=float))


def turned(axis: Numbers, angle: float) -> Placement:
    """A frame that is turned only, by an angle about a unit axis (Rodrigues' formula)."""
    K: np.ndarray = np.array(skew(numbers(axis)))
    c, s = cosine_and_sine(angle)
    return Placement(np.eye(3) + s * K + (1 - c) * (K @ K), np.zeros(3))


def by_quaternion(position: Numbers, quaternion: Numbers) -> Placement:
    """A frame at a position, turned by a quaternion of any length, whose scalar comes first."""
    w, x, y, z = quaternion
    s = 2.0 / (w * w + x * x + y * y + z * z)
    matrix = np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )
    nearest = np.round(matrix)
    return Placement(nearest if np.abs(matrix - nearest).max() < QUARTER else matrix, np.array(position, dtype=float))


def placed(position: Numbers, rpy: Numbers, snap: float) -> Placement:
    """A frame at a position, turned about fixed axes by roll, pitch and yaw.

    Angles within ``snap`` (rad) of a multiple of pi/2 are taken as that multiple, whose cosine and sine are exact.
    """
    return Placement(np.array(matrix_from_roll_pitch_yaw(rpy, snap), dtype=float), np.array(position, dtype=float))


class Inertia(Record):
    """Mass (kg), centre of mass (m) and inertia about it (kg m^2) in some frame."""

    mass: float
    com: np.ndarray
    tensor: np.ndarray

    def seen(self, frame: Placement) -> Inertia:
        """The same from outside ``frame``."""
        R = frame.rotation
        if np.array_equal(R, np.eye(3)):
            return Inertia(self.mass, self.com + frame.position, self.tensor)
        tensor = R @ self.tensor @ R.T
        return Inertia(self.mass, frame.position + R @ self.com, (tensor + tensor.T) / 2)

    @property
    def is_nothing(self) -> bool:
        """Neither mass nor inertia."""
        return self.mass == 0.0 and not self.tensor.any()


NOTHING = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))


def sum_inertias(parts: Sequence[Inertia]) -> Inertia:
    """Rigid bodies welded together; all in the same frame (Steiner's theorem)."""
    parts = [part for part in parts if not part.is_nothing]
    if len(parts) <= 1:
        return parts[0] if parts else NOTHING
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass if mass else parts[0].com
    tensor = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        tensor += part.tensor + part.mass * ((d @ d) * np.eye(3) - np.outer(d, d))
    return Inertia(mass, com, tensor)


# -- links, joints, loops and drives -----------------------------------------------------------------------------------
class RobotLink(Record):
    """A link: its inertia in its own frame, and shapes to draw as (placement, data)."""

    name: str
    place: Place
    inertia: Inertia = NOTHING
    shapes: tuple[tuple[Placement, dict[str, Any]], ...] = ()


class RobotJoint(Record):
    """A joint of the tree; ``outer`` is its frame on the parent, ``inner`` on the child.

    ``type`` is a word of eomgen's; the coordinate's law (damping, spring, drive's inertia) is that of a joint of one
    degree.
    """

    name: str
    type: str
    parent: str
    child: str
    place: Place
    outer: Placement = IDENTITY
    inner: Placement = IDENTITY
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    limits: Mapping[str, float] = field(default_factory=dict)
    damping: float = 0.0
    dry_friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    initial: float = 0.0
    start: Placement | None = None  #: of a free joint
    clamp: Range | None = None  #: range of what all drives together do along it


class Sum(Record):
    """``constant`` + the sum of factors times joint coordinates."""

    parts: Parts
    constant: float = 0.0


class Tie(Record):
    """``left`` = a0 + a1 ``right`` + a2 ``right``^2 + ..., the a_k in ``law``; ``path`` is its place in the file."""

    name: str
    left: Sum
    right: Sum
    law: tuple[float, ...]
    place: Place
    path: str = ""


class Loop(Record):
    """A joint that closes a loop; it has no coordinate of interest.  ``axis`` is the same in both frames."""

    name: str
    type: str
    first: tuple[str, Placement]  #: link and frame in it
    second: tuple[str, Placement]
    place: Place
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)


class Drive(Record):
    """A drive along L = sum c_j q_j: the force f = gain u + b0 + b1 L + b2 L' pushes c_j f along q_j.

    ``parts`` holds joints and their c_j; without a name there is no input u.  ``control`` and ``force`` are the ranges
    to which u and f are cut; ``tendon`` is the name of the tendon whose drives have a total force in ``total``: beyond
    it each is scaled by the same factor, before ``force`` cuts it.
    """

    name: str
    parts: tuple[tuple[str, float], ...]
    gain: float
    bias: tuple[float, float, float]
    place: Place
    control: Range | None = None
    force: Range | None = None
    tendon: str = ""
    total: Range | None = None


@dataclass
class Robot:
    """A robot as its file describes it; ``problems`` are its faults, ``notes`` what was left out."""

    name: str
    file: str
    links: dict[str, RobotLink] = field(default_factory=dict)
    joints: dict[str, RobotJoint] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    ties: list[Tie] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def problem(self, path: str, message: str, remedy: str, place: Place, code: str) -> None:
        """Note a fault."""
        self.problems.append(Problem(path, message, remedy, *place, code))
