"""What a derivation gives: the equations, to read and to count; :class:`~.api.equations.Equations` compiles them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, cast

from .equations import TreeEquations
from .graph.core import Expr
from .graph.count import Operations, count
from .kinematics import Kinematics
from .kinematics.mobility import Mobility
from .kinematics.report import MechanismReport, report
from .reading import Readable
from .records import dataclass
from .texts import html_text

if TYPE_CHECKING:
    from .program.choice import Choice


@dataclass(frozen=True)
class Derivation(Readable):
    """What a derivation gives; :class:`~.api.equations.Equations` says what its attributes are."""

    kinematics: Kinematics = field(repr=False)
    mobility: Mobility = field(repr=False)
    tree: TreeEquations = field(repr=False)
    seconds: dict[str, float] = field(default_factory=dict, repr=False)
    choice: Choice | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        vars(self)["_derived"] = deepcopy((self.kinematics, self.mobility, self.tree))

    def fresh(self) -> tuple[Kinematics, Mobility, TreeEquations]:
        """A copy of what was derived, in a graph of its own, as it was before anyone read or compiled anything.

        Whatever is made of expressions adds nodes to their graph, whose numbers decide on the order of sums, factors
        and statements.  What is built from such a copy depends on the model alone.
        """
        return deepcopy(cast("tuple[Kinematics, Mobility, TreeEquations]", vars(self)["_derived"]))

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.kinematics.mechanism.name

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
    def __str__(self) -> str:
        lines = [f"equations of {self.name}, method {self.method}, independent {', '.join(self.independent) or 'none'}"]
        for name, operations in self.operations.items():
            lines.append(f"  {name:<22}{operations.total:>7} operations")
        if self.system_size is not None:
            unknowns, entries = self.system_size
            lines.append(f"  linear system of {unknowns} unknowns, {entries} nonzero entries")
        if self.choice is not None:
            lines.append(f"  {self.choice}")
        return "\n".join(lines)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<pre style='font-family:monospace'>{html_text(str(self))}</pre>"

    def _repr_latex_(self) -> str | None:
        if self.intermediates:
            return None
        import sympy

        rates = [sympy.Symbol(name) for name in self.acceleration_names]
        symbols = self.mass_matrix.free_symbols | self.force.free_symbols | {*rates}
        names = self.notation.symbol_names(symbols)
        left, vector, right = (
            sympy.latex(part, symbol_names=names) for part in (self.mass_matrix, sympy.Matrix(rates), self.force)
        )
        return f"$\\displaystyle {left} {vector} = {right}$"
