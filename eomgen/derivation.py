"""What a derivation gives: the equations, to read and to count; :class:`~.api.equations.Equations` compiles them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, cast

from .base.texts import fold
from .equations import TreeEquations
from .graph.copies import copied
from .graph.core import Expr
from .graph.count import Operations, count
from .kinematics import Kinematics
from .kinematics.mobility import Mobility
from .kinematics.report import MechanismReport, report
from .reading import Displayed
from .records import dataclass

if TYPE_CHECKING:
    from .program.choice import Choice


@dataclass(frozen=True)
class Derivation(Displayed):
    """What a derivation gives; :class:`~.api.equations.Equations` says what its attributes are."""

    kinematics: Kinematics = field(repr=False)
    mobility: Mobility = field(repr=False)
    tree: TreeEquations = field(repr=False)
    seconds: dict[str, float] = field(default_factory=dict, repr=False)
    choice: Choice | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        vars(self)["_derived"] = copied((self.kinematics, self.mobility, self.tree))

    def fresh(self) -> tuple[Kinematics, Mobility, TreeEquations]:
        """A copy of what was derived, in a graph of its own, as it was before anyone read or compiled anything.

        Whatever is made of expressions adds nodes to their graph, whose numbers decide on the order of sums, factors
        and statements.  What is built from such a copy depends on the model alone.
        """
        return copied(cast("tuple[Kinematics, Mobility, TreeEquations]", vars(self)["_derived"]))

    @property
    def method(self) -> str:
        """Name of the method of derivation."""
        return self.tree.method

    @cached_property
    def report(self) -> MechanismReport:
        """Bodies, joints, loops, rank, degrees of freedom, partition."""
        return report(self.kinematics, self.mobility)

    @cached_property
    def operations(self) -> dict[str, Operations]:
        """Operations of each part, counted on the graph; work that depends on parameters only is included."""
        tree, c = self.tree, self.kinematics.constraints
        parts: dict[str, Sequence[Expr]] = {"bias": tree.bias}
        if tree.accelerations is None:
            lower = [x for i, row in enumerate(tree.mass_matrix) for x in row[: i + 1]]
            parts = {"mass_matrix": lower, "bias": tree.bias, "mass_matrix and bias": [*lower, *tree.bias]}
        else:
            parts["accelerations"] = tree.accelerations
        parts |= {
            "inverse_dynamics": tree.inverse_dynamics,
            "energy": [tree.kinetic_energy, tree.potential_energy],
        }
        if tree.system is not None:
            parts["linear system"] = [*tree.system.entries, *tree.system.right]
        if c.labels:
            rows = [x for row in c.jacobian for x in row]
            parts["constraints"] = [*c.values, *rows, *c.gamma]
        return {name: count(list(part)) for name, part in parts.items()}

    @property
    def system_size(self) -> tuple[int, int] | None:
        """Unknowns and nonzero entries of the linear system, of a method with unknown reactions; else None."""
        system = self.tree.system
        return None if system is None else (len(system.unknowns), len(system.places))

    # -- display
    __repr__ = Displayed.__repr__

    @cached_property
    def _shown_text(self) -> str:
        from .reading.equations_text import equations_text

        lines = [equations_text(self), ""]
        counts = (f"{name} {operations.total}" for name, operations in self.operations.items())
        lines += fold(", ".join(counts), 80, "operations: ", "  ")
        if self.system_size is not None:
            unknowns, entries = self.system_size
            lines.append(f"  linear system of {unknowns} unknowns, {entries} nonzero entries")
        if self.choice is not None:
            lines += fold(str(self.choice), 80, "", "  ")
        return "\n".join(lines)
