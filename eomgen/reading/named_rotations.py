"""Stage reading, rotations: expressions -> the same with R_11, R_12, ... for the entries of rotations."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.core import Expr
from ..graph.substitute import substitute, symbols_of
from ..kinematics import Kinematics
from ..simplify import joined_nodes

FEW = 600  #: operations up to which expressions are shorter to read without these names


def name_rotations(kinematics: Kinematics, expressions: Sequence[Expr]) -> tuple[list[Expr], list[tuple[str, Expr]]]:
    """Expressions in which nodes of one function are one, and names that stand in long ones for rotations.

    The rotation of a joint in Euler parameters is R; of several joints, R_<joint>.
    """
    turning = [
        (kinematics.mechanism.joints[branch.joint].name, link.joint_rotation)
        for branch, link in zip(kinematics.topology.branches, kinematics.links, strict=True)
        if kinematics.mechanism.joints[branch.joint].joint.quaternion_slots
    ]
    stems = [f"R_{joint}_" if len(turning) > 1 else "R_" for joint, _ in turning]
    entries = [
        (f"{stem}{i + 1}{j + 1}", rotation[i][j])
        for stem, (_, rotation) in zip(stems, turning, strict=True)
        for i in range(3)
        for j in range(3)
    ]
    values = [x for _, x in entries]
    joined, _ = joined_nodes([*expressions, *values], (), kinematics.euler_parameters)
    whole, values = joined[: len(expressions)], joined[len(expressions) :]
    if not entries:
        return whole, []
    from ..graph.sympy_raise import inlined_size

    if inlined_size(whole) <= FEW:
        return whole, []
    taken = symbols_of(whole)
    graph = whole[0].graph
    named = {x: name for (name, _), x in zip(entries, values, strict=True) if len(x.node) > 2 and name not in taken}
    found = substitute(whole, {x: graph.symbol(name) for x, name in named.items()})
    used = symbols_of(found)
    return found, [(name, x) for x, name in named.items() if name in used]
