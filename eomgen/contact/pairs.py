"""The sum over pairs of shapes as nodes, and the law of one kind of pair as a small graph of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import Any, Literal

from ..base.kernel_table import RECORD, WITNESS
from ..errors import cannot
from ..expr.core import Expr, Graph, Node, reachable, substitute
from ..expr.evaluate import Evaluator
from ..expr.functions import Function
from ..expr.records import Record
from .pair_sums import MEETING, MOTION, POSE, PairSum, pairs_of_rows

# -- pair kinds --------------------------------------------------------------------------------------------------------


PairPart = Literal["outputs", "slopes", "touch", "witness"]


class PairKind(Record):
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
        What a pair exerts (:data:`~eomgen.contact.pair_sums.RESULT` nodes), and its directional derivative.
    touch : tuple of int
        Normal (3), from the first shape to the second, penetration, and the radius about the centre of the second shape
        of what its turning moves (0 where it is round).
    witness : tuple of int
        Where they touch: :data:`~eomgen.contact.pair_sums.WITNESS` nodes for each place.
    offsets : tuple of tuple of int
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
        :mod:`~.pair_features` finds.  Of the inside of an outline and another shape: how many pieces it has, of which
        the nearest is found there.
    thin : int
        1 where the first has a far side though no bounds, so that no step may pass it; 2 where a point of the second
        may, so that its thickness alone limits steps.
    meets : tuple of int
        A node that is 0 where nothing is exerted, before costly laws; none of others.
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
    witness: tuple[int, ...]
    offsets: tuple[tuple[int, ...], ...] = ()
    states: int = 0
    calls: tuple[tuple[str, tuple[Function, tuple[int, ...]]], ...] = ()
    corners: tuple[int, ...] = ()
    thin: int = 0
    meets: tuple[int, ...] = ()
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
        return (self.states, self.offsets) if self.states else ()


# -- pair calls --------------------------------------------------------------------------------------------------------

# The law of one kind of pair is a small graph of its own (:class:`PairKind`), so that the nodes of a sum do not grow
# with the number of pairs. ``pairs <name>(given)`` holds the operands, ``pairs <name>(sum)`` and ``pairs
# <name>(slope)`` are lists of results and of their directional derivatives, ``pairs <name>(k)`` is one entry of such a
# list. ``pairs <name>(meeting)`` is a list of when shapes that are apart may meet, and of the deepest two, ``pairs
# <name>(witnesses)`` one of the pairs that are near.


#: Pairs that a list of near ones has room for: so many, and so many for each part of a shape, in the plane (heaps of
#: discs have 3 that touch, as edges of a planar graph are fewer than three for each node) and in space (heaps of equal
#: spheres have 6, of unequal ones 7).
SPARE, IN_PLANE, IN_SPACE = 16, 5, 12
LOSSES = "0"  #: begins the name of a sum of losses, as no name of a model does


@dataclass(frozen=True, eq=False)
class PairFunction:
    """A sum over pairs.

    Attributes
    ----------
    name : str
        That of the contact, behind :data:`LOSSES` for what it takes from the energy.
    bodies : int
        Ground among them.
    data : tuple of float or None
        Operands that follow the ``POSE`` numbers of each body, where they are numbers; states of pairs are the last.
    tables : tuple
        Of shapes; see :class:`~eomgen.contact.pair_sums.PairSum`.
    kinds : tuple of PairKind
    states : int
        How many states all pairs have together.
    """

    name: str
    bodies: int
    data: tuple[float | None, ...]
    tables: tuple[tuple[tuple[int, ...], ...], ...]
    kinds: tuple[PairKind, ...]
    states: int = 0

    @property
    def element(self) -> str:
        """The name of the contact, which the sum of its losses shares."""
        return self.name.removeprefix(LOSSES)

    @property
    def count(self) -> int:
        """How many operands it has."""
        return POSE * self.bodies + len(self.data)

    @property
    def results(self) -> int:
        """How many numbers it gives: six for each body, the energy, and rates of states."""
        return 6 * self.bodies + 1 + self.states

    @property
    def first_state(self) -> int:
        """The place of the first state among the operands."""
        return self.count - self.states

    @cached_property
    def holders(self) -> tuple[frozenset[int], ...]:
        """For each state the bodies on whose contact it depends."""
        result: list[set[int]] = [set() for _ in range(self.states)]
        for kind in self.kinds if self.states else ():
            first, second = self.tables[kind.first], self.tables[kind.second]
            for i, j in zip(*pairs_of_rows(first, second, kind.first == kind.second), strict=True):
                at = kind.offsets[0][i] + kind.offsets[1][j]
                for k in range(at, at + kind.states):
                    result[k] |= {first[i][0], second[j][0]}
        return tuple(map(frozenset, result))

    @cached_property
    def capacity(self) -> int:
        """How many pairs a list of near ones has room for: all, or some for each shape."""
        pairs = sum(
            len(self.tables[kind.first]) * len(self.tables[kind.second]) * (len(kind.witness) // WITNESS)
            for kind in self.kinds
        )
        each = IN_PLANE if any(kind.planar for kind in self.kinds) else IN_SPACE
        return min(pairs, SPARE + each * sum(map(len, self.tables)))

    @property
    def witnesses(self) -> int:
        """How many numbers such a list has."""
        return 1 + RECORD * self.capacity

    @cached_property
    def touching(self) -> tuple[frozenset[int], ...]:
        """For each body those with which it may be in contact."""
        result: list[set[int]] = [set() for _ in range(self.bodies)]
        for kind in self.kinds:
            first, second = ({row[0] for row in self.tables[k]} for k in (kind.first, kind.second))
            for body in first:
                result[body] |= second
            for body in second:
                result[body] |= first
        return tuple(frozenset(bodies - {k}) for k, bodies in enumerate(result))

    def evaluator(self, made: Callable[[list[Expr], Sequence[str]], Callable[[Any], Any]]) -> PairSum:
        """Its loops on numbers, with an evaluator of expressions for the laws."""
        kinds = [
            (
                *(k.first, k.second, k.extent, k.thin, k.law),
                *(self._law(k, part, made) for part in ("outputs", "slopes", "touch", "witness")),
                *k.beside,
            )
            for k in self.kinds
        ]
        return PairSum(self.bodies, self.tables, kinds, self.capacity, self.states)

    @staticmethod
    def _law(kind: PairKind, part: PairPart, made: Callable[[list[Expr], Sequence[str]], Callable[[Any], Any]]) -> Any:
        sloped = part == "slopes"
        law = made(kind.expressions(part), kind.symbols if sloped else kind.plain)
        if not kind.corners:
            return law
        from .pair_features import facing, nearest

        if len(kind.corners) == 1:
            return nearest(law, *kind.corners, sloped)
        return facing(law, (kind.corners[0], kind.corners[1]), sloped)

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__dataclass_fields__}  # loops are made anew

    @cached_property
    def in_floats(self) -> PairSum:
        """Its loops on floats and arrays."""
        return self.evaluator(Evaluator)


@dataclass(frozen=True, eq=False)
class PairCall:
    """What one node of a sum over pairs does.

    Attributes
    ----------
    function : PairFunction
    part : {'given', 'sum', 'slope', 'meeting', 'witnesses', 'item'}
    numbers : tuple of int
        Of a slope the operands that have rates; of an item its place.
    """

    function: PairFunction
    part: str
    numbers: tuple[int, ...] = ()
    native = evaluator = None
    lists = True

    @property
    def name(self) -> str:
        """Its name in formulas."""
        return "_".join([self.function.element, self.part, *map(str, self.numbers[:1])])

    def implementation(self, orders: tuple[int, ...]) -> Callable[..., Any]:
        """Its value as a function of floats or arrays."""
        return self.on_numbers(self.function.in_floats)

    def on_numbers(self, loops: PairSum) -> Callable[..., Any]:
        """Its value as a function of numbers, by given loops."""

        made: dict[str, Callable[..., Any]] = {
            "given": lambda *operands: list(operands),
            "sum": loops,
            "slope": lambda raw, *rates: loops.slope_along(raw, self.numbers, rates),
            "meeting": lambda raw, *accelerations: loops.meeting(raw, accelerations),
            "witnesses": loops.witnesses,
        }
        return itemgetter(self.numbers[0]) if self.item else made[self.part]

    def push(self, graph: Graph, i: int, tangents: Mapping[int, int]) -> int | None:
        """The tangent of its node from those of the nodes before it; None where there is none.

        Raises
        ------
        UsageError
            It is a derivative already.
        """
        ids, function = graph.nodes[i][1:], self.function
        if self.item:
            slope = tangents.get(ids[0])
            if slope is None:
                return None
            moving = graph.calls[graph.nodes[slope][0]][0]
            assert isinstance(moving, PairCall)
            return _item(graph, function, slope, self.numbers[0]) if _acts(function, moving, self.numbers[0]) else None
        if self.part == "given":
            return None
        if self.part in ("meeting", "witnesses"):
            raise cannot(f"contacts {function.element!r}: where and when shapes meet has no derivatives")
        if self.part == "slope":
            raise cannot(
                f"contacts {function.element!r}: second derivatives of contacts between groups are not made; use "
                "point_plane, sphere_plane or sphere_sphere, or do without second-order sensitivities"
            )
        operands = graph.nodes[ids[0]][1:]
        moving_numbers = tuple(k for k, j in enumerate(operands) if j in tangents)
        if not moving_numbers:
            return None
        name = f"pairs {function.name}(slope {' '.join(map(str, moving_numbers))})"
        rates = [tangents[operands[k]] for k in moving_numbers]
        return _node(graph, PairCall(function, "slope", moving_numbers), name, [ids[0], *rates])

    @property
    def item(self) -> bool:
        """Whether it is an entry of a list."""
        return self.part == "item"

    def counted(self, operation: str) -> str:
        """The name under which it is counted; that results are read from lists is no operation."""
        return "" if self.part in ("item", "given") else f"pairs {self.function.element}({self.part})"

    def in_sympy(self, operands: Sequence[Any]) -> Any:
        """An unknown function of all symbols that it depends on."""
        import sympy

        if self.part == "sum":
            return operands[0]
        if self.item:
            return sympy.Function(f"{operands[0].func}_{self.numbers[0]}")(*operands[0].args)
        symbols = sorted(set().union(*(x.free_symbols for x in operands)), key=str)
        name = self.function.name if self.part == "given" else f"{self.name}_{len(self.numbers)}"
        return sympy.Function(name)(*symbols)


def pair_call(graph: Graph, operation: str) -> PairCall | None:
    """What a node does, if it is one of a sum over pairs."""
    result = graph.calls.get(operation)
    return result[0] if result is not None and isinstance(result[0], PairCall) else None


def pairs_of_bodies(graph: Graph) -> int:
    """How many blocks of six by six the derivatives of all sums have by the motion of bodies."""
    sums = {call.function.element: call.function for call, _ in graph.calls.values() if isinstance(call, PairCall)}
    return sum(1 + len(others) for function in sums.values() for others in function.touching)


def opaque_names(graph: Graph) -> list[str]:
    """What expressions call that has no formula of its own: declared functions and sums over pairs."""
    sums = {function.function.element for function, _ in graph.calls.values() if isinstance(function, PairCall)}
    return sorted({*graph.functions, *sums})


def list_operands(graph: Graph, i: int) -> tuple[int, ...]:
    """A node itself, or what the list of operands that it is holds: a list is no number that a block can hand on."""
    call = pair_call(graph, graph.nodes[i][0])
    return graph.nodes[i][1:] if call is not None and call.part == "given" else (i,)


def _node(graph: Graph, call: PairCall, operation: str, ids: Sequence[int]) -> int:
    graph.calls[operation] = (call, ())
    return graph._node((operation, *ids))


def _list(graph: Graph, function: PairFunction, part: str, ids: Sequence[int]) -> int:
    return _node(graph, PairCall(function, part), f"pairs {function.name}({part})", ids)


def _item(graph: Graph, function: PairFunction, listed: int, k: int) -> int:
    return _node(graph, PairCall(function, "item", (k,)), f"pairs {function.name}({k})", [listed])


def pair_sum(graph: Graph, function: PairFunction, operands: Sequence[Expr]) -> list[Expr]:
    """The results of a sum over pairs as expressions."""
    ids = [x.id for x in operands]
    total = _list(graph, function, "sum", [_list(graph, function, "given", ids)])
    return [Expr(graph, _item(graph, function, total, k)) for k in range(function.results)]


def pair_meeting(
    graph: Graph, function: PairFunction, operands: Sequence[Expr], accelerations: Sequence[Expr]
) -> list[Expr]:
    """When shapes that are apart may meet, and more: see :meth:`~eomgen.contact.pair_sums.PairSum.meeting`."""
    assert len(accelerations) == MOTION * function.bodies
    raw = _list(graph, function, "given", [x.id for x in operands])
    listed = _list(graph, function, "meeting", [raw, *(x.id for x in accelerations)])
    return [Expr(graph, _item(graph, function, listed, k)) for k in range(MEETING)]


def pair_witnesses(graph: Graph, function: PairFunction, operands: Sequence[Expr]) -> list[Expr]:
    """Pairs that are near: see :meth:`~eomgen.contact.pair_sums.PairSum.witnesses`."""
    listed = _list(graph, function, "witnesses", [_list(graph, function, "given", [x.id for x in operands])])
    return [Expr(graph, _item(graph, function, listed, k)) for k in range(function.witnesses)]


def without_pairs(outputs: Sequence[Expr], listed: Sequence[Expr]) -> list[Expr]:
    """Expressions in which no pairs exert anything of sums whose near pairs are listed."""
    if not outputs or not listed:
        return []
    graph = outputs[0].graph

    def calls(result: Sequence[Expr]) -> list[tuple[int, str]]:
        nodes = ((i, pair_call(graph, graph.nodes[i][0])) for i in reachable(graph, (y.id for y in result)))
        return [(i, call.function.element) for i, call in nodes if call is not None and call.part == "item"]

    rigid = {element for _, element in calls(listed)}
    items = [Expr(graph, i) for i, element in calls(outputs) if element in rigid]
    return substitute(outputs, dict.fromkeys(items, graph.zero)) if items else list(outputs)


def _acts(function: PairFunction, moving: PairCall, item: int) -> bool:
    """Whether a result can change with what moves."""
    poses, first = POSE * function.bodies, function.first_state
    if item == 6 * function.bodies or any(poses <= k < first for k in moving.numbers):
        return True
    bodies = {k // POSE for k in moving.numbers if k < poses}
    states = {k - first for k in moving.numbers if k >= first}
    if item < 6 * function.bodies:
        body = item // 6
        return bool(bodies & {body, *function.touching[body]}) or any(body in function.holders[k] for k in states)
    state = item - 6 * function.bodies - 1
    each = min(kind.states for kind in function.kinds)  # a pair that touches at several places has a multiple
    return bool(bodies & function.holders[state]) or any(k // each == state // each for k in states)
