"""Stage numeric: constraints and mass matrix of a state -> projected states, accelerations, assembled loops.

The algorithms of closed loops in NumPy.  They are the reference for the C templates, drive the ``numpy`` target, serve
the mobility analysis when a model is derived and the assembly at run time.  All of them work on scaled quantities
(:class:`~.scales.Scales`), so that metres or millimetres make no difference.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .assembly_velocity import VelocityEquations, assemble_velocity
    from .constraint_system import Assembly, ConstraintSystem, CutJoints
    from .dependent import kinematics, solve_dependent
    from .embedded import Terms, accelerate, embed, embedded_mass, jacobian, rhs, unpack_terms
    from .held_path import follow
    from .partitions import Partition, partition
    from .projection import correct_position, correct_velocity, project, tangent_projector
    from .ranks import Rank, conditioning, independent_rows, rank, redundant_rows
    from .scales import Scales

#: Where each name is defined; loaded on first use, because a module that only evaluates needs none of them.
_HOMES = {
    "Assembly": "constraint_system",
    "ConstraintSystem": "constraint_system",
    "CutJoints": "constraint_system",
    "Partition": "partitions",
    "Rank": "ranks",
    "Scales": "scales",
    "Terms": "embedded",
    "VelocityEquations": "assembly_velocity",
    "accelerate": "embedded",
    "assemble_velocity": "assembly_velocity",
    "choose_independent": "independent_columns",
    "conditioning": "ranks",
    "correct_position": "projection",
    "correct_velocity": "projection",
    "embed": "embedded",
    "embedded_mass": "embedded",
    "follow": "held_path",
    "independent_rows": "ranks",
    "jacobian": "embedded",
    "kinematics": "dependent",
    "partition": "partitions",
    "project": "projection",
    "rank": "ranks",
    "redundant_rows": "ranks",
    "rhs": "embedded",
    "solve_dependent": "dependent",
    "tangent_projector": "projection",
    "unpack_terms": "embedded",
}

__all__ = [
    "Assembly",
    "ConstraintSystem",
    "CutJoints",
    "Partition",
    "Rank",
    "Scales",
    "Terms",
    "VelocityEquations",
    "accelerate",
    "assemble_velocity",
    "choose_independent",
    "conditioning",
    "correct_position",
    "correct_velocity",
    "embed",
    "embedded_mass",
    "follow",
    "independent_rows",
    "jacobian",
    "kinematics",
    "partition",
    "project",
    "rank",
    "redundant_rows",
    "rhs",
    "solve_dependent",
    "tangent_projector",
    "unpack_terms",
]


def __getattr__(name: str) -> Any:
    """Load a public name on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    return value
