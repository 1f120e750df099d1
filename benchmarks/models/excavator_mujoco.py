"""The tracked excavator as a scene of MuJoCo: the bodies, joints, drive and shapes of examples/tracked_excavator.py.

All contact happens in the plane z = 0, where a sphere is a circle and a capsule a segment.  Two things differ.  The
sprocket is a circle on whose rim the pins lie and a capsule for each tooth, because MuJoCo takes convex shapes alone.
And the upper structure, which the cylinders hold, is rigid at its start.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from tracked_excavator import Track

from eomgen.expr.evaluate import evaluate

#: Shapes that meet: shoes and ground, rails and wheels, bushings and sprocket.
PAIRS = {"shoe": (1, 2), "ground": (2, 1), "rail": (4, 8), "wheel": (8, 4), "bushing": (16, 32), "sprocket": (32, 16)}
OPTIONS = '<option timestep="{step}" gravity="0 -9.81 0" integrator="implicitfast" cone="elliptic"/>'


class Scene:
    """The text of the scene.

    Parameters
    ----------
    model, module : Model, Module
        The excavator of the example.
    step : float
        (s) MuJoCo's time step; its contacts are as stiff as this allows, with a time constant of two steps.
    """

    def __init__(self, model: Any, module: Any, step: float) -> None:
        self.step, self.track = step, Track()
        mechanism = model.mechanism()
        values = {p.name: p.value for p in mechanism.parameters}
        self.values = values
        self.bodies = {
            body.name: [
                float(x)
                for x in evaluate([body.mass, *body.com, *(row[k] for k, row in enumerate(body.inertia))], values)
            ]
            for body in mechanism.bodies
        }
        x = module.x0()
        self.start = dict(zip(module.x_names, x.tolist(), strict=True))
        poses = module.poses(x[: module.n_q])
        self.poses = dict(zip(module.body_names, poses, strict=True))

    def inertial(self, name: str) -> str:
        """Mass, centre and moments of a body."""
        mass, *rest = self.bodies[name]
        com, moments = rest[:3], [x or rest[5] or 1.0 for x in rest[3:]]  # MuJoCo takes no 0 where nothing turns
        return f'<inertial mass="{mass!r}" pos="{_row(com)}" diaginertia="{_row(moments)}"/>'

    def geom(self, kind: str, friction: float, shape: str, size: str) -> str:
        """A shape that meets those of its partner."""
        mine, other = PAIRS[kind]
        return (
            f'<geom type="{shape}" contype="{mine}" conaffinity="{other}" friction="{friction} 0 0" mass="0" {size} '
            f'solref="{2.0 * self.step} 1"/>'
        )

    def held(self, name: str) -> str:
        """A body of the upper structure, fixed to the frame where it starts."""
        pose = np.linalg.inv(self.poses["frame"]) @ self.poses[name]
        turn = math.atan2(pose[1, 0], pose[0, 0])
        return f'<body pos="{_row(pose[:3, 3])}" euler="0 0 {turn!r}">{self.inertial(name)}</body>'

    def link(self, k: int) -> str:
        """A link with all that follow."""
        t, mu, steel = self.track, self.values["mu_ground"], self.values["mu_wheels"]
        half = t.pitch / 2

        def line(kind: str, friction: float, y: float, length: float, radius: float) -> str:
            ends = f'fromto="{half - length / 2!r} {y!r} 0 {half + length / 2!r} {y!r} 0" size="{radius}"'
            return self.geom(kind, friction, "capsule", ends)

        place = f"{self.start['chain_x']!r} {self.start['chain_y']!r} 0" if k == 0 else f"{t.pitch!r} 0 0"
        slides = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>' if k == 0 else ""
        shapes = line("shoe", mu, 0.015 - t.shoe, t.pitch - 0.04, 0.015)
        shapes += line("rail", steel, t.rail - 0.01, t.pitch - 0.01, 0.01)
        shapes += self.geom("bushing", steel, "sphere", f'size="{t.bushing}"')
        further = self.link(k + 1) if k + 1 < t.links else ""
        turn = float(self.angle(k))
        return (
            f'<body name="link{k}" pos="{place}" euler="0 0 {turn!r}">{slides}<joint type="hinge" axis="0 0 1"/>'
            f"{self.inertial(f'link{k}')}{shapes}{further}</body>"
        )

    def angle(self, k: int) -> float:
        """Of a link against the one before."""
        along = [
            math.atan2(pose[1, 0], pose[0, 0]) for pose in (self.poses[f"link{max(k - 1, 0)}"], self.poses[f"link{k}"])
        ]
        return along[1] if k == 0 else math.remainder(along[1] - along[0], 2.0 * math.pi)

    def wheel(self, name: str, x: float, y: float, radius: float) -> str:
        """A wheel on a hinge."""
        shape = self.geom("wheel", self.values["mu_wheels"], "sphere", f'size="{radius!r}"')
        turning = f'<joint name="{name}" type="hinge" axis="0 0 1"/>'
        return f'<body pos="{x!r} {y!r} 0">{turning}{self.inertial(name)}{shape}</body>'

    def sprocket(self) -> str:
        """The sprocket: its root as a circle, and its teeth between seats for the bushings."""
        t, steel = self.track, self.values["mu_wheels"]
        shapes = self.geom("sprocket", steel, "sphere", f'size="{t.sprocket - t.bushing - 0.0005!r}"')
        gap = 2.0 * t.sprocket * math.sin(math.pi / t.teeth)
        radius = 0.5 * gap - t.bushing - 0.0005
        for k in range(t.teeth):
            way = math.pi + 2.0 * math.pi * (k + 0.5) / t.teeth
            inner, outer = t.sprocket - t.bushing, t.sprocket + t.tip - radius
            ends = " ".join(f"{r * math.cos(way)!r} {r * math.sin(way)!r} 0" for r in (inner, outer))
            shapes += self.geom("sprocket", steel, "capsule", f'fromto="{ends}" size="{radius!r}"')
        rotor = self.values["rotors"]
        turning = f'<joint name="sprocket" type="hinge" axis="0 0 -1" armature="{rotor}"/>'
        return f'<body pos="{-t.half!r} 0 0">{turning}{self.inertial("sprocket")}{shapes}</body>'

    def text(self) -> str:
        """MJCF."""
        t, v = self.track, self.values
        idler = float((np.linalg.inv(self.poses["frame"]) @ self.poses["slide"])[0, 3])
        wheels = "".join(self.wheel(name, *place) for name, place in t.wheels().items())
        spring = f'stiffness="{v["recoil"]}" springref="{v["pretension"] / v["recoil"]!r}" damping="2e4"'
        wheels += (
            f'<body pos="{idler!r} 0 0"><joint name="tensioner" type="slide" axis="1 0 0" {spring}/>'
            f"{self.inertial('slide')}{self.wheel('idler', 0.0, 0.0, t.idler)}</body>"
        )
        upper = "".join(map(self.held, ("upper", "boom", "stick", "bucket", "rocker", "link")))
        motor = f'<velocity joint="sprocket" kv="{v["gain"]}" forcerange="{-v["relief"]} {v["relief"]}"/>'
        ground = self.geom("ground", v["mu_ground"], "plane", 'size="50 50 1" zaxis="0 1 0"')
        return (
            f'<mujoco><compiler angle="radian"/>{OPTIONS.format(step=self.step)}<worldbody>{ground}'
            f'<body name="frame" pos="0 {t.height!r} 0"><joint name="x" type="slide" axis="1 0 0"/>'
            '<joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
            f"{self.inertial('frame')}{self.sprocket()}{wheels}{upper}</body>{self.link(0)}</worldbody>"
            f'<equality><connect body1="link{t.links - 1}" body2="link0" anchor="{t.pitch!r} 0 0" '
            f'solref="{2.0 * self.step} 1"/></equality><actuator>{motor}</actuator></mujoco>'
        )


def _row(numbers: Any) -> str:
    return " ".join(repr(float(x)) for x in numbers)
