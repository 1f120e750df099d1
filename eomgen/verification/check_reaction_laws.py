"""Stage verification, check laws of reactions: friction in joints against the reactions that the module gives.

The forces are those that the equations of motion contain, in many digits.  They are held against their laws at the
reactions of :func:`~eomgen.analysis.reactions.reactions`, which are found from numbers, joint by joint.
"""

from __future__ import annotations

from copy import copy

import numpy as np

from ..analysis.reactions import reactions
from ..describe.mechanism import JointSpec
from ..forces import ReactionFriction
from ..forces.joint_reactions import reaction_symbol
from ..graph.core import Expr
from ..graph.substitute import substitute, symbols_of
from ..kinematics import Kinematics
from .bench import Bench, numbers
from .check_joints import placed
from .check_reactions import force_limit
from .comparison import Comparison
from .digits import Number
from .finding import Finding
from .rounding_sizes import UNIT
from .truth import Truth


def check(bench: Bench) -> list[Finding]:
    """One finding, of models with such friction."""
    laws = [terms for terms in bench.kinematics.forces if isinstance(terms.force, ReactionFriction)]
    if not laws or bench.layout.metadata.get("wrenches") is None or not bench.layout.projects:
        return []
    found = Comparison("friction: laws at the joints' reactions")
    specs = {spec.name: spec for spec in bench.mechanism.joints}
    forces = [terms.force for terms in laws if isinstance(terms.force, ReactionFriction)]
    loads = [load.value for terms in laws for load in terms.coordinate_loads]
    for k, truth in enumerate(bench.truths):
        case = truth.case
        wrenches = reactions(bench.module, case.t, case.x, p=case.p, u=case.u)
        carried = dict(zip(bench.layout.metadata["joint_names"], wrenches, strict=True))
        loose = force_limit(bench, k, truth, wrenches)
        acting = numbers(truth.system.evaluate("friction by reactions", lambda: loads, truth.values))
        expected, slopes = np.transpose([_law(truth, f, specs[f.joint], carried[f.joint]) for f in forces])
        limit = slopes * loose + (1.0 + np.abs(slopes)) * UNIT * np.abs(expected) * len(bench.layout.bodies)
        found.add(k, acting - expected, limit, float(np.abs(expected).max()), [f.name for f in forces])
    return [found.finding()]


def _law(truth: Truth, force: ReactionFriction, spec: JointSpec, wrench: np.ndarray) -> tuple[float, float]:
    """The force of a law at a reaction (ground axes), and how much it grows with that."""
    axis = numbers([row[2] for row in placed(truth, spec.successor, f"{spec.name} S").rotation])
    along = float(wrench[:3] @ axis)
    across = float(np.linalg.norm(wrench[:3] - along * axis))
    values = [_value(truth, force, *pair) for pair in ((across, along), (across + 1.0, along), (across, along + 1.0))]
    grown = abs(values[1] - values[0]) + abs(values[2] - values[0])
    return float(values[0]), float(grown)


def _value(truth: Truth, force: ReactionFriction, across: float, along: float) -> Number:
    kinematics, number = truth.system.kinematics, truth.mp.mpf
    names = [reaction_symbol(kinematics.graph, force.joint, k).node[1] for k in range(3)]
    carried = dict(zip(names, (number(across), truth.zero, number(along)), strict=True))
    outputs = truth.system.evaluate(f"law of {force.name}", lambda: [_open(kinematics, force)], truth.values | carried)
    return outputs[0]


def _open(kinematics: Kinematics, force: ReactionFriction) -> Expr:
    """The force of an element in terms of the state and of the joint's reaction."""
    motion = copy(kinematics.motion)
    motion.carried = {}
    law = force.along(*force.path.measure(motion))
    mapping = motion.derived_symbols(kinematics.mechanism, symbols_of([law]))
    return substitute([law], mapping)[0] if mapping else law
