"""Frozen types of the stage program: which functions to generate, of which inputs, sharing which values.

Values that depend on parameters alone are hoisted: computed once for a set of parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from itertools import chain
from math import prod
from typing import TYPE_CHECKING, Any

from ..base.kernel_table import Sizes
from ..expr.core import LEAVES, Expr, Graph, reachable
from ..expr.records import Record
from ..expr.schedule import Operations
from ..mechanics.methods.tree_equations import LinearSystem

if TYPE_CHECKING:
    from .contact_columns import ContactColumns

COMPOSED = ("mass_times", "bias", "constraint_jacobian", "gamma")  #: what M, h, C_q and gamma are put together from
RATES = ("rates", "moved", "rates_along")  #: blocks of given q' = N v + b

#: Blocks of the right-hand side of loops, and those that are tried before them where that pays.
BY_SYSTEM, BY_MOTIONS = ("closing", "dynamics"), ("short_closing", "short_dynamics")

#: Blocks behind the Jacobian of loops: of the state, and of a direction of q and of v.
BY_BODIES = ("loop_slopes", "slopes_by_position", "slopes_by_velocity")

#: Kernels that are derivatives by something other than the state -> what.
SHIFTS = {"input_jacobian": "input", "parameter_jacobian": "parameter"}

#: Kernels whose columns are derivatives along directions where they are not written out -> the block of one.
ALONG = {"dae_jacobian": "dae_tangent", "inverse_dynamics_derivatives": "inverse_tangent"}

#: Of states of contacts: M of the bodies and h, operands of the sums, the residual along wrenches on their bodies.
COLUMNS = ("contact_terms", "contact_operands", "contact_loads")

#: Blocks that only trees have whose accelerations are known without their mass matrix.
BY_COLUMNS = ("mass_times", "acceleration_tangent", "input_acceleration", "parameter_acceleration")


def flat(rows: Iterable[Sequence[Expr]]) -> tuple[Expr, ...]:
    """Rows one after the other."""
    return tuple(chain.from_iterable(rows))


def hoist(graph: Graph, roots: Sequence[Expr], parameters: Sequence[str]) -> tuple[tuple[Expr, ...], frozenset[int]]:
    """Operations of parameters and numbers only that something else uses, ascending by id; and ids of all of them."""
    nodes = graph.nodes
    names = frozenset(parameters)
    fixed: set[int] = set()  # leaves included
    inner: set[int] = set()
    hoisted: set[int] = set()
    for i in reachable(graph, (y.id for y in roots)):
        node = nodes[i]
        if node[0] in LEAVES:
            if node[0] == "const" or node[1] in names:
                fixed.add(i)
        elif all(k in fixed for k in node[1:]):
            fixed.add(i)
            inner.add(i)
        else:
            hoisted.update(k for k in node[1:] if k in inner)
    hoisted.update(y.id for y in roots if y.id in inner)
    return tuple(Expr(graph, i) for i in sorted(hoisted)), frozenset(inner)


class Limits(Record):
    """Sizes at which the generated code changes its form; every field changes the sources."""

    #: trees whose mass matrix takes no more to factor than that of a chain of so many velocities get a straight-line
    #: rhs, larger ones loops
    unrolled: int = 24
    unrolled_loops: int = 4_000  #: loops get a straight-line rhs where factors take at most so many multiplications
    jacobian_nodes: int = 10_000  #: above so many estimated operations the Jacobian is made direction by direction
    jacobian_recursive: int = 40_000  #: the same of one made by recursion over composite bodies
    #: pairs of bodies in contacts between groups above which derivatives are made direction by direction: each pair has
    #: up to 36 entries, which as text take some 10 kB, against 1 kB a body of one direction
    jacobian_pairs: int = 64
    statements: int = 1500  #: statements in one generated function at most
    #: Functions of more operations go through alike bodies in loops.  Measured (benchmark big_trees) on open
    #: spatial chains, microseconds of loops and of text without: 3.2 and 3.0 at 12,000 operations, 6.1 and 6.5 at
    #: 25,000, 23 and 32 at 103,000, where text without loops takes 10 times as long to compile.
    rolled: int = 16_000
    #: The same where all functions together are longer than ``long``, so that they take long to compile.  Measured
    #: (benchmark tracks) on a chain of 49 links round wheels: 13 s of work to compile it instead of 36 s.
    rolled_of_long: int = 2_500
    long: int = 50_000
    #: Functions of mechanisms with more first-order states go through these in loops too, whatever their length.
    #: Measured on a cart with two wheels on a bed of soil: 4 kB of text for each cell of three states instead of 14, in
    #: the same time of a call, 3.4 us for 40 cells and 15 us for 200.
    states: int = 60
    #: Functions of more operations are searched for what repeats itself without a mark of the graph (constraint rows,
    #: their factor, derivatives).  Short loops keep more in memory, so the two blocks of the right-hand side of loops
    #: are searched only above the second number.  Measured (rows of 160 and 320 four-bars), microseconds of loops and
    #: of text without: 22 and 17 at 25,000 operations, 41 and 50 at 49,000, where the text without leaves the
    #: second-level cache and takes twice as long to compile.
    repeated: int = 32_000
    repeated_dynamics: int = 40_000


class Port(Record):
    """A named group of inputs of a function, in order."""

    name: str
    symbols: tuple[str, ...]


class Signature:
    """What straight-line functions and drivers share: their inputs."""

    ports: tuple[Port, ...]

    @property
    def n_in(self) -> int:
        """Length of x."""
        return sum(len(port.symbols) for port in self.ports)

    @property
    def arguments(self) -> dict[str, int]:
        """Lengths of the arguments by name; [q; v] is one, x."""
        lengths = {port.name: len(port.symbols) for port in self.ports}
        return {"x": self.n_in} if tuple(lengths) == ("q", "v") else lengths


class Block(Record, Signature):
    """A straight-line function of the concatenated inputs of its ports."""

    name: str
    ports: tuple[Port, ...]
    outputs: tuple[Expr, ...]
    shape: tuple[int, ...]
    #: where one is <= 0 the function reports a singular mass matrix (status 2); NaN shows in the result
    checks: tuple[Expr, ...] = ()
    #: looked at before all else: where one is <= 0 nothing need be computed, and C for one state ends there (status 2)
    guards: tuple[Expr, ...] = ()
    public: bool = True  #: whether users call it; else only drivers do

    @property
    def inputs(self) -> tuple[str, ...]:
        """Symbol names of x, in order."""
        return tuple(s for port in self.ports for s in port.symbols)

    @property
    def roots(self) -> tuple[Expr, ...]:
        """All that is evaluated."""
        return (*self.outputs, *self.checks, *self.guards)

    @property
    def n_out(self) -> int:
        """Length of out."""
        return len(self.outputs)


class KernelDriver(Record, Signature):
    """A public function that target code with loops and Newton iterations computes from blocks."""

    name: str
    ports: tuple[Port, ...]
    shape: tuple[int, ...]
    blocks: tuple[str, ...]  #: names of the blocks it calls

    @property
    def n_out(self) -> int:
        """Length of out."""
        return prod(self.shape)


class Program(Record):
    """Everything a target needs."""

    name: str  #: prefix of all public functions
    metadata: dict[str, Any]  #: of model.json: names, sizes, units, values, shapes and operations of the kernels
    graph: Graph
    time: str
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    sizes: Sizes
    blocks: tuple[Block, ...]
    drivers: tuple[KernelDriver, ...]
    hoisted: tuple[Expr, ...]  #: of parameters only, computed once per parameter set and kept in ``c[n_p:]``
    parameter_only: frozenset[int]  #: ids of all nodes that no block evaluates: hoisted values, what they are made of
    preferred: tuple[int, ...]
    parent: tuple[int, ...]
    counts: Mapping[str, Operations]  #: per block, hoisted work apart under ``precompute``
    quaternion_slots: tuple[tuple[int, int], ...] = ()
    general_rates: bool = False
    coordinate_of: tuple[int, ...] = ()
    n_states: int = 0  #: first-order states, the last of the velocities
    limits: Limits = field(default_factory=Limits)
    system: LinearSystem | None = None
    projects: bool = True
    contacts: ContactColumns | None = None

    @property
    def has_loops(self) -> bool:
        """Whether there are constraint rows, so that states are projected."""
        return self.sizes.n_c > 0

    @property
    def precompute(self) -> Block:
        """What makes the hoisted values of the parameters."""
        return Block("precompute", (Port("p", self.parameters),), self.hoisted, (len(self.hoisted),), public=False)

    def made_before(self, block: Block) -> frozenset[int]:
        """Ids of what a block does not evaluate."""
        return frozenset() if block.name == "precompute" else self.parameter_only

    @property
    def block_names(self) -> frozenset[str]:
        """Names of all blocks."""
        return frozenset(b.name for b in self.blocks)

    def is_rolled(self, name: str) -> bool:
        """Whether a block, or ``precompute``, is so long that what is alike in it is written once."""
        if self.n_states > self.limits.states:
            return True
        long = sum(counted.total for counted in self.counts.values()) > self.limits.long
        return self.counts[name].total > (self.limits.rolled_of_long if long else self.limits.rolled)

    def is_searched(self, name: str) -> bool:
        """Whether what is alike in a block, or in ``precompute``, is found without marks of the graph too."""
        limits = self.limits
        most = limits.repeated_dynamics if name in (*BY_SYSTEM, *BY_MOTIONS) else limits.repeated
        return self.counts[name].total > most

    @cached_property
    def called(self) -> frozenset[str]:
        """Operations that call functions or sums over pairs."""
        nodes, calls = self.graph.nodes, self.graph.calls
        roots = [y.id for block in self.blocks for y in block.roots] if calls else []
        return frozenset(nodes[i][0] for i in reachable(self.graph, roots)) & calls.keys()

    @cached_property
    def aliases(self) -> dict[str, str]:
        """Blocks that compute exactly what an earlier one does -> the name of that one; never blocks of drivers."""
        needed = {name for d in self.drivers for name in d.blocks}
        first: dict[tuple[object, ...], str] = {}
        result = {}
        for b in self.blocks:
            key = (b.inputs, tuple(y.id for y in b.outputs), tuple(y.id for y in b.checks))
            if first.setdefault(key, b.name) != b.name and b.name not in needed:
                result[b.name] = first[key]
        return result

    @property
    def composes_terms(self) -> bool:
        """Whether drivers put ``terms`` together from ``mass_matrix`` and ``bias``."""
        return not self.tree_by_columns and any("bias" in d.blocks for d in self.drivers)

    @property
    def by_columns(self) -> bool:
        """Whether drivers make the mass matrix, and the Jacobian of a tree, column by column."""
        return not self.block_names.isdisjoint(BY_COLUMNS)

    @property
    def tree_by_columns(self) -> bool:
        """Whether that is a tree, whose drivers need nothing else."""
        return self.by_columns and not self.has_loops

    @property
    def kernels(self) -> tuple[Block | KernelDriver, ...]:
        """The public functions, in the order of the metadata."""
        result: dict[str, Block | KernelDriver] = {b.name: b for b in self.blocks if b.public}
        result.update((d.name, d) for d in self.drivers)
        return tuple(result[name] for name in self.metadata["kernels"])
