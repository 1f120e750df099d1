"""Robot files to start from, and what is put into them: elements, numbers, names of files, declarations."""

_BALL = '<worldbody><body name="a"><joint name="j"/><geom size="1"/></body></worldbody>'
_SHAPE = '<worldbody><body name="a"><joint name="j1"/><geom type="mesh" mesh="m"/></body></worldbody>'
BASES = {
    "urdf": [
        '<robot name="r"><link name="base"/><link name="l1"><inertial><origin xyz="0 0 .1" rpy="0 .1 0"/><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><visual><geometry>'
        '<mesh filename="package://../../secret.stl" scale="1 1 1"/></geometry></visual></link>'
        '<link name="l2"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        '<link name="l3"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
        '<joint name="j1" type="continuous"><parent link="base"/><child link="l1"/><axis xyz="0 0 1"/><dynamics damping=".1" friction=".2"/></joint>'
        '<joint name="j2" type="prismatic"><parent link="l1"/><child link="l2"/><limit lower="0" upper="1" effort="1" velocity="1"/>'
        '<mimic joint="j1" multiplier="2" offset=".1"/></joint>'
        '<joint name="j3" type="planar"><parent link="l2"/><child link="l3"/><axis xyz="0 1 0"/></joint></robot>',
        '<robot name="two"><link name="base"/><link name="w"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1"/></inertial></link>'
        '<link name="f"><inertial><origin xyz="1 0 0" rpy="1 2 3"/><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1"/></inertial></link>'
        '<joint name="j1" type="revolute"><parent link="base"/><child link="w"/><origin xyz="0 0 1" rpy="0 0 1.5707963"/><axis xyz="1 1 0"/></joint>'
        '<joint name="j2" type="fixed"><parent link="w"/><child link="f"/><origin xyz="0 0 1" rpy="1 1 1"/></joint>'
        '<mujoco><compiler meshdir="../" strippath="false"/></mujoco></robot>',
    ],
    "mjcf": [
        '<mujoco model="m"><compiler angle="radian" autolimits="true"/><option gravity="0 0 -9.81"/><default><joint damping="0.1"/></default>'
        '<worldbody><body name="a" pos="0 0 1"><joint name="j1" type="hinge" axis="0 1 0" range="-1 1" armature="0.1"/>'
        '<geom name="g" type="capsule" fromto="0 0 0 0 0 -.5" size=".05"/><body name="b" pos="0 0 -.5"><joint name="j2" type="ball"/>'
        '<geom type="box" size=".1 .2 .3" mass="2"/><body name="c" pos="0 .5 0" euler="0.1 0.2 0.3">'
        '<joint name="j3" type="slide" axis="1 0 0" stiffness="10" springref="0.1" frictionloss="0.1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></body>'
        '<body name="f" pos="1 1 1"><freejoint name="fr"/><geom type="sphere" size=".1"/></body></worldbody>'
        '<equality><connect body1="c" body2="f" anchor="0 0 0"/><joint joint1="j1" joint2="j3" polycoef="0 1 0 0 0"/></equality>'
        '<tendon><fixed name="t1"><joint joint="j1" coef="1"/><joint joint="j3" coef="-2"/></fixed></tendon>'
        '<actuator><motor name="mo" joint="j1" gear="2" ctrlrange="-1 1"/><position name="po" joint="j3" kp="10"/></actuator></mujoco>',
        '<mujoco><worldbody><replicate count="3" offset="0 0 1"><body name="x"><joint type="hinge"/><geom size="1"/></body></replicate></worldbody></mujoco>',
        f'<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>{_SHAPE}</mujoco>',
        f'<mujoco><compiler meshdir="."/><asset><mesh name="m" file="a.stl"/></asset>{_SHAPE}</mujoco>',
        f'<mujoco><include file="part.xml"/>{_BALL}</mujoco>',
        '<mujoco><asset><model name="p" file="whole.xml"/></asset><worldbody><attach model="p" body="pb" prefix="x"/></worldbody></mujoco>',
    ],
}
#: Other files of a folder, which a model may include or attach.
FILES = {
    "part.xml": '<mujocoinclude><asset><texture name="grid" builtin="flat" width="9" height="9"/></asset></mujocoinclude>',
    "whole.xml": '<mujoco model="p"><worldbody><body name="pb"><joint/><geom size="1"/></body></worldbody></mujoco>',
    "loop.xml": '<mujocoinclude><include file="loop.xml"/></mujocoinclude>',
    "sub/inner.xml": '<mujocoinclude><include file="../part.xml"/><asset><mesh name="n" file="a.stl"/></asset></mujocoinclude>',
    "again.xml": '<mujoco><asset><model name="z" file="again.xml"/></asset><worldbody><body name="pb"/></worldbody></mujoco>',
}
_CORNERS = ("0 0 0", "1 0 0", "0 1 0", "0 0 1")
_FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
#: Meshes as texts by their names; those of STL files are bytes.
MESHES = {
    "text.stl": "solid x\n"
    + "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {_CORNERS[k]}\n" for k in face) + "endloop\nendfacet\n"
        for face in _FACES
    )
    + "endsolid x\n",
    "a.stl": "solid\nendsolid\n",
    "sub/a.stl": "solid\nendsolid\n",
    "b.obj": "mtllib ../../secret.xml\n"
    + "".join(f"v {c}\n" for c in _CORNERS)
    + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in _FACES),
    "c.ply": "ply\nformat ascii 1.0\nelement vertex 99999999\nproperty float x\nend_header\n0 0 0\n",
    "d.msh": "\x01\x00\x00\x7f\x01\x00\x00\x7f\x01\x00\x00\x00\x00\x00\x00\x00",
    "e.png": "\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x7f\xff\xff\xff\x7f\xff\xff\xff\x08\x06",
}  # fmt: skip
#: Numbers as they stand in attributes.
NUMBERS = (
    "0", "-0", "1", "-1", "2", "5", "-5", "1e-9", "1e9", "1e155", "-1e155", "1e308", "-1e308", "1.8e308", "1e400", "1e-308", "5e-324", "1e-320", "nan", "inf", "-inf", "NaN", "Infinity",
    "9" * 400, "9" * 5000, "1_0", "0x10", "1,2", "1e", ".5", "5.", "2147483648", "4294967296", "99999999999999999999", "1000000", "100000000", "1e8", "3.0000001", "10000", "16384",
)  # fmt: skip
_PLACES = (
    "../secret.{}", "..\\secret.{}", "sub/../../secret.{}", "sub\\..\\..\\secret.{}", "/etc/passwd", "\\etc\\passwd", "C:\\secret.{}", "C:/secret.{}", "file:///etc/passwd", "file:../secret.{}",
    "%2e%2e/secret.{}", "..//secret.{}", "./../secret.{}", "../secret.{}\n", " ../secret.{}", "http://127.0.0.1:9/x", "package://../secret.{}", "model://x", "\\\\server\\x", "~/secret.{}", "..", ".", "", "/",
    "/dev/zero", "/proc/self/environ", "a.stl", "text.stl", "sub/a.stl", "b.obj", "c.ply", "d.msh", "e.png", "part.xml", "whole.xml", "loop.xml", "again.xml", "model.xml", "sub/inner.xml", "A.STL", "a" * 300,
)  # fmt: skip
NAMES = tuple(dict.fromkeys(place.format(suffix) for place in _PLACES for suffix in ("xml", "stl")))
VALUES = (
    *NAMES, "1 2", "1 2 3", "1 2 3 4", "0 0 0", "0 0 0 0", "1e308 1e308 1e308", "nan nan nan", "a", "t", "a" * 70, "a" * 5000, "a" * 250000, "1 " * 50000, "true", "false", "auto", "hinge", "ball", "free", "slide",
    "revolute", "fixed", "floating", "planar", "continuous", "prismatic", "a b", "a.b", "1a", "_", "com", "q", "x", "link_", "t_dot", "ground", "world", "local", "radian", "degree", "xyz", "ZYX", "mesh", "box",
    "sphere", "capsule", "ellipsoid", "cylinder", "plane", "hfield", "sdf", "j1", "j2", "j3", "l1", "base", "b", "c", "m", "p", "grid", "mujoco.pid", "mujoco.elasticity.cable", "mujoco.sdf.torus", "cube", "2d", "enable", "disable",
)  # fmt: skip
#: Elements that have made trouble, or might.
PIECES: dict[str, list[str]] = {
    "urdf": [],
    "mjcf": [
        *(f'<include file="{name}"/>' for name in ("part.xml", "loop.xml", "sub/inner.xml", "model.xml", "../secret.xml", "..\\secret.xml")),
        '<Include file="../secret.xml"/>', '<INCLUDE file="loop.xml"/>',
        *(f'<compiler {key}="{name}"/>' for key in ("meshdir", "assetdir", "texturedir") for name in ("..", "..\\", "sub", "/", "C:\\")),
        '<compiler strippath="true"/>', '<compiler settotalmass="1e308"/>', '<compiler boundmass="1e308" balanceinertia="true"/>', '<compiler inertiafromgeom="true"/>', '<compiler eulerseq="xyq"/>',
        *(f'<asset><mesh name="m" file="{name}"/></asset>' for name in ("a.stl", "b.obj", "c.ply", "d.msh", "text.stl", "..\\secret.stl", "../secret.stl")),
        *(f'<asset><texture type="2d" {key}="{name}"/></asset>' for key in ("file", "fileup") for name in ("e.png", "..\\secret.png")),
        '<asset><hfield name="h" nrow="16384" ncol="16384" size="1 1 1 1"/></asset>', '<asset><hfield name="h" file="e.png" size="1 1 1 1"/></asset>',
        '<asset><skin file="..\\secret.skn"/></asset>', '<asset><mesh name="s" builtin="supersphere" params="1000 1 1"/></asset>', '<asset><mesh name="s" builtin="sphere" params="4"/></asset>',
        '<asset><model name="z" file="again.xml"/></asset>', '<asset><model name="z" file="..\\secret.xml"/></asset>', '<asset><model name="z" file="a.stl" content_type="text/xml"/></asset>',
        '<size nkey="100000000"/>', '<size nuser_body="1000000000"/>', '<size memory="1000T"/>', '<size nkey="999999" njmax="-5"/>', '<custom><numeric name="n" size="2000000000"/></custom>',
        '<worldbody><body name="fl"><joint/><geom size="1"/><flexcomp name="f" type="grid" count="8 8 8" spacing=".1 .1 .1" dim="3" mass="1"/></body></worldbody>',
        '<worldbody><body name="fm"><joint/><geom size="1"/><flexcomp name="f" type="mesh" file="text.stl" dim="2" mass="1"/></body></worldbody>',
        '<worldbody><body name="cp"><composite type="cable" curve="s" count="20 1 1" size="1" initial="none"><joint kind="main" damping=".1"/><geom type="capsule" size=".01"/></composite></body></worldbody>',
        '<worldbody><replicate count="40"><replicate count="40"><body><joint/><geom size="1"/></body></replicate></replicate></worldbody>',
        '<worldbody><replicate count="3" offset="1e308 0 0"><body><joint/><geom size="1"/></body></replicate></worldbody>',
        '<extension><plugin plugin="../secret.so"><instance name="x"/></plugin></extension>',
        '<extension><plugin plugin="mujoco.pid"><instance name="x"><config key="kp" value="1e308"/></instance></plugin></extension>',
        '<default><default class="d"><joint range="-1 1" type="ball"/></default></default>', '<keyframe><key qpos="1"/></keyframe>', '<sensor><jointpos joint="nothing"/></sensor>',
        '<equality><weld body1="a" body2="c" relpose="0 0 0 0 0 0 0"/></equality>', '<equality><weld body1="a"/></equality>', '<equality><tendon tendon1="t1" polycoef="0 1e308 1e308 1 1"/></equality>',
        '<equality><joint joint1="j1" polycoef="nan 0 0 0 0"/></equality>', '<equality><connect body1="a" anchor="1e308 0 0"/></equality>', '<equality><connect site1="s" site2="s"/></equality>',
        '<actuator><muscle joint="j1"/></actuator>', '<actuator><general joint="j1" gainprm="1e308" biastype="affine" biasprm="1e308 1e308 1e308"/></actuator>', '<actuator><motor joint="j2" gear="1 1 1"/></actuator>',
        '<actuator><motor name="t" joint="j1" ctrllimited="true" ctrlrange="1e308 1.1e308"/></actuator>', '<actuator><motor joint="j1" forcerange="-inf inf" forcelimited="true"/></actuator>',
        '<option><flag constraint="disable" gravity="disable"/></option>', '<option gravity="1e308 nan 0" wind="1 1 1" density="1e308"/>', '<contact><pair geom1="g" geom2="g"/></contact>',
    ],
}  # fmt: skip
DECLARATIONS = (
    '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>', '<!DOCTYPE r SYSTEM "/etc/passwd">', '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
    '<!DOCTYPE r [<!ENTITY % p SYSTEM "http://127.0.0.1:9/x"> %p;]>', "<!DOCTYPE r []>", '<!DOCTYPE r [<!ATTLIST link name CDATA "x">]>', '<?xml-stylesheet href="file:///etc/passwd"?>',
    '<?xml version="1.0" encoding="utf-16"?>', '<?xml version="1.1"?>', '<?xml version="1.0" encoding="x"?>', "\ufeff", "<!-- -- -->", "<![CDATA[x]]>", '<?xml version="1.0" encoding="idna"?>', '<?xml version="1.0" encoding="zlib"?>',
)  # fmt: skip
