"""Robots, the data between a robot file and a model: links, joints, loops and drives in numbers, with their lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from ..errors import Problem
from ..records import dataclass
from .robot_frames import IDENTITY, NOTHING, Inertia, Placement

Place = tuple[str, int]  # file, line
Range = tuple[float, float]  # lowest and highest value
#: Suffix of a file that another program converts -> how.
CONVERTED = {
    ".sdf": "convert it to MJCF first: sdf2mjcf FILE.sdf FILE.xml (pip install sdformat-mjcf); it leaves out joints "
    "that close loops: add them as <equality> of the MJCF file, or write the robot as URDF with <loop_joint>",
    ".xacro": "expand it first: xacro FILE.xacro > FILE.urdf",
}


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
        Folder within which an MJCF file may read other files; its own folder by default.
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

    @property
    def locked(self) -> dict[str, float]:
        """Names of locked joints and their values."""
        if isinstance(self.lock, Mapping):
            return {str(name): float(value) for name, value in self.lock.items()}
        return dict.fromkeys([self.lock] if isinstance(self.lock, str) else map(str, self.lock), 0.0)


@dataclass(frozen=True)
class Mimic:
    """q = factor q(joint) + offset."""

    joint: str
    factor: float
    offset: float


@dataclass(frozen=True)
class RobotLink:
    """A link: its inertia in its own frame, and shapes to draw as (placement, data)."""

    name: str
    place: Place
    inertia: Inertia = NOTHING
    shapes: tuple[tuple[Placement, dict[str, Any]], ...] = ()


@dataclass(frozen=True)
class RobotJoint:
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
    mimic: Mimic | None = None
    initial: float = 0.0
    start: Placement | None = None  #: of a free joint
    clamp: Range | None = None  #: range of what all drives together do along it


Parts = tuple[tuple[str, float], ...]  # joints and their factors


@dataclass(frozen=True)
class Sum:
    """``constant`` + the sum of factors times joint coordinates."""

    parts: Parts
    constant: float = 0.0


@dataclass(frozen=True)
class Tie:
    """``left`` = a0 + a1 ``right`` + a2 ``right``^2 + ..., the a_k in ``law``."""

    name: str
    left: Sum
    right: Sum
    law: tuple[float, ...]
    place: Place


@dataclass(frozen=True)
class Loop:
    """A joint that closes a loop; it has no coordinate of interest.  ``axis`` is the same in both frames."""

    name: str
    type: str
    first: tuple[str, Placement]  #: link and frame in it
    second: tuple[str, Placement]
    place: Place
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Drive:
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
    root: str = ""
    links: dict[str, RobotLink] = field(default_factory=dict)
    joints: dict[str, RobotJoint] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    ties: list[Tie] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def problem(self, path: str, message: str, remedy: str, place: Place, code: str = "") -> None:
        """Note a fault."""
        self.problems.append(Problem(path, message, remedy, *place, code))


def describe_tie(tie: Tie, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> dict[str, Any] | None:
    """The keys of a coupling, a linear one by its factors; None where no joint is left to tie.

    Parameters
    ----------
    tie : Tie
    coordinates : mapping
        Joint -> coordinate, of joints that move.
    locked : mapping
        Joint -> value at which it is held.
    """
    (left, y), (right, x) = (_collect(s, coordinates, locked) for s in (tie.left, tie.right))
    _, slope, *higher = (*tie.law, 0.0, 0.0)
    if not any(higher) or not right:
        value = 0.0
        for a in reversed(tie.law):
            value = a + x * value
        factors = dict(left)
        for q, c in right.items():
            factors[q] = factors.get(q, 0.0) - slope * c
        factors = {q: c for q, c in factors.items() if c}
        if not factors:
            return None
        offset = value - y
        return {"type": "coupling", "coordinates": factors} | ({"offset": offset} if offset else {})
    inner, text = _text(right, x), ""
    for a in reversed(tie.law):
        text = f"({a!r})" + (f" + ({inner})*({text})" if text else "")
    return {"type": "coupling", "equation": f"{_text(left, y)} - ({text})"}


def _collect(given: Sum, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Coordinate -> factor, and the constant with what locked joints add."""
    factors: dict[str, float] = {}
    constant = given.constant
    for joint, factor in given.parts:
        q = coordinates.get(joint)
        if q is None:
            constant += factor * locked.get(joint, 0.0)
        elif factor:
            factors[q] = factors.get(q, 0.0) + factor
    return factors, constant


def _text(factors: Mapping[str, float], constant: float) -> str:
    terms = [q if c == 1.0 else f"({c!r})*{q}" for q, c in factors.items()]
    return " + ".join(terms + [f"({constant!r})"] * bool(constant or not terms))
