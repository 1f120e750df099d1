"""Stage program, rolling discs: Kinematics -> their axles and normals, from which a run tells that one fell flat."""

from __future__ import annotations

from typing import Any

from ..constraints import RollingDisc
from ..frames import Marker
from ..graph.evaluate import evaluate
from ..kinematics import Kinematics


def describe_discs(kinematics: Kinematics) -> list[list[Any]]:
    """Per disc: constraint, body and axle of the wheel, body (-1: ground) and normal of the plane, in body axes.

    They are those at the declared values of parameters.
    """
    mechanism = kinematics.mechanism
    values = {p.name: p.value for p in mechanism.parameters}

    def axis(marker: Marker) -> list[Any]:
        return [marker.body, [float(x) for x in evaluate([row[2] for row in marker.frame.rotation], values)]]

    return [[c.name, *axis(c.wheel), *axis(c.plane)] for c in mechanism.constraints if isinstance(c, RollingDisc)]
