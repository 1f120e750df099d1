"""Robots, MJCF: the table of what becomes of each element and attribute.

An element stands under its parent's tag.  What is in ``default`` is looked up as the element that it is a default of;
``worldbody``, ``frame`` and ``replicate`` are bodies.  Names, classes and numbers of users have no lines of their own.
"""

from __future__ import annotations

from .constructs import DATA, HARMLESS, LEFT, SEEN, TAKEN, ConstructRow, find_row, table_of

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

MJCF = table_of(
    f"""
    mujoco, mujocoinclude: taken model
    mujoco/compiler: taken alignfree angle assetdir autolimits balanceinertia boundinertia boundmass conflict
    mujoco/compiler: taken coordinate discardvisual eulerseq exactmeshinertia fitaabb fusestatic inertiafromgeom
    mujoco/compiler: taken inertiagrouprange meshdir passthrough savecanonical savecompiled saveinertial settotalmass
    mujoco/compiler: taken strippath texturedir usethread convexhull
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
    mujoco/include: taken file
    mujoco/extension, body/plugin, geom/plugin, mesh/plugin, flexcomp/plugin: plugin **
    asset/mesh: taken builtin content_type face file inertia material maxhullvert normal params refpos refquat scale
    asset/mesh: taken smoothnormal texcoord vertex
    asset/model: taken content_type file
    asset/hfield: contact **
    asset/skin, asset/texture, asset/material, body/camera, body/light: looks **
    body/body: taken axisangle euler fuse pos quat xyaxes zaxis
    body/body: parts gravcomp
    body/body: mocap mocap
    body/body: solver simple
    body/body: asleep sleep
    body/frame: taken axisangle euler pos quat xyaxes zaxis
    body/replicate: taken count euler offset sep
    body/attach: taken body frame model prefix
    body/composite: taken **
    body/inertial: taken axisangle diaginertia euler fullinertia mass pos quat xyaxes zaxis
    body/joint: taken type pos axis ref springref stiffness damping armature springdamper
    body/joint: taken actuatorfrclimited actuatorfrcrange
    body/joint: limits range limited
    body/joint: friction frictionloss
    body/joint: parts springyield actuatorgravcomp
    body/joint: solver margin solimpfriction solimplimit solreffriction solreflimit solreflimit
    body/freejoint: taken align
    body/geom: taken axisangle density euler fitscale fromto hfield mass mesh pos quat shellinertia size type
    body/geom: taken xyaxes zaxis
    body/geom: contact adhesion conaffinity condim contype friction gap margin priority solimp solmix solref surfacevel
    body/geom: medium fluidcoef fluidshape
    body/geom: looks castshadow material rgba
    body/site: taken axisangle euler fromto mesh pos quat size type xyaxes zaxis
    body/site: looks material rgba
    body/flexcomp, mujoco/deformable: soft **
    contact/pair, contact/exclude: contact **
    tendon/spatial, tendon/fixed: taken stiffness damping armature springlength actuatorfrclimited actuatorfrcrange
    tendon/spatial, tendon/fixed: parts frictionloss limited range springyield
    tendon/spatial, tendon/fixed: solver margin solimpfriction solimplimit solreffriction solreflimit
    tendon/spatial, tendon/fixed: looks material rgba width
    spatial/site, spatial/geom, spatial/pulley: parts **
    fixed/joint: taken coef joint
    equality/connect: taken active anchor body1 body2 site1 site2
    equality/weld: taken active anchor body1 body2 relpose site1 site2 torquescale
    equality/joint: taken active joint1 joint2 polycoef
    equality/tendon: taken active tendon1 tendon2 polycoef
    equality/flex, equality/flexstrain: soft active flex cell
    equality/connect, equality/joint, equality/tendon, equality/flex: solver torquescale
    equality/connect, equality/weld, equality/joint, equality/tendon, equality/flex, equality/flexstrain: yield solref
    equality/connect, equality/weld, equality/joint, equality/tendon, equality/flex, equality/flexstrain: yield solimp
    {", ".join(f"actuator/{tag}" for tag in _DRIVES.split())}: drive *
    plugin/config: plugin **
    mujoco/sensor: measure **
    mujoco/custom: user **
    mujoco/keyframe: states **
    """,
    _REASONS,
)
_EVERYWHERE = {"name": "taken", "class": "taken", "childclass": "taken", "user": "user", "group": "user"}
#: Element of a default -> what it is a default of.
_DEFAULTS = {
    **dict.fromkeys(("mesh", "texture", "material", "skin"), "asset"),
    **dict.fromkeys(("joint", "geom", "site", "camera", "light"), "body"),
    "pair": "contact",
    **dict.fromkeys(_DRIVES.split(), "actuator"),
}
_BODIES = ("body", "worldbody", "frame", "replicate")


def path_of(parent: str, tag: str) -> str:
    """Where the table has an element, by the tag of its parent."""
    if parent == "default" and tag != "default":
        if tag in ("tendon", "equality"):
            return "tendon/spatial" if tag == "tendon" else "equality/connect"
        return f"{_DEFAULTS.get(tag, parent)}/{tag}"
    if not parent:
        return tag
    if tag == "include":
        return "mujoco/include"
    return f"{'body' if parent in _BODIES else 'mujoco' if parent == 'mujocoinclude' else parent}/{tag}"


def find_mjcf(path: str, attribute: str = "") -> ConstructRow | None:
    """What becomes of an attribute of an element, or of the element itself; None if it is not known."""
    row = find_row(MJCF, path, attribute)
    if row is None and path in MJCF and attribute in _EVERYWHERE:
        fate, why = _REASONS[_EVERYWHERE[attribute]]
        return ConstructRow(path, fate, (attribute,), why)
    return row
