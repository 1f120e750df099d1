"""Importers, the end: a Robot -> the Description that a model file would give."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.limits.numbers import FREEDOMS, LARGEST, LAWS, TIES
from ..base.value_rules import EXCESS, fault_of_inertia
from ..describe.description import GROUND_NAME, Description, Values
from ..describe.names import LONGEST, clean_name, fault_of_model_name, unique
from ..describe.placement import TURNS
from ..describe.scope import RATES
from ..errors import ModelError, Problem
from ..joints import JOINTS
from ..rotations import euler_angles_from_matrix, euler_parameters_from_matrix
from .robot import IDENTITY, Drive, Inertia, Placement, Range, Robot, RobotJoint, RobotOptions, Sum, Tie, numbers
from .robot_tree import GROUND, Bodies, RobotBody, build_bodies
from .xml_file import some_of

SHOWN = 8  #: joints that a note names
#: Stops of joints: part of the range that one gives way under the drive's effort; what is left of the speed after it.
GIVE, REBOUND = 0.01, 0.3
GRAVITY = 9.81  #: m/s^2, of the weight that stands for an effort that is not told
_PARAMETERS = ("_e0", "_e1", "_e2", "_e3")
_INERTIA = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2))


def describe_robot(robot: Robot, options: RobotOptions) -> Description:
    """The raw data of a robot.

    Raises
    ------
    ModelError
        The robot has faults.
    """
    return _Writer(robot, options, build_bodies(robot, options)).describe()


class _Names:
    """Names a model may use, of whatever a robot file calls its links and joints, and what became of each.

    Characters other than letters, digits and underscores become underscores; a name that does not start with a letter
    gets the prefix of its kind; words of Python, C and of expressions get an underscore after them; what is then not
    unique gets a number.  Bodies and joints have a list each; coordinates, parameters and inputs share one.
    """

    def __init__(self) -> None:
        self.taken = {"ground link"}  # names of bodies and of joints with their kind behind, and symbols
        self.renamed: dict[str, dict[str, str]] = {}  # section of the model -> old name -> new

    def link(self, name: str) -> str:
        """The name of a body or marker."""
        return self._note("bodies", name, self.made(name))

    def joint(self, name: str, suffixes: Sequence[str], made: bool = False) -> str:
        """The name of a joint whose coordinates are that name with these suffixes; ``made`` for one not in the file."""
        symbols = (suffix + rate for suffix in suffixes for rate in RATES)
        result = unique(name, "joint", self.taken, (" joint", *symbols))
        return result if made else self._note("joints", name, result)

    def symbol(self, name: str) -> str:
        """The name of a parameter or an input."""
        return self._note("inputs", name, unique(name, "symbol", self.taken))

    def made(self, name: str) -> str:
        """The name of an element that the file does not name, of which no note tells."""
        return unique(name, "link", self.taken, (" link",))

    def _note(self, section: str, name: str, result: str) -> str:
        if result != name:
            self.renamed.setdefault(section, {})[name] = result
        return result


class _Writer:
    """Fills one Description."""

    def __init__(self, robot: Robot, options: RobotOptions, found: Bodies) -> None:
        self.robot, self.options, self.found = robot, options, found
        gravity = robot.gravity if options.gravity is None else options.gravity
        name = clean_name(robot.name, "robot")[:LONGEST]
        name = f"{name[: LONGEST - 6]}_model" if fault_of_model_name(name) else name
        self.out = Description(values={"name": name, "gravity": gravity}, lines={"": (robot.file, 1)})
        self.out.notes = list(robot.notes)
        check = "note" if found.massless and options.check == "error" else options.check
        if check != "error":
            self.out.values["check_inertia"] = check
        if options.limits != "note":
            self.out.values["limits"] = "off"
        self.names = _Names()
        self.joints: dict[str, str] = {}  # the robot's name -> ours
        self.bodies: dict[str, str] = {}  # body -> ours
        self.markers: dict[str, str] = {}  # link -> how to refer to its frame
        self.tied = found.tied(robot)
        self.loads = found.loads()

    def describe(self) -> Description:
        moving = self.found.moving
        self._bound(sum(len(self._suffixes(joint.type)) for _, joint in moving))
        for _, joint in moving:
            suffixes = [*self._suffixes(joint.type), *self._rates(joint.type)]
            self.joints[joint.name] = self.names.joint(joint.name, suffixes)
        for body in self.found.bodies.values():
            self._body(body)
        for body, joint in moving:
            self._joint(body, joint)
        self._loops()
        self._ties()
        self._drives()
        self._note_data()
        self.out.note_renamed(self.names.renamed)
        return self.out

    def _bound(self, freedoms: int) -> None:
        """Refuse robots that no derivation comes to an end of."""
        robot, remedy = self.robot, "lock joints (lock=[...]), or leave parts out"
        for count, most, what in (
            (freedoms, FREEDOMS, "coordinates of joints"),
            (len(robot.loops), TIES, "joints that close loops"),
            (len(robot.ties), TIES, "couplings"),
            (len(robot.drives), TIES, "drives"),
        ):
            if count > most:
                message, place = f"has {count:,} {what}", (robot.file, 1)
                robot.problem("robot", message, f"at most {most:,}; {remedy}", place, "EG-TOO-LARGE")
        if robot.problems:
            raise ModelError(robot.problems)

    def _add(self, section: str, name: str, values: Values, place: tuple[str, int]) -> None:
        entry = self.out.add(section, name, values)
        self.out.lines[entry.path] = place

    # -- bodies ---------------------------------------------------------------------------------------------------
    def _body(self, body: RobotBody) -> None:
        name = GROUND_NAME if body.name == GROUND else self.names.link(body.name)
        self.bodies[body.name] = name
        values: Values = {} if body.name == GROUND else self._inertia(name, body.inertia())
        markers: dict[str, Any] = {}
        display: list[Values] = []
        for link, frame in body.members:
            if link.name == body.name:
                self.markers[link.name] = name
            else:
                marker = self.names.link(link.name)
                markers[marker] = {"at": [0, 0, 0], **frame.placed()}
                self.markers[link.name] = f"{name}.{marker}"
            display += [{**shape, **(frame @ at).placed()} for at, shape in link.shapes]
        if markers:
            values["markers"] = markers
        if display:
            values["display"] = display
        if values:
            place = body.members[0][0].place if body.members else (self.robot.file, 1)
            self._add("bodies", name, values, place)

    def _inertia(self, name: str, inertia: Inertia) -> Values:
        """mass, com and inertia: numbers, or parameters where they are not zero."""
        values: Values = {}
        if self.options.check_inertia is None and (fault_of_inertia(inertia.tensor) or ("", ""))[1] == EXCESS:
            values["check_inertia"] = "note"
        values |= {"mass": self._value(f"m_{name}", inertia.mass, "kg")}
        if inertia.com.any():
            com = zip("xyz", numbers(inertia.com), strict=True)
            values["com"] = [self._value(f"c_{name}_{axis}", x, "m") for axis, x in com]
        if inertia.tensor.any():
            entries = {key: float(inertia.tensor[i, j]) for key, i, j in _INERTIA if inertia.tensor[i, j] != 0.0}
            values["inertia"] = {k: self._value(f"I_{name}_{k}", x, "kg*m**2") for k, x in entries.items()}
        return values

    def _value(self, name: str, value: float, unit: str) -> Any:
        if not self.options.symbolic or value == 0.0:
            return float(value)
        given = self.names.symbol(name)
        self.out.add("parameters", given, {"value": float(value), "unit": unit})
        return given

    # -- joints ---------------------------------------------------------------------------------------------------
    def _turning(self, joint_type: str) -> Values:
        """The key ``rotation`` of a joint that turns in Euler parameters."""
        turns = self.options.rotation == "euler_parameters" and joint_type in ("free", "spherical")
        return {"rotation": "euler_parameters"} if turns else {}

    def _rates(self, joint_type: str) -> tuple[str, ...]:
        """Suffixes of the velocities of such a joint."""
        return ("_wx", "_wy", "_wz") if self._turning(joint_type) else ()

    def _suffixes(self, joint_type: str) -> list[str]:
        """Of the coordinates of a joint of the tree, as the options have them turn."""
        return [c.suffix for c in JOINTS[joint_type](**self._turning(joint_type)).coordinates]

    def _joint(self, body: RobotBody, joint: RobotJoint) -> None:
        name = self.joints[joint.name]
        home, frame = self.found.home[joint.parent] if joint.parent else (GROUND, IDENTITY)
        parent, child = self.bodies[home], self.bodies[body.name]
        between = [(frame @ joint.outer).reference(parent), joint.inner.reference(child)]
        names = [name + suffix for suffix in self._suffixes(joint.type)]
        single = len(names) == 1
        values: Values = {"type": joint.type, "between": between}
        if JOINTS[joint.type].has_axis:
            values["axis"] = _axis(joint.axis)
        values |= self._turning(joint.type)
        if self.robot.loops and names:  # named coordinates stay in the tree, so that the loop's own joint is cut
            values |= {"coordinate": names[0]} if single else {"coordinates": names}
        if joint.limits:
            values["limits"] = dict(joint.limits)
        if joint.dry_friction:
            values["dry_friction"] = joint.dry_friction
        if joint.armature and single:
            values["armature"] = joint.armature
        self._add("joints", name, values, joint.place)
        if joint.armature and not single:
            self._rotor(joint)
        if not single and (joint.damping or joint.stiffness):
            self._resist(joint, between, parent, child)
        rubbing = {"viscous": joint.damping} if joint.damping and single else {}
        if self.options.smoothing and joint.dry_friction:
            rubbing |= {"coulomb": joint.dry_friction, "smoothing": self.options.smoothing}
        if rubbing:
            self._force("friction", joint, "friction" if "coulomb" in rubbing else "damping", rubbing)
        if joint.stiffness and single:
            kind, key = ("torsional_spring", "angle") if joint.type == "revolute" else ("joint_spring", "rest")
            rest = {key: joint.rest} if joint.rest else {}
            self._force(kind, joint, "spring", {"stiffness": joint.stiffness, **rest})
        if self.options.limits == "stop" and single:
            self._stop(body, joint)
        if joint.initial or joint.start:
            start = [joint.initial] if joint.start is None else self._start(joint.start)
            reference = [float(n.endswith("_e0") and bool(self._turning(joint.type))) for n in names]
            # what an equality moves only starts its assembly: the file's pose may not satisfy it
            known = self.out.values.setdefault("guess" if joint.name in self.tied else "initial", {})
            known.update({n: x for n, x, rest in zip(names, start, reference, strict=True) if x != rest})
        chosen = self.options.actuate
        if single and (chosen is True or (chosen and joint.name in chosen)):
            force = self.names.symbol(f"tau_{name}")
            unit = "N" if joint.type == "prismatic" else "N*m"
            self._add("inputs", force, {"value": 0.0, "unit": unit}, joint.place)
            self._force("actuator", joint, "drive", {"value": force})

    def _stop(self, body: RobotBody, joint: RobotJoint) -> None:
        """Stops at the limits of a joint, which give way by a hundredth of its range under the drive's greatest effort.

        Where the file tells no effort, it is the weight that the joint carries, with the lever of what lies farthest.
        """
        limits = joint.limits
        # a finite limit beyond LARGEST gets no stop, as powers of its range overflow
        bounds = {key: x for key, x in limits.items() if key in ("lower", "upper") and abs(x) <= LARGEST}
        span = bounds.get("upper", math.inf) - bounds.get("lower", -math.inf)
        if not bounds:
            return
        if span <= 0.0:
            self.out.notes.append(f"{self.joints[joint.name]} gets no stops, because its limits leave it no range")
            return
        span = span if math.isfinite(span) else 1.0
        effort, speed = limits.get("effort", 0.0), limits.get("velocity", 0.0)
        if not 0.0 < effort < math.inf:
            effort = GRAVITY * self.loads[body.name].size(joint.type)
        law = {
            "stiffness": effort / (GIVE * span) ** 1.5,
            "restitution": REBOUND,
            "velocity": speed if 0.0 < speed < math.inf else span,
            "formula": "flores",
        }
        self._force("stop", joint, "stop", {**bounds, **law})

    def _rotor(self, joint: RobotJoint) -> None:
        """The armature of a ball joint: inertia without mass that turns in space as the child does on its parent."""
        name, suffixes, rates = self.joints[joint.name], self._suffixes(joint.type), self._rates(joint.type)
        body = self.names.made(f"{name}_rotor")
        rotor = self.names.joint(f"{name}_rotor", [*suffixes, *rates], made=True)
        turns = {"type": joint.type, "between": [GROUND_NAME, body], **self._turning(joint.type)}
        self._add("bodies", body, {"mass": 0, "inertia": [joint.armature] * 3}, joint.place)
        self._add("joints", rotor, turns, joint.place)
        for suffix in rates or suffixes:  # Euler parameters may take any value: their rates alone are tied
            law = {"type": "coupling", "equation": f"{rotor}{suffix} - {name}{suffix}"}
            self._add("constraints", self.names.made(f"{rotor}{suffix}"), law, joint.place)

    def _resist(self, joint: RobotJoint, between: list[Any], parent: str, child: str) -> None:
        """Damping and stiffness of a ball or a free joint, on its child and on a parent that moves."""
        name, d, k = self.joints[joint.name], joint.damping, joint.stiffness
        rest = joint.start or IDENTITY
        turn = _turn_texts(name, bool(self._turning(joint.type)), rest.rotation)
        for axis, place in zip("xyz" if joint.start else "", numbers(rest.position), strict=False):
            on = f"{name}_{axis}"
            for kind, factor, law in (("damper", d, {"damping": d}), ("spring", k, {"stiffness": k, "rest": place})):
                if factor:
                    values = {"type": f"joint_{kind}", "joint": on, **law}
                    self._add("forces", self.names.made(f"{on}_{kind}"), values, joint.place)
        for body, frame, sign in ((child, between[1], -1.0), (parent, between[0], 1.0)):
            # turned by the rotation about it, the rotation vector is itself: the same in the axes of both
            spring = [f"({sign * k!r})*{x}" for x in turn]
            damper = [f"({sign * d!r})*w{axis}({child}, from={parent}, in={body})" for axis in "xyz"]
            for factor, end, torque in ((k, frame, spring), (d, body, damper)):
                if factor and body != GROUND_NAME:
                    values = {"type": "torque", "body": end, "value": torque, "axes": "body"}
                    self._add("forces", self.names.made(f"{name}_resistance"), values, joint.place)

    def _start(self, pose: Placement) -> list[float]:
        """Coordinates of a free joint."""
        if self.options.rotation == "euler_parameters":
            turn = euler_parameters_from_matrix(pose.rotation)
        else:
            turn = euler_angles_from_matrix("xyz", pose.rotation)
        return [*numbers(pose.position), *numbers(turn)]

    def _force(self, kind: str, joint: RobotJoint, what: str, values: Values) -> None:
        name = self.joints[joint.name]
        self._add("forces", self.names.made(f"{name}_{what}"), {"type": kind, "joint": name, **values}, joint.place)

    # -- what ties joints together --------------------------------------------------------------------------------
    def _loops(self) -> None:
        for loop in self.robot.loops:
            if not self.found.around(loop):
                self.out.notes.append(f"left out: {loop.name}, because no joint moves its two links against each other")
                continue
            pair = []
            for link, frame in (loop.first, loop.second):
                body, at = self.found.home[link]
                pair.append((at @ frame).reference(self.bodies[body]))
            suffixes = [c.suffix for c in JOINTS[loop.type].coordinates]
            name = self.names.joint(loop.name, suffixes)
            axis = {"axis": _axis(loop.axis)} if JOINTS[loop.type].has_axis else {}
            self._add("joints", name, {"type": loop.type, "between": pair, **axis}, loop.place)

    def _ties(self) -> None:
        for tie in self.robot.ties:
            values = _describe_tie(tie, self.joints, self.options.lock)
            if values is None:
                self.out.notes.append(f"left out: the coupling {tie.name}, all of whose joints are locked")
            else:
                self._add("constraints", self.names.link(tie.name), values, tie.place)

    def _drives(self) -> None:
        laws = [self._law(k, drive) for k, drive in enumerate(self.robot.drives)]
        totals: dict[str, str] = {}  # of the drives along a tendon
        for drive, (_, law) in zip(self.robot.drives, laws, strict=True):
            if drive.total and law:
                totals[drive.tendon] = f"{totals[drive.tendon]} + {law}" if drive.tendon in totals else law
        size = 0  # of all laws
        cut: dict[str, list[str]] = {}  # pushes along joints whose sum is cut
        for drive, (name, law) in zip(self.robot.drives, laws, strict=True):
            if drive.total and law:
                law = _scaled(law, totals[drive.tendon], drive.total)
            if drive.force and law:
                law = _cut(law, drive.force)
            size += len(law) * len(drive.parts)
            if size > LAWS:
                message, remedy = "the laws of the drives are too long", f"at most {LAWS:,} characters in all"
                raise ModelError([Problem(f"actuator.{name}", message, remedy, *drive.place, "EG-TOO-LARGE")])
            for joint, c in drive.parts if law else ():
                q = self.joints.get(joint)
                if q is None or not c:
                    continue
                if drive.name and self.robot.joints[joint].clamp:
                    cut.setdefault(joint, []).append(f"({c!r})*({law})")
                    continue
                force = self.names.made(f"{name}_drive")
                self._add("forces", force, {"type": "actuator", "joint": q, "value": f"({c!r})*({law})"}, drive.place)
        for joint, pushes in cut.items():
            q, given = self.joints[joint], self.robot.joints[joint]
            assert given.clamp is not None
            law = _cut(" + ".join(pushes), given.clamp)
            force = self.names.made(f"{q}_drives")
            self._add("forces", force, {"type": "actuator", "joint": q, "value": law}, given.place)

    def _law(self, k: int, drive: Drive) -> tuple[str, str]:
        """Name of a drive and its force, empty if there is none."""
        length, fixed = _collect(Sum(drive.parts), self.joints, self.options.lock)
        b0, b1, b2 = drive.bias
        name, terms = f"tendon_{k}", [(b1 * c, q) for q, c in length.items()]
        terms += [(b2 * c, f"{q}_dot") for q, c in length.items()]
        if drive.name:
            name = self.names.symbol(drive.name)
            self._add("inputs", name, {"value": 0.0}, drive.place)
            terms.insert(0, (drive.gain, _cut(name, drive.control) if drive.control else name))
        constant = b0 + b1 * fixed
        return name, " + ".join([f"({x!r})*{what}" for x, what in terms if x] + [repr(constant)] * bool(constant))

    def _note_data(self) -> None:
        """Say of which joints limits and dry friction are data that do not act."""
        moving = [joint for _, joint in self.found.moving]
        limited = [self.joints[j.name] for j in moving if any(k != "effort" or j.clamp is None for k in j.limits)]
        if limited and self.options.limits == "note":
            remedy = "a run that passes a limit warns; limits='stop' adds elastic stops, limits='off' does not warn"
            self.out.notes.append(f"the limits of joints stop nothing ({some_of(limited, SHOWN)}); {remedy}")
        rubbing = [self.joints[j.name] for j in moving if j.dry_friction]
        if rubbing and not self.options.smoothing:
            remedy = "load with friction=0.01 to let it act"
            self.out.notes.append(f"the dry friction of joints does not act ({some_of(rubbing, SHOWN)}); {remedy}")


def _cut(law: str, bounds: Range) -> str:
    """A force or control cut to a range."""
    low, high = bounds
    law = f"max({law}, {low!r})" if low > -math.inf else law
    return f"min({law}, {high!r})" if high < math.inf else law


def _scaled(law: str, total: str, bounds: Range) -> str:
    """One of several forces, scaled as all are so that their total stays in a range."""
    low, high = bounds
    if law == total:
        return _cut(law, bounds)
    return f"({law})*where(({total}) > {high!r}, {high!r}/({total}), where(({total}) < {low!r}, {low!r}/({total}), 1))"


def _axis(axis: tuple[float, float, float]) -> Any:
    """A word for an axis along a coordinate axis, else its three numbers."""
    for word, columns in TURNS.items():
        if np.array_equal(columns[2], axis):
            return word
    return [float(x) for x in axis]


def _turn_texts(name: str, in_parameters: bool, rest: np.ndarray) -> list[str]:
    """The rotation vector from the pose at rest, in the axes of the child, of at most half a turn.

    MuJoCo resists turns of balls and free joints by -d w - k theta, with this vector theta and the angular velocity w.
    ``name`` begins its coordinates, Euler parameters or angles x-y'-z''; ``rest`` is the rotation (3, 3) at rest.
    """
    if in_parameters:
        raw = [name + suffix for suffix in _PARAMETERS]
        size = f"sqrt({' + '.join(f'{x}**2' for x in raw)})"  # 1, but for what an integrator makes of it
        e = [f"({x}/{size})" for x in raw]
    else:
        a, b, c = (f"{name}_{k}" for k in (1, 2, 3))
        (ca, cb, cc), (sa, sb, sc) = ([f"{f}({q}/2)" for q in (a, b, c)] for f in ("cos", "sin"))
        e = [
            f"({ca}*{cb}*{cc} - {sa}*{sb}*{sc})",
            f"({sa}*{cb}*{cc} + {ca}*{sb}*{sc})",
            f"({ca}*{sb}*{cc} - {sa}*{cb}*{sc})",
            f"({ca}*{cb}*{sc} + {sa}*{sb}*{cc})",
        ]
    r0, r1, r2, r3 = (float(x) for x in euler_parameters_from_matrix(rest))
    # the conjugate of the rest times e
    rows = ((r0, r1, r2, r3), (-r1, r0, r3, -r2), (-r2, -r3, r0, r1), (-r3, r2, -r1, r0))
    p = [_text(dict(zip(e, row, strict=True))) for row in rows]
    square = f"(1 - ({p[0]})**2)"  # sin(phi/2)^2; near 0 the series of phi / sin(phi/2)
    series = f"2 + {square}/3 + 3*{square}**2/20 + 5*{square}**3/56"
    exact = f"2*atan2(sqrt({square}), abs({p[0]}))/sqrt({square})"
    factor = f"where({p[0]} < 0, -1, 1)*where({square} < 1e-3, {series}, {exact})"
    return [f"({x})*{factor}" for x in p[1:]]


def _describe_tie(tie: Tie, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> dict[str, Any] | None:
    """The keys of a coupling, a linear one by its factors; None where no joint is left to tie.

    ``coordinates`` has those of joints that move, ``locked`` the values of the others.
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


def _collect(side: Sum, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Coordinate -> factor, and the constant with what locked joints add."""
    factors: dict[str, float] = {}
    constant = side.constant
    for joint, factor in side.parts:
        q = coordinates.get(joint)
        if q is None:
            constant += factor * locked.get(joint, 0.0)
        elif factor:
            factors[q] = factors.get(q, 0.0) + factor
    return factors, constant


def _text(factors: Mapping[str, float], constant: float = 0.0) -> str:
    """The sum of factors times terms, those of factor 0 left out, and a constant."""
    terms = [x if f == 1.0 else f"({f!r})*{x}" for x, f in factors.items() if f]
    return " + ".join(terms + [f"({constant!r})"] * bool(constant or not terms))
