"""Stage equations: a motion that moves no mass -> which body turns about what axis in vain, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..base.limits.constraints import UNMOVED
from ..errors import Problem
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.evaluate import evaluate
from ..kinematics import Kinematics
from ..records import dataclass

FAINT = 0.01  #: part of a motion, relative to its largest, that is left out of a message


@dataclass(frozen=True)
class IdleMotion:
    """Velocities (n,) that move no mass at a configuration.

    Attributes
    ----------
    q : (n_q,) array
    v : (n,) array
        In the order of the freedoms.
    what : str
        "no inertia" or "negative inertia".
    numbers : mapping of str to float
        Parameters and inputs.
    """

    q: np.ndarray
    v: np.ndarray
    what: str
    numbers: Mapping[str, float]

    def problem(self, kinematics: Kinematics) -> Problem:
        """The fault, at the joint that moves the most."""
        names, mechanism = kinematics.velocity_labels, kinematics.mechanism
        v = self.v / np.abs(self.v).max()
        involved = [j for j in np.argsort(-np.abs(v), kind="stable") if abs(v[j]) > FAINT]
        largest = names[involved[0]]
        spec = next((s for s in mechanism.joints if largest in (*s.coordinates, *s.velocities)), None)
        section = "lagrangian" if mechanism.given is None else "equations"
        path = f"joints.{spec.name}" if spec else f"{section}.{largest}"
        shown = sorted(involved)
        ratio = " : ".join(f"{v[j]:.3g}" for j in shown)
        together = f"{', '.join(names[j] for j in shown)} at the rates {ratio}"
        turning = self._turning(kinematics)
        if not turning:
            message = f"the motion of {together} has {self.what} behind it"
            return mechanism.problem(path, message, "give the bodies it moves a mass or an inertia", "EG-NO-INERTIA")
        bodies = "; ".join(f"{name!r} about ({', '.join(f'{x:.3g}' for x in axis)})" for name, axis in turning)
        message = f"the motion of {together} has {self.what} behind it: it turns {bodies} in body axes"
        name = turning[0][0]
        remedy = f"give {name!r} an inertia about that axis, or a joint that does not turn it about that axis"
        return mechanism.problem(path, message, remedy, "EG-NO-INERTIA")

    def _turning(self, kinematics: Kinematics) -> list[tuple[str, Sequence[float]]]:
        """Bodies that turn, and their axes in body axes."""
        graph, motion = kinematics.graph, kinematics.motion
        zero = dict.fromkeys(kinematics.velocity_names, 0.0)
        values = {**self.numbers, "t": 0.0, **dict(zip(kinematics.names, map(float, self.q), strict=True)), **zero}
        rates = dict(zip(kinematics.velocity_names, map(float, self.v), strict=True))
        found: list[tuple[str, np.ndarray]] = []
        for k, body in enumerate(kinematics.mechanism.bodies):
            marker = Marker(k, Frame(vec.identity(graph), vec.zero(graph)), body.name)
            rotation = [x for row in motion.rotation(marker) for x in row]
            expressions = kinematics.resolve([*motion.angular_velocity(marker), *rotation])
            moving, still = (np.array(evaluate(expressions, values | part), dtype=float) for part in (rates, {}))
            found.append((body.name, moving[3:].reshape(3, 3).T @ (moving[:3] - still[:3])))  # drivers turn bodies too
        largest = max((float(np.linalg.norm(w)) for _, w in found), default=0.0)
        return [(name, clean(w)) for name, w in found if np.linalg.norm(w) > max(FAINT * largest, UNMOVED)]


def clean(axis: np.ndarray) -> list[float]:
    """A direction of length 1 whose first component that counts is positive; rounding is left out."""
    unit = np.round(axis / np.linalg.norm(axis), 9) + 0.0
    first = unit[np.flatnonzero(unit)[0]]
    return [float(x) + 0.0 for x in (unit if first > 0.0 else -unit)]
