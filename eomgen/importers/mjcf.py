"""Importers, MJCF: a file, compiled by MuJoCo -> a Robot.

MuJoCo's own compiler (package mujoco) resolves includes, defaults, orientations and the inertia of geoms; what it makes
is read: bodies, their joints in order (several joints of a body become links without mass between them), springs,
dampers, inertias of drives, equality constraints, and actuators on joints and fixed tendons.
"""

from __future__ import annotations

import os
import re
import signal
from dataclasses import replace
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..elements.kinds import limits_nothing
from ..errors import MissingDependencyError, ModelError, Problem, at_odds
from .limits import ELEMENTS, IMPEDANCE, LARGEST, MEMORY, SECONDS, SIZE, WAIT
from .mujoco_process import compile_model
from .robot import (
    IDENTITY,
    NOTHING,
    Drive,
    Inertia,
    Loop,
    Parts,
    Place,
    Placement,
    Robot,
    RobotJoint,
    RobotLink,
    RobotOptions,
    Sum,
    Tie,
    by_quaternion,
    moved,
    numbers,
    turned,
)
from .xml_file import DATA, HARMLESS, LEFT, SEEN, TAKEN, Constructs, XmlElement, read_xml

# -- what becomes of elements and attributes ---------------------------------------------------------------------------
_REASONS = {
    "taken": (TAKEN, "as MuJoCo's compiler has it"),
    "drive": (TAKEN, "drives that push along joints and fixed tendons by a linear law; a note names the others"),
    "limits": (DATA, "limits; a note names the joints (option `limits`)"),
    "friction": (DATA, "dry friction; it acts with the option `friction`, else a note names the joints"),
    "contact": (SEEN, "contact, where shapes can touch"),
    "medium": (SEEN, "forces of a medium"),
    "parts": (SEEN, "parts of springs, dampers, tendons and gravity compensation without a counterpart"),
    "soft": (SEEN, "deformable bodies"),
    "mocap": (SEEN, "bodies moved by motion capture, which stand still"),
    "plugin": (LEFT, "plugins"),
    "states": (LEFT, "stored states"),
    "asleep": (SEEN, "bodies at rest that MuJoCo lets sleep, which move here"),
    "yield": (SEEN, "softness of constraints, which hold exactly here; a note names those that hardly hold in MuJoCo"),
    "solver": (HARMLESS, "numerics of MuJoCo's solver, softness of limits and friction"),
    "looks": (HARMLESS, "what it looks like"),
    "measure": (HARMLESS, "sensors"),
    "user": (HARMLESS, "sizes of memory, data of users"),
}
_DRIVES = "general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor plugin"
_TIES = "equality/connect, equality/weld, equality/joint, equality/tendon"

#: Element of a default -> what it is a default of.
_DEFAULTS = {
    **dict.fromkeys(("mesh", "texture", "material", "skin"), "asset"),
    **dict.fromkeys(("joint", "geom", "site", "camera", "light"), "body"),
    "pair": "contact",
    **dict.fromkeys(_DRIVES.split(), "actuator"),
}


def _path_of(parent: str, tag: str) -> str:
    """Under its parent's tag; in ``default`` as what it is a default of; worldbody, frame and replicate are bodies."""
    parent = parent.rpartition("/")[2]
    if parent == "default" and tag in ("tendon", "equality"):
        return "tendon/spatial" if tag == "tendon" else "equality/connect"
    if not parent or tag == "mujoco":  # the second of a model that is attached
        return tag
    if parent == "default" and tag != "default":
        parent = _DEFAULTS.get(tag, parent)
    if parent in ("worldbody", "frame", "replicate"):
        parent = "body"
    return f"{'mujoco' if parent == 'mujocoinclude' or tag == 'include' else parent}/{tag}"


MJCF = Constructs(
    f"""
    mujoco, mujocoinclude: taken model
    mujoco/compiler, asset/mesh, asset/model, body/frame, body/replicate, body/attach, body/inertial: taken *
    mujoco/include, body/freejoint, body/site: taken *
    compiler/lengthrange: solver **
    mujoco/option: taken gravity actuatorgroupdisable
    mujoco/option: medium density viscosity wind
    mujoco/option: measure magnetic
    mujoco/option: solver ccd_iterations ccd_tolerance cone impratio integrator iterations jacobian ls_iterations
    mujoco/option: solver ls_tolerance noslip_iterations noslip_tolerance o_friction o_margin o_solimp o_solref
    mujoco/option: solver sdf_initpoints sdf_iterations solver timestep tolerance collision apirate
    mujoco/option: solver mpr_iterations mpr_tolerance
    mujoco/option: asleep sleep_tolerance
    option/flag: taken actuation clampctrl constraint damper equality frictionloss gravity limit spring passive
    option/flag: contact contact filterparent
    option/flag: solver autoreset diagexact energy eulerdamp fwdinv invdiscrete ipc island midphase multiccd nativeccd
    option/flag: solver override refsafe sensor speculative warmstart
    option/flag: asleep sleep
    mujoco/size: user **
    mujoco/statistic, mujoco/visual: looks **
    mujoco/default, default/default, mujoco/worldbody, mujoco/asset, mujoco/tendon, mujoco/equality: taken
    mujoco/actuator, mujoco/contact: taken
    mujoco/extension, body/plugin, geom/plugin, mesh/plugin, flexcomp/plugin: plugin **
    asset/hfield: contact **
    asset/skin, asset/texture, asset/material, body/camera, body/light: looks **
    body/body: taken axisangle euler fuse pos quat xyaxes zaxis
    body/body: parts gravcomp
    body/body: mocap mocap
    body/body: solver simple
    body/body: asleep sleep
    body/composite: taken **
    body/joint: taken actuatorfrclimited actuatorfrcrange armature axis damping pos ref springdamper springref stiffness
    body/joint: taken type
    body/joint: limits range limited
    body/joint: friction frictionloss
    body/joint: parts springyield actuatorgravcomp
    body/joint: solver margin solimpfriction solimplimit solreffriction solreflimit solreflimit
    body/geom: taken axisangle density euler fitscale fromto hfield mass mesh pos quat shellinertia size type
    body/geom: taken xyaxes zaxis
    body/geom: contact adhesion conaffinity condim contype friction gap margin priority solimp solmix solref surfacevel
    body/geom: medium fluidcoef fluidshape
    body/geom: looks castshadow material rgba
    body/flexcomp, mujoco/deformable: soft **
    contact/pair, contact/exclude: contact **
    tendon/spatial, tendon/fixed: taken stiffness damping armature springlength actuatorfrclimited actuatorfrcrange
    tendon/spatial, tendon/fixed: parts frictionloss limited range springyield
    tendon/spatial, tendon/fixed: solver margin solimpfriction solimplimit solreffriction solreflimit
    tendon/spatial, tendon/fixed: looks material rgba width
    spatial/site, spatial/geom, spatial/pulley: parts **
    fixed/joint: taken coef joint
    {_TIES}: taken active anchor body1 body2 joint1 joint2 polycoef relpose site1 site2 tendon1 tendon2 torquescale
    equality/flex, equality/flexstrain: soft active cell flex torquescale
    {_TIES}, equality/flex, equality/flexstrain: yield solimp solref
    {", ".join(f"actuator/{tag}" for tag in _DRIVES.split())}: drive *
    plugin/config: plugin **
    mujoco/sensor: measure **
    mujoco/custom: user **
    mujoco/keyframe: states **
    """,
    _REASONS,
    _path_of,
    {"name": "taken", "class": "taken", "childclass": "taken", "user": "user", "group": "user"},
)

#: Field -> the flag that switches it off, and what a note calls it; noted where a number of it is not zero.
NOTED = {
    "jnt_stiffnesspoly": ("SPRING", "the parts of springs of joints that are not linear"),
    "jnt_springyield": ("SPRING", "the yielding of springs of joints"),
    "dof_dampingpoly": ("DAMPER", "the parts of dampers of joints that are not linear"),
    "tendon_stiffnesspoly": ("SPRING", "the parts of springs along tendons that are not linear"),
    "tendon_springyield": ("SPRING", "the yielding of springs along tendons"),
    "tendon_dampingpoly": ("DAMPER", "the parts of dampers along tendons that are not linear"),
    "tendon_frictionloss": ("FRICTIONLOSS", "the dry friction along tendons"),
    "tendon_limited": ("LIMIT", "the limits of the lengths of tendons"),
    "actuator_dampingpoly": ("DAMPER", "the parts of dampers of actuators that are not linear"),
    "actuator_delay": ("ACTUATION", "the delays of actuators"),
}
#: Fields that are read, whose numbers must be no larger than LARGEST; ranges may be infinite.
FINITE = (
    "opt_gravity body_mass body_inertia body_ipos body_iquat body_pos body_quat jnt_pos jnt_axis jnt_stiffness qpos0 "
    "qpos_spring dof_armature dof_damping dof_frictionloss site_pos site_quat eq_data wrap_prm tendon_stiffness "
    "tendon_damping tendon_armature tendon_lengthspring tendon_length0 actuator_gear actuator_gainprm actuator_biasprm "
    "actuator_damping actuator_armature"
)
SLOWEST = 1.0  #: rad/s: an equality that comes back to its place more slowly hardly holds in MuJoCo
_MISSING = "MJCF files need mujoco: pip install 'eomgen[robots]'"
_SLEEP = 1 << 4  # mjtEnableBit
_TYPES = ("free", "spherical", "prismatic", "revolute")  # mjtJoint
_CONNECT, _WELD, _JOINT_TIE, _TENDON_TIE = 0, 1, 2, 3  # mjtEq
_BODY, _SITE = 1, 6  # mjtObj
_JOINT, _JOINT_IN_PARENT, _TENDON = 0, 1, 3  # mjtTrn
_FIXED_GAIN, _AFFINE_BIAS, _NO_BIAS = 0, 1, 0  # mjtGain, mjtBias
_WRAP_JOINT = 1  # mjtWrap


def read_mjcf(root: XmlElement, options: RobotOptions) -> Robot:
    """The robot of an MJCF file.

    Raises ModelError where MuJoCo refuses the file, crashes on it, or needs too much time or memory, with the line
    where it says one; MissingDependencyError.
    """
    if options.floating:
        raise at_odds(f"{root.file}: an MJCF file itself defines which bodies float; leave floating out")
    if find_spec("mujoco") is None:
        raise MissingDependencyError(_MISSING)
    path = os.path.realpath(root.file)
    folder = os.path.dirname(path) if options.assets is None else os.path.realpath(options.assets)
    if not path.startswith(os.path.join(folder, "")):
        message = f"{root.file} lies outside the folder {options.assets} of its assets"
        raise ModelError([root.problem("assets", message, "name a folder that holds the model", "EG-FILE")])
    _join_files(root, folder)
    answer, arrays = compile_model(path, folder, MEMORY, SECONDS, WAIT)
    if "missing" in answer:
        raise MissingDependencyError(f"{_MISSING} ({answer['missing']})")
    if "names" not in answer:
        raise ModelError([_refusal(answer, root, folder)])
    values = {key: value if value.ndim else value.item() for key, value in arrays.items()}
    robot = _MjcfReader(answer, SimpleNamespace(**values), root).read()
    robot.notes += MJCF.notes(root)
    robot.notes[:0] = [f"MuJoCo warns: {' '.join(text.split())}" for text in answer["warnings"]]
    return robot


def _join_files(root: XmlElement, folder: str) -> None:
    """Put what a model includes and attaches into its tree, for lines and notes; MuJoCo refuses what is wrong of it.

    All files together are bounded as one is, but for the last.
    """
    home, known, left = os.path.dirname(os.path.realpath(root.file)), {os.path.realpath(root.file)}, ELEMENTS
    waiting = [root]
    while waiting:
        element = waiting.pop()
        children = []
        for child in element.children:
            inner = None
            for base in (home, os.path.dirname(child.file)) if child.tag.lower() in ("include", "model") else ():
                path = os.path.realpath(os.path.join(base, child.attributes.get("file", "").replace("\\", "/")))
                inside = path.startswith(os.path.join(folder, "")) and path not in known
                if inner is None and left > 0 and inside and os.path.isfile(path):
                    known.add(path)
                    inner = read_xml(path)
                    left -= max(sum(1 for _ in inner.walk()), os.path.getsize(path) * ELEMENTS // SIZE)
            if inner is not None and child.tag == "model":
                child.children, inner = [inner], None
            children += [child] if inner is None else inner.children
        element.children = children
        waiting += children


def _refusal(answer: dict[str, Any], root: XmlElement, folder: str) -> Problem:
    """Why the process has no model."""
    code, smaller = answer.get("code", 0), "use fewer bodies, and meshes with fewer triangles"
    if "refused" in answer:
        refusal = " ".join(answer["refused"].split()).replace("line 0", "of a file that it includes")
        remedy, kind = "", "EG-FILE-DAMAGED"
        if re.search("opening file|empty file|is empty", refusal, re.I):  # what may not be opened is empty
            remedy, kind = f"it must lie in {folder}; a folder that holds all files: assets=..., or --assets", "EG-FILE"
        elif "already included" in refusal:
            remedy, kind = "include each file once", "EG-CIRCLE"
        return _blame(refusal, root).problem("mujoco", f"MuJoCo refuses it: {refusal}", remedy, kind)
    if "memory" in answer:
        message = f"MuJoCo needs more memory for it than the {MEMORY / 1e9:g} GB it may have"
        return root.problem("mujoco", message, smaller, "EG-TOO-LARGE")
    if code is None or code in (-getattr(signal, name, 0) for name in ("SIGXCPU", "SIGKILL")):
        message = f"MuJoCo needs more time for it than the {SECONDS} s ({WAIT} s beside other work) it may have"
        return root.problem("mujoco", message, smaller, "EG-TOO-LARGE")
    message = f"crashes on it ({signal.Signals(-code).name})" if code < 0 else f"ends without a model (exit {code})"
    remedy = "leave out parts until it loads, to find the cause"
    return root.problem("mujoco", f"MuJoCo {message}", remedy, "EG-FILE-DAMAGED")


def _blame(refusal: str, root: XmlElement) -> XmlElement:
    """The element that a message of MuJoCo is about, by its name or tag, line and file; the root if that is in doubt.

    MuJoCo tells the lines of the model's own file, and line 0 of what it includes.
    """

    def word(pattern: str) -> str:
        return match[1] if (match := re.search(pattern, refusal, re.I)) else ""

    name, tag, file = word(r"Element name '([^']+)'"), word(r"Element '([^']+)'"), word(r"file '([^']+)'")
    line = int(word(r"line (\d+)") or 0)

    def fits(element: XmlElement) -> bool:
        raw = element.attributes
        if line:  # of the model's own file, or of one that it attaches
            return element.line == line and tag in ("", element.tag)
        if name or tag:
            return raw.get("name") == name if name else element.file != root.file and element.tag == tag
        return bool(file) and _last(file) == _last(raw.get("file", ""))

    likely = sorted(filter(fits, root.walk()), key=lambda element: element.file != root.file)
    return likely[0] if likely and (line or len(likely) == 1) else root


def _last(path: str) -> str:
    return re.split(r"[/\\]", path)[-1]


class _MjcfReader:
    """Reads the arrays ``m`` of a compiled model into a Robot."""

    def __init__(self, answer: dict[str, Any], m: Any, root: XmlElement) -> None:
        self.m, self.root, self.flags = m, root, answer["flags"]
        self.names = {
            kind: [name or f"{kind}{k}" for k, name in enumerate(names)] for kind, names in answer["names"].items()
        }
        self.lines: dict[tuple[str, str], Place] = {}
        for element in root.walk():
            self.lines.setdefault((element.tag, element.attributes.get("name", "")), (element.file, element.line))
        self.robot = Robot(root.attributes.get("model") or "robot", root.file)

    def read(self) -> Robot:
        m, robot = self.m, self.robot
        for key in FINITE.split():
            if not (np.abs(getattr(m, key, 0.0)) <= LARGEST).all():
                message = f"numbers of {key} come out too large or not finite"
                remedy = f"at most {LARGEST:g}, so that products stay finite"
                robot.problems.append(self.root.problem("mujoco", message, remedy, "EG-RANGE"))
        if robot.problems:
            raise ModelError(robot.problems)
        gravity = np.zeros(3) if self.off("GRAVITY") else m.opt_gravity
        robot.gravity = tuple(numbers(gravity))  # type: ignore[assignment]
        world = self.names["body"][0]
        robot.links[world] = RobotLink(world, (self.root.file, self.root.line))
        for k in range(1, m.nbody):
            self._body(k)
        for k in range(m.neq):
            self._equality(k)
        self._actuators()
        self._tendons()
        self._note_the_rest()
        return robot

    def off(self, *flags: str) -> bool:
        """Whether the file disables one of these parts of the physics, by the words of mjtDisableBit."""
        passive = ("PASSIVE",) if "SPRING" in flags or "DAMPER" in flags else ()  # both in one, before MuJoCo 3.4
        return any(self.m.opt_disableflags & self.flags.get(flag, 0) for flag in (*flags, *passive))

    def place(self, name: str, *tags: str) -> Place:
        """Where an element of a name is; the model's first line if it has none."""
        result = (self.lines[tag, name] for tag in tags if (tag, name) in self.lines)
        return next(result, (self.root.file, self.root.line))

    # -- bodies and joints ----------------------------------------------------------------------------------------
    def _body(self, k: int) -> None:
        m, robot = self.m, self.robot
        name, parent = self.names["body"][k], self.names["body"][m.body_parentid[k]]
        place = self.place(name, "body")
        principal = Inertia(float(m.body_mass[k]), np.zeros(3), np.diag(m.body_inertia[k]))
        inertia = principal.seen(by_quaternion(m.body_ipos[k], m.body_iquat[k]))
        at = by_quaternion(m.body_pos[k], m.body_quat[k])
        joints = range(m.body_jntadr[k], m.body_jntadr[k] + m.body_jntnum[k])
        if not joints:
            robot.joints[f"{name} weld"] = RobotJoint(f"{name} weld", "weld", parent, name, place, outer=at)
        for j in joints:
            last = j == joints[-1]
            child = name if last else f"{name}.{self.names['joint'][j]}"
            still = j == joints[0] and m.body_weldid[m.body_parentid[k]] == 0
            mass = inertia if last else NOTHING
            if still and _TYPES[m.jnt_type[j]] == "spherical" and (rotor := float(m.dof_armature[m.jnt_dofadr[j]])):
                mass = replace(mass, tensor=mass.tensor + rotor * np.eye(3))
                robot.notes.append(
                    f"the armature of the ball joint {self.names['joint'][j]} is part of the inertia of its body"
                )
            if last:
                inertia = mass
            else:
                robot.links[child] = RobotLink(child, place, mass)
            joint = self._joint(j, parent, child, at if j == joints[0] else IDENTITY, still)
            robot.joints[joint.name] = joint
            parent = child
        robot.links[name] = RobotLink(name, place, inertia)

    def _joint(self, j: int, parent: str, child: str, at: Placement, still: bool) -> RobotJoint:
        m, name = self.m, self.names["joint"][j]
        kind = _TYPES[m.jnt_type[j]]
        dof, start = m.jnt_dofadr[j], m.jnt_qposadr[j]
        place = self.place(name, "joint", "freejoint")
        anchor = moved(m.jnt_pos[j])
        limited = bool(m.jnt_limited[j]) and not self.off("LIMIT", "CONSTRAINT")
        rubbing = 0.0 if self.off("FRICTIONLOSS", "CONSTRAINT") else float(m.dof_frictionloss[dof])
        joint = RobotJoint(
            name,
            kind,
            parent,
            child,
            place,
            outer=at @ anchor,
            inner=anchor,
            damping=0.0 if self.off("DAMPER") else float(m.dof_damping[dof]),
            stiffness=0.0 if self.off("SPRING") else float(m.jnt_stiffness[j]),
        )
        if kind in ("free", "spherical"):
            if kind == "free" and m.dof_armature[dof]:
                message = "armature on a free joint is not supported: it is mass without weight, which no body has"
                self.robot.problem(
                    f"joint.{name}.armature", message, 'set armature="0" there', place, code="EG-UNSUPPORTED"
                )
            for what, acts in (("dry friction", rubbing), ("limit", limited)):
                if acts:
                    self.robot.notes.append(f"left out: the {what} of the {kind} joint {name}")
            if kind == "spherical":
                return joint if still else replace(joint, armature=float(m.dof_armature[dof]))
            pose = by_quaternion(m.qpos0[start : start + 3], m.qpos0[start + 3 : start + 7])
            return replace(joint, outer=IDENTITY, inner=IDENTITY, start=pose)
        axis = numbers(m.jnt_axis[j])
        q0 = float(m.qpos0[start])
        back = turned(axis, -q0) if kind == "revolute" else moved(-q0 * np.array(axis))
        limits = dict(zip(("lower", "upper"), numbers(m.jnt_range[j]), strict=True)) if limited else {}
        clamp = None
        if m.jnt_actfrclimited[j]:
            clamp = float(m.jnt_actfrcrange[j][0]), float(m.jnt_actfrcrange[j][1])
            limits["effort"] = max(map(abs, clamp))
        return replace(
            joint,
            outer=joint.outer @ back,
            axis=(axis[0], axis[1], axis[2]),
            limits={key: value for key, value in limits.items() if not limits_nothing(key, value)},
            dry_friction=rubbing,
            armature=float(m.dof_armature[dof]),
            rest=float(m.qpos_spring[start]),
            initial=q0,
            clamp=clamp,
        )

    # -- equalities: soft in MuJoCo, exact here -------------------------------------------------------------------
    def _equality(self, k: int) -> None:
        m, robot = self.m, self.robot
        name, kind = self.names["equality"][k], m.eq_type[k]
        place = self.place(name, "connect", "weld", "joint", "tendon")
        if not m.eq_active0[k] or self.off("EQUALITY", "CONSTRAINT"):
            robot.notes.append(f"left out: the equality {name}, which is not active")
            return
        if kind in (_CONNECT, _WELD) and m.eq_objtype[k] in (_BODY, _SITE):
            robot.loops.append(self._loop(k, name, place))
        elif kind in (_JOINT_TIE, _TENDON_TIE) and (tie := self._tie(k, name, place)) is not None:
            robot.ties.append(tie)
        else:
            robot.notes.append(f"left out: the equality {name}, which has no counterpart")
            return
        if yielding := self._yielding(k):
            robot.notes.append(f"the equality {name} holds exactly here; MuJoCo lets it yield far ({yielding})")

    def _yielding(self, k: int) -> str:
        """The attributes that make an equality so soft in MuJoCo that it hardly holds; empty if there are none."""
        m = self.m
        first, second = map(float, m.eq_solref[k])  # time constant and damping ratio, or minus stiffness and damping
        least, most = np.clip(m.eq_solimp[k][:2], IMPEDANCE, 1.0 - IMPEDANCE).tolist()
        stiffness = 1.0 / (first * second) ** 2 if first > 0.0 < second else -first
        slow = stiffness < (SLOWEST * most) ** 2 and (first > 0.0) == (second > 0.0)  # mixed signs: its default
        scale = float(m.eq_data[k][10]) if m.eq_type[k] == _WELD else 1.0
        return " and ".join(["solref"] * slow + ["torquescale"] * (0.0 < scale * scale < min(1.0, 1.0 / least - 1.0)))

    def _loop(self, k: int, name: str, place: Place) -> Loop:
        m, bodies, data = self.m, self.names["body"], self.m.eq_data[k]
        weld = m.eq_type[k] == _WELD
        kind = "weld" if weld and data[10] else "spherical"  # torquescale 0: the weld's rows of rotation vanish
        ids = m.eq_obj1id[k], m.eq_obj2id[k]
        if m.eq_objtype[k] == _SITE:
            frames = [by_quaternion(m.site_pos[i], m.site_quat[i]) for i in ids]
            if weld and data[6:10].any():
                frames[0] = frames[0] @ by_quaternion(data[3:6], data[6:10])
            links = [bodies[m.site_bodyid[i]] for i in ids]
        else:
            links = [bodies[i] for i in ids]
            if not weld:
                frames = [moved(data[:3]), moved(data[3:6])]
            else:  # the second body's anchor, and where it is and how it is turned as the first sees it
                frames = [by_quaternion(data[3:6], data[6:10]), moved(data[:3])]
        return Loop(name, kind, (links[0], frames[0]), (links[1], frames[1]), place)

    def _tie(self, k: int, name: str, place: Place) -> Tie | None:
        """y - y(0) = c0 + c1 (x - x(0)) + ... + c4 (x - x(0))^4 of joint coordinates or lengths of fixed tendons."""
        m = self.m
        left = self._summed(k, m.eq_obj1id[k])
        right = self._summed(k, m.eq_obj2id[k]) if m.eq_obj2id[k] >= 0 else Sum(())
        if left is None or right is None:
            return None
        return Tie(name, left, right, tuple(float(c) for c in m.eq_data[k][: 5 if right.parts else 1]), place)

    def _summed(self, k: int, side: int) -> Sum | None:
        """One side of an equality of joints or tendons, less its value at the initial position."""
        m = self.m
        if m.eq_type[k] == _TENDON_TIE:
            parts = self._fixed_tendon(side)
            return Sum(parts, -float(m.tendon_length0[side])) if parts else None
        if m.jnt_type[side] < 2:
            return None
        return Sum(((self.names["joint"][side], 1.0),), -float(m.qpos0[m.jnt_qposadr[side]]))

    # -- actuators and fixed tendons ------------------------------------------------------------------------------
    # A drive of length L = sum c_j q_j has the force f = gain u + b0 + b1 L + b2 L', and pushes c_j f along q_j.  As
    # in MuJoCo u is cut to ctrlrange, the forces along a tendon are scaled where their sum leaves the tendon's
    # actuatorfrcrange, f is cut to forcerange, and what all drives do along a joint to the joint's actuatorfrcrange.
    def _actuators(self) -> None:
        m, robot = self.m, self.robot
        left, unused, nothing = [], [], [0.0] * m.nu
        for k, name in enumerate(self.names["actuator"]):  # of several controls or forces each, since MuJoCo 4
            parts = self._actuated(k)
            place = self.place(name, "motor", "position", "velocity", "general", "damper", "intvelocity")
            damping, armature = (float(getattr(m, f"actuator_{key}", nothing)[k]) for key in ("damping", "armature"))
            self._resist(f"actuator {name}", parts, place, damping, armature)
            group = m.actuator_group[k]
            if self.off("ACTUATION") or (0 <= group < 31 and m.opt_disableactuator >> group & 1):
                unused.append(name)
                continue
            plain = m.actuator_dyntype[k] == 0 and m.actuator_gaintype[k] == _FIXED_GAIN and m.actuator_plugin[k] < 0
            if not parts or not plain or m.actuator_biastype[k] not in (_NO_BIAS, _AFFINE_BIAS):
                left.append(name)
                continue
            affine = m.actuator_biastype[k] == _AFFINE_BIAS
            b0, b1, b2 = (float(b) if affine else 0.0 for b in m.actuator_biasprm[k][:3])
            drive = Drive(name, parts, float(m.actuator_gainprm[k][0]), (b0, b1, b2), place)
            robot.drives.append(replace(drive, **self._ranges(k)))
        if left:
            robot.notes.append(f"left out: actuators that do not push along joints by a linear law ({', '.join(left)})")
        if unused:
            robot.notes.append(f"left out: actuators that the file disables ({', '.join(unused)})")

    def _ranges(self, k: int) -> dict[str, Any]:
        """What the control and the force of an actuator are cut to."""
        m = self.m
        control, output = (getattr(m, key, range(m.nu))[k] for key in ("actuator_ctrladr", "actuator_outadr"))
        result: dict[str, Any] = {}
        if m.actuator_ctrllimited[control] and not self.off("CLAMPCTRL"):
            result["control"] = tuple(map(float, m.actuator_ctrlrange[control]))
        if m.actuator_forcelimited[output]:
            result["force"] = tuple(map(float, m.actuator_forcerange[output]))
        tendon = m.actuator_trnid[k][0]
        if m.actuator_trntype[k] == _TENDON and m.tendon_actfrclimited[tendon]:
            result["tendon"] = str(tendon)
            result["total"] = tuple(map(float, m.tendon_actfrcrange[tendon]))
        return result

    def _actuated(self, k: int) -> Parts:
        m = self.m
        counts = [getattr(m, key, None) for key in ("actuator_ctrlnum", "actuator_outnum")]
        if any(count is not None and count[k] != 1 for count in counts):
            return ()
        first = getattr(m, "actuator_outadr", range(m.nu))[k]  # gears are those of forces
        target, gear = m.actuator_trnid[k][0], float(m.actuator_gear[first][0])
        if m.actuator_trntype[k] in (_JOINT, _JOINT_IN_PARENT) and m.jnt_type[target] >= 2:
            return ((self.names["joint"][target], gear),)
        if m.actuator_trntype[k] == _TENDON:
            return tuple((joint, gear * c) for joint, c in self._fixed_tendon(target))
        return ()

    def _fixed_tendon(self, k: int) -> Parts:
        """Joints and coefficients of a tendon whose length is a sum of joint coordinates."""
        m = self.m
        wraps = range(m.tendon_adr[k], m.tendon_adr[k] + m.tendon_num[k])
        if any(m.wrap_type[w] != _WRAP_JOINT for w in wraps):
            return ()
        return tuple((self.names["joint"][m.wrap_objid[w]], float(m.wrap_prm[w])) for w in wraps)

    def _tendons(self) -> None:
        m, robot = self.m, self.robot
        left = []
        for k, name in enumerate(self.names["tendon"]):
            parts = self._fixed_tendon(k)
            place = self.place(name, "fixed", "spatial")
            self._resist(f"tendon {name}", parts, place, float(m.tendon_damping[k]), float(m.tendon_armature[k]))
            stiffness = 0.0 if self.off("SPRING") else float(m.tendon_stiffness[k])
            low, high = (float(x) for x in m.tendon_lengthspring[k])
            if stiffness and parts and low == high:
                robot.drives.append(Drive("", parts, 0.0, (stiffness * low, -stiffness, 0.0), place))
            elif stiffness:
                left.append(name)
        if left:
            robot.notes.append(f"left out: springs of the tendons {', '.join(left)}")

    def _resist(self, what: str, parts: Parts, place: Place, damping: float, armature: float) -> None:
        """Add a damper and a rotor along L = sum c_j q_j: of one joint c^2 of each is the joint's own."""
        robot = self.robot
        damping = 0.0 if self.off("DAMPER") else damping
        if len(parts) == 1:
            name, c = parts[0]
            joint = robot.joints[name]
            square = c * c
            robot.joints[name] = replace(
                joint, damping=joint.damping + square * damping, armature=joint.armature + square * armature
            )
            return
        if damping and parts:
            robot.drives.append(Drive("", parts, 0.0, (0.0, 0.0, -damping), place))
        elif damping:
            robot.notes.append(f"left out: the damping of the {what}")
        if armature:
            robot.notes.append(f"left out: the armature of the {what}")

    # -- what has no counterpart ----------------------------------------------------------------------------------
    def _touching(self) -> bool:
        """Whether two geoms of bodies that move against each other may touch."""
        m = self.m
        if self.off("CONTACT", "CONSTRAINT"):
            return False
        if m.npair:
            return True
        kinds = np.unique(np.stack([m.body_weldid[m.geom_bodyid], m.geom_contype, m.geom_conaffinity], 1), axis=0)
        carrier = m.body_weldid[m.body_parentid[m.body_weldid]]  # of each body: the one its own moves on
        for k, (body, kind, met) in enumerate(kinds):
            others, kinds_there, met_there = kinds[k + 1 :].T
            apart = others != body
            if not self.off("FILTERPARENT"):  # what moves on another does not touch it, but for the world
                apart &= ((carrier[others] != body) | (body == 0)) & ((carrier[body] != others) | (others == 0))
            if (apart & (((kind & met_there) | (kinds_there & met)) != 0)).any():
                return True
        return False

    def _note_the_rest(self) -> None:
        m, notes = self.m, self.robot.notes
        if m.opt_density or m.opt_viscosity:
            notes.append("left out: the forces of the medium (density, viscosity)")
        if self._touching():
            notes.append("left out: contact of geoms")
        if m.body_gravcomp.any():
            notes.append("left out: gravity compensation of bodies (gravcomp)")
        if getattr(m, "nflex", 0):
            notes.append(f"left out: {m.nflex} deformable bodies (flex)")
        if (m.body_mocapid >= 0).any():
            notes.append("bodies moved by motion capture (mocap) stand still")
        if m.opt_enableflags & _SLEEP:
            notes.append("bodies at rest that MuJoCo lets sleep (sleep) move here")
        for key, (flag, what) in NOTED.items():
            if np.any(getattr(m, key, 0)) and not self.off(flag):
                notes.append(f"left out: {what} ({key})")
