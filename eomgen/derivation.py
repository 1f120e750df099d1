"""What a derivation gives: the equations, to read and to count; :class:`~.api.equations.Equations` compiles them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

from .equations import TreeEquations
from .equations.reduction import reduce_to_independent
from .graph.core import Expr
from .graph.count import Operations, count
from .kinematics import Kinematics
from .kinematics.mobility import Mobility
from .kinematics.report import MechanismReport, report
from .kinematics.state import acceleration_name
from .notation.notation import Notation
from .records import dataclass
from .texts import html_text

if TYPE_CHECKING:
    from .program.choice import Choice

READABLE = 400  #: operations up to which equations are shown written out


@dataclass(frozen=True)
class Derivation:
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

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates."""
        return self.mobility.independent

    @property
    def accelerations(self) -> tuple[str, ...]:
        """Names of the accelerations that ``mass_matrix`` and ``force`` are for."""
        k = self.kinematics
        return tuple(acceleration_name(k.velocity_names[k.velocity_labels.index(n)]) for n in self.independent)

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
        """Unknowns and entries of the linear system of a method that keeps reactions as unknowns; else None."""
        system = self.tree.system
        return None if system is None else (len(system.unknowns), len(system.places))

    # -- SymPy's side -------------------------------------------------------------------------------------------------
    def _symbols(self, names: Sequence[str]) -> tuple[Any, ...]:
        import sympy

        return tuple(sympy.Symbol(name) for name in names)

    @property
    def q(self) -> tuple[Any, ...]:
        """Coordinates of the spanning tree, SymPy symbols."""
        return self._symbols(self.kinematics.names)

    @property
    def v(self) -> tuple[Any, ...]:
        """Velocities of the spanning tree, SymPy symbols."""
        return self._symbols(self.kinematics.velocity_names)

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Parameters, SymPy symbols."""
        return self._symbols(self.kinematics.parameter_names)

    @cached_property
    def _embedded(self) -> tuple[tuple[tuple[Expr, ...], ...], tuple[Expr, ...]]:
        m = self.kinematics.mechanism
        values = {p.name: 1.0 + 0.1 * k if p.value is None else p.value for k, p in enumerate(m.parameters)}
        values |= {u.name: u.value for u in m.inputs} | {"t": 0.0}
        return reduce_to_independent(self.kinematics, self.mobility, self.tree, values)

    @cached_property
    def _raised(self) -> tuple[list[tuple[Any, Any]], Any, Any]:
        import sympy

        from .graph.sympy_raise import inlined_size, raise_inline, raise_named

        matrix, force = self._embedded
        flat = [*(x for row in matrix for x in row), *force]
        if inlined_size(flat) <= READABLE * len(flat):
            named: list[tuple[Any, Any]] = []
            raised = raise_inline(flat)
        else:
            named, raised = raise_named(flat)
        n = len(force)
        return named, sympy.Matrix(n, n, raised[: n * n]), sympy.Matrix(n, 1, raised[n * n :])

    @property
    def mass_matrix(self) -> Any:
        """sympy.Matrix (n, n), n the degrees of freedom."""
        return self._raised[1]

    @property
    def force(self) -> Any:
        """sympy.Matrix (n, 1): ``mass_matrix * v' = force``."""
        return self._raised[2]

    @property
    def intermediates(self) -> list[tuple[Any, Any]]:
        """Named subexpressions of a large mass matrix and force, in order: (symbol, expression); empty when small."""
        return self._raised[0]

    @cached_property
    def notation(self) -> Notation:
        """How names are printed: ``.latex("theta1_dot")``, ``.text(name)``, ``.html(name)``, ``.mathtext(name)``."""
        k = self.kinematics
        outputs = [output.name for output in k.mechanism.outputs]
        rates = [*k.velocity_names, *map(acceleration_name, k.velocity_names)]
        names = [*k.names, *k.loop_coordinates.names, *k.parameter_names, *k.input_names, *outputs, *rates]
        return Notation(names, k.mechanism.latex, k.mechanism.instances)

    # -- display
    def __str__(self) -> str:
        lines = [f"equations of {self.name}, method {self.method}, independent {', '.join(self.independent) or 'none'}"]
        for name, operations in self.operations.items():
            lines.append(f"  {name:<22}{operations.total:>7} operations")
        if self.system_size is not None:
            unknowns, entries = self.system_size
            lines.append(f"  linear system of {unknowns} unknowns, {entries} entries that do not vanish")
        if self.choice is not None:
            lines.append(f"  {self.choice}")
        return "\n".join(lines)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<pre style='font-family:monospace'>{html_text(str(self))}</pre>"

    def _repr_latex_(self) -> str | None:
        from .graph.sympy_raise import inlined_size

        matrix, force = self._embedded
        flat = [*(x for row in matrix for x in row), *force]
        if inlined_size(flat) > READABLE:
            return None
        import sympy

        rates = [sympy.Symbol(name) for name in self.accelerations]
        symbols = self.mass_matrix.free_symbols | self.force.free_symbols | {*rates}
        names = self.notation.symbol_names(symbols)
        left, vector, right = (
            sympy.latex(part, symbol_names=names) for part in (self.mass_matrix, sympy.Matrix(rates), self.force)
        )
        return f"$\\displaystyle {left} {vector} = {right}$"
