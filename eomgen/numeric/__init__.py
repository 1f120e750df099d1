"""Stage numeric: constraints and mass matrix of a state -> projected states, accelerations, assembled loops.

The algorithms of closed loops in NumPy.  They are the reference for the C templates, drive the ``numpy`` target, serve
the mobility analysis when a model is derived and the assembly at run time.  All of them work on scaled quantities
(:class:`~.scales.Scales`), so that metres or millimetres make no difference.
"""

from .assembly import Assembly, Rates, VelocityEquations, assemble, assemble_velocity
from .continuation import follow
from .embedded import Terms, accelerate, embed, embedded_mass, jacobian, rhs, unpack_terms
from .kinematics import kinematics, solve_dependent
from .partition import Partition, partition
from .projection import correct_position, correct_velocity, project, tangent_projector
from .rank import Rank, choose_independent, conditioning, independent_rows, rank, redundant_rows
from .scales import Scales

__all__ = [
    "Assembly",
    "Partition",
    "Rank",
    "Rates",
    "Scales",
    "Terms",
    "VelocityEquations",
    "accelerate",
    "assemble",
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
