"""Stage graph: the law of one kind of pair of shapes as a small graph of its own."""

from __future__ import annotations

from typing import Literal

from ..records import dataclass
from .core import Expr, Graph
from .functions import Function
from .nodes import Node

PairPart = Literal["outputs", "slopes", "touch", "spot"]


@dataclass(frozen=True)
class PairKind:
    """How two shapes act on each other.

    Attributes
    ----------
    name : str
        Such as ``round_half``.
    first, second : int
        Tables of the shapes.
    planar : bool
        Whether distances count across the z axis of the first shape only.
    law : tuple of int
        Places of the law's numbers in the data.
    nodes : tuple
        The nodes of its graph, whose symbols are named in ``symbols`` by their order.
    symbols : tuple of str
        Numbers of the first shape, of the second, of the law, and then their rates.
    outputs, slopes : tuple of int
        What a pair exerts (:data:`~eomgen.numeric.pair_sums.RESULT` nodes), and its directional derivative.
    touch : tuple of int
        Normal (3), from the first shape to the second, penetration, and the radius about the centre of the second shape
        of what its turning moves (0 where it is round).
    spot : tuple of int
        Where they touch: :data:`~eomgen.numeric.pair_sums.SPOT` nodes for each place.
    held : tuple of tuple of int
        Of each row of the first table and of each of the second a number: their sum is the place of the pair's states
        among all states of the sum.  Empty without states.
    states : int
        How many states a pair has.  What it adds to their rates stands behind the results.  A number that is only
        summed, such as how many pieces of a shape touch, is one of them: 0 is given for it, and its sum stands in the
        place of its rate.
    calls : tuple of (operation, (function, orders))
        What nodes that call declared functions mean, as in a graph.
    corners : tuple of int
        Of two polygons: how many corners they have.  The numbers of the shapes are those that matter then, which
        :mod:`~eomgen.numeric.polygon_edges` finds.  Of the inside of an outline and another shape: how many pieces it
        has, of which :mod:`~eomgen.numeric.outline_pieces` finds the nearest.
    lines : tuple of (start, count)
        Of first shapes that are columns of soil: rows of the first table that stand in line along their x axis, each
        its first size farther than the one before.  Columns reach down without end, so that what is below their top
        is as near as it is beside them.
    """

    name: str
    first: int
    second: int
    planar: bool
    law: tuple[int, ...]
    nodes: tuple[Node, ...]
    symbols: tuple[str, ...]
    outputs: tuple[int, ...]
    slopes: tuple[int, ...]
    touch: tuple[int, ...]
    spot: tuple[int, ...]
    held: tuple[tuple[int, ...], ...] = ()
    states: int = 0
    calls: tuple[tuple[str, tuple[Function, tuple[int, ...]]], ...] = ()
    corners: tuple[int, ...] = ()
    lines: tuple[tuple[int, int], ...] = ()

    def graph(self) -> Graph:
        """Its nodes as a graph."""
        graph = Graph()
        graph.nodes = list(self.nodes)
        graph._ids = {node: i for i, node in enumerate(self.nodes)}
        graph.calls = dict(self.calls)
        return graph

    def expressions(self, what: PairPart = "outputs") -> list[Expr]:
        """Its results, their derivatives, or its geometry."""
        graph = self.graph()
        return [Expr(graph, i) for i in getattr(self, what)]

    @property
    def plain(self) -> tuple[str, ...]:
        """The symbols that its results depend on."""
        return self.symbols[: len(self.symbols) // 2]

    @property
    def extent(self) -> int:
        """In which directions distances count: 0 all, 1 across z of the first shape, 2 beside columns."""
        return 2 if self.lines else int(self.planar)

    @property
    def beside(self) -> tuple[int, tuple[tuple[int, ...], ...]] | tuple[()]:
        """How many states a pair has and where they stand; nothing without states."""
        return (self.states, self.held) if self.states else ()
