"""Scenes of tests/reference/exudyn_contacts.json by Exudyn (``pip install exudyn==1.13.6``) -> their answers.

Exudyn takes absolute coordinates and Euler parameters; its connector of spheres has the force k d^1.5 without damping,
and a friction force that is proportional to the sliding velocity below a small speed.
"""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import exudyn as exu
from exudyn.utilities import (
    GenericJoint,
    InertiaSphere,
    MarkerBodyRigid,
    NodeGenericData,
    ObjectContactSphereSphere,
    ObjectGround,
)

PATH = Path(__file__).parents[1] / "tests" / "reference" / "exudyn_contacts.json"
SCENES = json.loads(PATH.read_text(encoding="utf-8"))


def touch(mbs: Any, bodies: tuple[Any, Any], radii: tuple[float, float], friction: float, zone: float = 1e-3) -> None:
    markers = [mbs.AddMarker(MarkerBodyRigid(bodyNumber=body)) for body in bodies]
    data = mbs.AddNode(NodeGenericData(initialCoordinates=[0.1, 0, 0, 0], numberOfDataCoordinates=4))
    mbs.AddObject(
        ObjectContactSphereSphere(
            markerNumbers=markers, nodeNumber=data, spheresRadii=list(radii), dynamicFriction=friction,
            frictionProportionalZone=zone, contactStiffness=SCENES["stiffness"],
            contactStiffnessExponent=SCENES["exponent"], impactModel=0,
        )
    )  # fmt: skip


def run(mbs: Any, bodies: list[Any], end: float, step: float) -> dict[str, list[list[float]]]:
    mbs.Assemble()
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = round(end / step), end
    integration.generalizedAlpha.spectralRadius = 0.9
    integration.newton.relativeTolerance = 1e-9
    integration.newton.useModifiedNewton = False
    integration.discontinuous.maxIterations = 5
    integration.discontinuous.ignoreMaxIterations = True
    settings.solution.file.write = False
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    mbs.SolveDynamic(settings)
    kinds = exu.OutputVariableType
    wanted = {"places": kinds.Position, "velocities": kinds.Velocity, "spins": kinds.AngularVelocity}
    return {
        name: [[round(float(x), 9) for x in mbs.GetObjectOutputBody(body, kind)] for body in bodies]
        for name, kind in wanted.items()
    }


def balls() -> dict[str, list[list[float]]]:
    scene = SCENES["balls"]
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject(ObjectGround())
    bodies: list[Any] = []
    for k, radius in enumerate(scene["radii"]):
        bodies.append(
            mbs.CreateRigidBody(
                inertia=InertiaSphere(scene["masses"][k], radius), referencePosition=scene["places"][k],
                initialVelocity=scene["velocities"][k], initialAngularVelocity=scene["spins"][k],
                gravity=[0, 0, -SCENES["gravity"]],
            )
        )  # fmt: skip
        friction = scene["friction"], scene["friction_zone"]
        touch(mbs, (ground, bodies[k]), (scene["dome"], radius), *friction)
        for other in range(k):
            touch(mbs, (bodies[other], bodies[k]), (scene["radii"][other], radius), *friction)
    return run(mbs, bodies, scene["end"], scene["step"])


def beads() -> dict[str, list[list[float]]]:
    scene = SCENES["beads"]
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject(ObjectGround())
    x, y, z = scene["first"]
    bodies: list[Any] = []
    for k in range(scene["count"]):
        inertia = InertiaSphere(scene["mass"], scene["radius"])
        place = [x + scene["pitch"] * k, y, z]
        bodies.append(mbs.CreateRigidBody(inertia=inertia, referencePosition=place, gravity=[0, 0, -SCENES["gravity"]]))
        touch(mbs, (ground, bodies[k]), (scene["drum"], scene["radius"]), 0.0)
    for before, after in pairwise(bodies):
        markers = [
            mbs.AddMarker(MarkerBodyRigid(bodyNumber=body, localPosition=[side * scene["pitch"] / 2, 0, 0]))
            for body, side in ((before, 1), (after, -1))
        ]
        mbs.AddObject(GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 1, 0, 0, 0]))
    return run(mbs, bodies, scene["end"], scene["step"])


if __name__ == "__main__":
    SCENES["balls"]["answer"], SCENES["beads"]["answer"] = balls(), beads()
    PATH.write_text(json.dumps(SCENES, indent=1) + "\n", encoding="utf-8")
