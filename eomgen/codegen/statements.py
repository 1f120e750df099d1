"""A straight-line block -> statements in order, in pieces of bounded length, with the work slots between them.

Statements of alike branches stand side by side, sines and cosines of angles in groups.  :mod:`.c_text` and
:mod:`.python_text` print the pieces.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from math import prod
from typing import Any, NamedTuple

from ..base.operations import CONDITION, operations_with
from ..expr.core import LEAVES, Expr, Graph
from ..expr.records import Record
from ..expr.schedule import chunk, order
from .program import Block, Program

#: Operations on pairs; both signs of a sum are one, since signs may differ.
PAIRED = {"add": "+", "sub": "+", "mul": "*", "div": "/", "neg": "-", "sin": "sin", "cos": "cos"}
#: Vectors have to save such a part of the statements: they hold twice as many values, and registers are few.
WORTH = 0.125

Operand = tuple[int, int, int]  #: of the first branch, of the second, sign of the second


class Pairs(NamedTuple):
    """Statements that are computed together, by that of the first branch."""

    second: Mapping[int, int]  #: that of the second branch
    sign: Mapping[int, int]  #: 1, or -1 where the vector holds minus the value of the second
    operands: Mapping[int, list[Operand]]

    def in_order(self, graph: Graph, sequence: Sequence[int]) -> list[int]:
        """The statements with those of a pair side by side, each after its operands."""
        nodes, first = graph.nodes, {b: a for a, b in self.second.items()}
        inside, done = set(sequence), set[int]()
        result: list[int] = []
        for root in sequence:
            stack = [root]
            while stack:
                i = stack[-1]
                if i in done:
                    stack.pop()
                    continue
                a = first.get(i, i)
                unit = (a, self.second[a]) if a in self.second else (a,)
                waiting = [k for j in unit for k in nodes[j][1:] if k in inside and k not in done]
                if waiting:
                    stack.extend(reversed(waiting))
                else:
                    stack.pop()
                    result += unit
                    done.update(unit)
        return result


def alike_coordinates(program: Program) -> dict[str, str]:
    """Coordinates and velocities of branches of the tree -> those of a neighbour of the same shape."""
    children: dict[int, list[int]] = defaultdict(list)
    for k, above in enumerate(program.parent):
        children[above].append(k)
    shapes: dict[int, tuple[object, ...]] = {}
    for k in range(len(program.parent) - 1, -1, -1):
        shapes[k] = tuple(shapes[c] for c in children[k])
    result: dict[str, str] = {}
    slots = {k for start, _ in program.quaternion_slots for k in range(start, start + 4)}

    def pair(a: int, b: int) -> None:
        result[program.velocities[a]] = program.velocities[b]
        at, to = program.coordinate_of[a], program.coordinate_of[b]
        if at >= 0 and to >= 0 and not {at, to} & slots:
            result[program.coordinates[at]] = program.coordinates[to]
        for c, d in zip(children[a], children[b], strict=True):
            pair(c, d)

    open_ends = [-1]
    while open_ends:
        free: dict[tuple[object, ...], int] = {}
        for c in children[open_ends.pop()]:
            other = free.pop(shapes[c], None)
            if other is None:
                free[shapes[c]] = c
            else:
                pair(other, c)
        open_ends += free.values()
    return result


def find_pairs(program: Program, sequence: Sequence[int], wanted: Collection[int]) -> Pairs | None:
    """The pairs of a block, if they are worth it; ``wanted`` are its results and checks."""
    alike = alike_coordinates(program)
    if not alike:
        return None
    finder = _Finder(program, sequence)
    for one, other in alike.items():
        finder.join(program.graph.symbol(one).id, program.graph.symbol(other).id)
    finder.find()
    finder.set_signs()
    finder.leave_lonely(wanted)
    return finder.pairs() if finder.saved(wanted) >= WORTH * len(sequence) else None


class _Finder:
    """What is known of the pairs of one list of statements."""

    def __init__(self, program: Program, sequence: Sequence[int]) -> None:
        self.nodes, self.sequence = program.graph.nodes, sorted(sequence)
        self.inside = frozenset(sequence)
        self.constant = program.parameter_only
        self.second: dict[int, int] = {}
        self.first: dict[int, int] = {}
        self.sign: dict[int, int] = {}
        self.operands: dict[int, list[Operand]] = {}
        self.joined: set[int] = set()
        self.users: dict[int, list[int]] = defaultdict(list)
        for i in self.sequence:
            for k in self.nodes[i][1:]:
                self.users[k].append(i)

    def join(self, a: int, b: int) -> None:
        self.second[a], self.first[b], self.sign[a] = b, a, 1

    def _stand_in(self, k: int) -> int | str:
        """What stands for an operand in a key: numbers, and what parameters alone make, may differ."""
        return "number" if self.nodes[k][0] == "const" else "given" if k in self.constant else k

    def _key(self, operation: str, operands: Iterable[int | str]) -> tuple[int | str, ...]:
        kind = PAIRED[operation]
        return (kind, *(sorted(operands, key=str) if kind in "+*" else operands))

    def find(self) -> None:
        """Join statements whose operands are joined, equal, or numbers; of several those with the nearest numbers."""
        nodes = self.nodes
        like: dict[tuple[int | str, ...], list[int]] = defaultdict(list)
        for i in self.sequence:
            if nodes[i][0] in PAIRED:
                like[self._key(nodes[i][0], map(self._stand_in, nodes[i][1:]))].append(i)
        seen: set[tuple[int | str, ...]] = set()
        for i in self.sequence:
            node = nodes[i]
            if node[0] not in PAIRED or i in self.second or i in self.first:
                continue
            operands = node[1:]
            if not any(k in self.second for k in operands) or any(k in self.first for k in operands):
                continue
            key = self._key(node[0], map(self._stand_in, operands))
            other = self._key(node[0], (self.second.get(k, self._stand_in(k)) for k in operands))
            if key in seen:
                continue
            seen.add(key)
            if other in like:
                self._match(like[key], like[other])
            else:
                self._match_symbols(i)

    def _number(self, i: int) -> float:
        return next((abs(self.nodes[k][1]) for k in self.nodes[i][1:] if self.nodes[k][0] == "const"), 0.0)

    def _match(self, ours: Sequence[int], theirs: Sequence[int]) -> None:
        near = sorted((abs(self._number(a) - self._number(b)), a, b) for a in ours for b in theirs)
        for _, a, b in near:
            if not any(k in known for k in (a, b) for known in (self.second, self.first)):
                self.join(a, b)

    def _match_symbols(self, i: int) -> None:
        """Join a statement with a symbol of its own, such as an input, if one statement alone is like it."""
        operands = self.nodes[i][1:]
        symbols = [k for k in operands if self._is_free(k)]
        joined = [k for k in operands if k in self.second]
        if len(operands) != 2 or len(symbols) != 1 or len(joined) != 1:
            return
        kind = PAIRED[self.nodes[i][0]]
        like = [
            (j, k)
            for j in self.users[self.second[joined[0]]]
            if PAIRED.get(self.nodes[j][0]) == kind
            for place, k in enumerate(self.nodes[j][1:])
            if self._is_free(k) and (kind in "+*" or operands[place] == symbols[0])
        ]
        if len(like) == 1 and like[0][0] not in self.first and like[0][1] != symbols[0]:
            self.join(symbols[0], like[0][1])
            self.join(i, like[0][0])

    def _is_free(self, k: int) -> bool:
        return self.nodes[k][0] == "sym" and k not in self.constant and k not in self.second and k not in self.first

    def _aligned(self, a: int, b: int) -> tuple[Sequence[int], Sequence[int], bool]:
        """The operands of a pair in the order in which they belong together, and whether those of b change places."""
        ours, theirs = self.nodes[a][1:], self.nodes[b][1:]

        def fits(x: int, y: int) -> bool:
            return self.second.get(x, self._stand_in(x)) == (y if x in self.second else self._stand_in(y))

        if len(ours) == 2 and not (fits(ours[0], theirs[0]) and fits(ours[1], theirs[1])):
            return ours, theirs[::-1], True
        return ours, theirs, False

    def _belongs(self, a: int, operands: Sequence[tuple[int, int]]) -> bool:
        """Whether both statements make the same of these operands, of which those that are joined are one vector."""
        kind, theirs = PAIRED[self.nodes[a][0]], tuple(y for _, y in operands)
        in_order = theirs == tuple(self.nodes[self.second[a]][1:])
        return (in_order or kind in "+*") and all(self.second.get(x, y) == y for x, y in operands)

    def set_signs(self) -> None:
        """The sign of every second element, and the operands; products with numbers take the sign that is requested."""
        nodes = self.nodes
        free: set[int] = set()
        for a in sorted(k for k in self.second if k in self.inside):
            b = self.second[a]
            ours, theirs, changed = self._aligned(a, b)
            signs = [self.sign.get(x, 1) for x in ours]
            numbers = [nodes[x][0] == "const" for x in ours]
            if PAIRED[nodes[a][0]] == "+":
                one = (1, 1 if nodes[a][0] == "add" else -1)
                other = (1, 1 if nodes[b][0] == "add" else -1)
                other = other[::-1] if changed else other
                signed = [s * m * n for s, m, n in zip(signs, one, other, strict=True)]
                loose = [k for k in (0, 1) if numbers[k] or ours[k] in free]
                if signed[0] != signed[1] and loose:
                    k = loose[-1]
                    if not numbers[k]:
                        self._turn(ours[k])
                    signed[k] = signed[1 - k]
                self.sign[a] = signed[0] if ours[0] in self.second or ours[1] not in self.second else signed[1]
                signs = [self.sign[a] * m * n for m, n in zip(one, other, strict=True)]
            else:
                for k, number in enumerate(numbers):
                    if number:
                        signs[k] = 1 if nodes[ours[k]][1] * nodes[theirs[k]][1] >= 0.0 else -1
                self.sign[a] = 1 if nodes[a][0] in ("sin", "cos") else prod(signs)
                if nodes[a][0] == "mul" and any(numbers):
                    free.add(a)
            free.difference_update(ours)
            if self._belongs(a, list(zip(ours, theirs, strict=True))):
                self.operands[a] = list(zip(ours, theirs, signs, strict=True))
            else:
                free.discard(a)

    def _turn(self, a: int) -> None:
        """Give a product with a number the other sign."""
        self.sign[a] *= -1
        self.operands[a] = [(x, y, -s if self.nodes[x][0] == "const" else s) for x, y, s in self.operands[a]]

    def leave_lonely(self, wanted: Collection[int]) -> None:
        """Keep apart what costs more together: angles, and pairs among statements that are apart."""
        nodes = self.nodes
        angles = [k for i in self.sequence if nodes[i][0] in ("sin", "cos") for k in nodes[i][1:]]
        while angles:
            k = angles.pop()
            if k in self.inside and k not in self.constant and (k in self.operands or k in self.first):
                self.operands.pop(self.first.get(k, k), None)
                angles.extend(nodes[k][1:])
        self.joined = set(self.operands)
        changed = True
        while changed:
            changed = False
            for a in sorted(self.joined, reverse=True):
                if self._gain(a, wanted) <= 0:
                    self.joined.discard(a)
                    changed = True

    def _gain(self, a: int, wanted: Collection[int]) -> int:
        """Instructions that a pair saves, with what it takes to bring operands together and results apart."""
        b = self.second[a]
        gain = 1
        for x, y, s in self.operands[a]:
            if x in self.joined:
                gain -= s != self.sign[x]
                apart = [i for k in (x, y) for i in self.users[k] if not self._is_joined(i)]
                gain += not apart and x not in wanted and y not in wanted
            elif self.nodes[x][0] != "const" and self.nodes[a][0] not in ("sin", "cos"):
                others = [i for i in self.users[x] if i in self.joined and i != a]
                gain -= not others
        users = [i for k in (a, b) for i in self.users[k]]
        gain -= any(not self._is_joined(i) for i in users) or a in wanted or b in wanted
        return gain + any(self._is_joined(i) for i in users)

    def _is_joined(self, i: int) -> bool:
        return i in self.joined or self.first.get(i, -1) in self.joined

    def saved(self, wanted: Collection[int]) -> int:
        """Instructions that pairs save: statements, less those that bring operands together, turn them, and part."""
        brought, parted = set[Operand](), set[int]()
        for a in self.joined:
            for x, y, s in self.operands[a]:
                if self.nodes[x][0] != "const" and (x not in self.joined or s != self.sign[x]):
                    brought.add((x, y, s))
            for k in (a, self.second[a]):
                if k in wanted or any(not self._is_joined(i) for i in self.users[k]):
                    parted.add(a)
        return len(self.joined) - len(brought) - len(parted)

    def pairs(self) -> Pairs:
        """The result."""
        joined = sorted(self.joined)
        return Pairs(
            {a: self.second[a] for a in joined},
            {a: self.sign[a] for a in joined},
            {a: self.operands[a] for a in joined},
        )


Slot = int | str  #: a place in an array, or the text of one
FindPairs = Callable[[Sequence[int], Collection[int]], Pairs | None]


class PrintedFunction(Record):
    """A run of statements, printed as one function."""

    statements: tuple[int, ...]  #: node ids in order
    loads: Mapping[int, Slot]  #: node id -> slot of the work array
    stores: Mapping[int, Slot]
    results: Mapping[int, tuple[Slot, ...]]  #: node id -> places in the result
    checks: frozenset[int]  #: ids that must not be <= 0
    inlined: frozenset[int]  #: conditions that stand only in selections and checks, so need no variable


class Pieces(Record):
    """All of a block: its pieces, results that need no statement, and the work slots used."""

    pieces: tuple[PrintedFunction, ...]
    direct: tuple[tuple[int, int], ...]  #: (place in the result, id of a leaf or a hoisted value)
    checks: tuple[int, ...]  #: checks that are leaves or hoisted values
    work: int
    pairs: Pairs | None = None  #: statements that are computed together


def cut(
    graph: Graph,
    outputs: Sequence[Expr],
    checks: Sequence[Expr],
    skipped: frozenset[int],
    statements: int,
    lists: Sequence[Expr] = (),
    find: FindPairs | None = None,
    guards: Sequence[Expr] = (),
) -> Pieces:
    """Order the statements behind outputs and checks and cut them into pieces.

    Operations ``skipped`` are not evaluated here, being hoisted; ``lists`` are made too.  A piece has so many
    ``statements`` at most; what is longer is cut into pieces of at most half of that, which compile faster.  ``find``
    makes of statements, results and checks the pairs that stay together and cross in places side by side.  ``guards``
    are checks that come before all that they do not need.
    """
    nodes = graph.nodes
    places: dict[int, list[int]] = {}
    for k, y in enumerate(outputs):
        places.setdefault(y.id, []).append(k)
    wanted = [*outputs, *checks, *guards, *lists]
    every = dict.fromkeys((*order(guards), *order(wanted)))
    sequence = _pair(graph, [i for i in every if i not in skipped])
    check_ids = {y.id for y in (*checks, *guards)}
    pairs = None if find is None else find(sequence, {*places, *check_ids})
    second: Mapping[int, int] = {}
    if pairs is not None:
        sequence, second = pairs.in_order(graph, sequence), pairs.second
    longest = statements if len(sequence) <= statements else max(1, statements // 2)
    chunks = chunk(sequence, wanted, longest, second)
    first = {b: a for a, b in second.items()}
    last_use = {first.get(i, i): k for k, c in enumerate(chunks) for i in c.imports}
    slots: dict[int, int] = {}
    free: dict[int, list[int]] = {1: [], 2: []}  #: by number of places side by side
    work = 0
    pieces = []
    for k, c in enumerate(chunks):
        exports = dict.fromkeys(j for i in c.exports for j in _together(first.get(i, i), second))
        for i in exports:
            size = 1 + (i in second)
            if i in first:
                continue
            if not free[size]:
                free[size].append(work)
                work += size
            slots[i] = free[size].pop()
            if i in second:
                slots[second[i]] = slots[i] + 1
        pieces.append(
            PrintedFunction(
                statements=c.statements,
                loads={i: slots[i] for i in c.imports},
                stores={i: slots[i] for i in exports},
                results={i: tuple(places[i]) for i in c.statements if i in places},
                checks=frozenset(check_ids.intersection(c.statements)),
                inlined=conditions(graph, c.statements, {*c.exports, *places}, check_ids),
            )
        )
        ended = {first.get(i, i) for i in c.imports if last_use[first.get(i, i)] == k}
        for i in sorted(ended, key=slots.__getitem__, reverse=True):
            free[1 + (i in second)].append(slots[i])
    made = {i for p in pieces for i in p.statements}
    direct = tuple((k, y.id) for k, y in enumerate(outputs) if y.id not in made)
    bare = tuple(sorted(check_ids - made))
    assert all(nodes[i][0] in LEAVES or i in skipped for _, i in direct)
    return Pieces(tuple(pieces), direct, bare, work, pairs)


def _together(i: int, second: Mapping[int, int]) -> tuple[int, ...]:
    return (i, second[i]) if i in second else (i,)


def _pair(graph: Graph, sequence: list[int]) -> list[int]:
    """Put sin and cos of one argument side by side, so that a compiler makes one call of both."""
    nodes = graph.nodes
    partner: dict[int, int] = {}
    seen: dict[int, int] = {}
    for i in sequence:
        if nodes[i][0] in ("sin", "cos"):
            argument = nodes[i][1]
            if argument in seen:
                partner[seen[argument]] = i
            else:
                seen[argument] = i
    later = set(partner.values())
    result = []
    for i in sequence:
        if i in later:
            continue
        result.append(i)
        if i in partner:
            result.append(partner[i])
    return result


def conditions(graph: Graph, statements: Iterable[int], kept: Container[int], checks: Container[int]) -> frozenset[int]:
    """Conditions of this piece that are used as conditions only."""
    nodes, relations = graph.nodes, operations_with(lambda row: row.kind == CONDITION)
    result = set()
    for i in statements:
        node = nodes[i]
        if node[0] in relations and i not in kept and (i not in checks or node[0] == "lt"):
            result.add(i)
        result.difference_update(node[2:] if node[0] == "select" else node[1:])
    return frozenset(result)


def references(program: Program, block: Block) -> dict[int, str]:
    """Node id -> text, for every leaf symbol and hoisted value a block can read."""
    graph = program.graph
    texts = {graph.symbol(program.time).id: "t"}
    texts |= {graph.symbol(name).id: f"c[{k}]" for k, name in enumerate(program.parameters)}
    if program.made_before(block):
        texts |= {y.id: f"c[{len(program.parameters) + k}]" for k, y in enumerate(program.hoisted)}
    texts |= {graph.symbol(name).id: f"u[{k}]" for k, name in enumerate(program.inputs)}
    return texts | {graph.symbol(name).id: f"x[{k}]" for k, name in enumerate(block.inputs)}


CIRCULAR = ("sin", "cos")


class Angles(NamedTuple):
    """Angles whose sines and cosines are computed together."""

    first: tuple[int, ...]  #: statements that the angles are made of, in order; they come before all others
    arguments: tuple[int, ...]  #: ids of the angles


def gather_angles(
    statements: Sequence[int], node: Callable[[int], Sequence[Any]], pairs: Pairs | None = None
) -> Angles:
    """The angles of statements that do not themselves depend on a sin or cos among these; first those of pairs.

    ``node`` is the operation of a statement, with what it reads.
    """
    later: set[int] = set()
    arguments: dict[int, None] = {}
    for i in statements:
        operation, *operands = node(i)
        circular = operation in CIRCULAR
        if circular and operands[0] not in later:
            arguments[operands[0]] = None
        if circular or not later.isdisjoint(operands):
            later.add(i)
    if pairs is not None:
        arguments = _side_by_side(arguments, pairs)
    first = set(arguments)
    for i in reversed(statements):
        if i in first:
            first.update(node(i)[1:])
    return Angles(tuple(i for i in statements if i in first), tuple(arguments))


def _side_by_side(arguments: dict[int, None], pairs: Pairs) -> dict[int, None]:
    result: dict[int, None] = {}
    for operands in pairs.operands.values():
        if len(operands) == 1 and arguments.keys() >= {operands[0][0], operands[0][1]}:
            result |= {operands[0][0]: None, operands[0][1]: None}
    return result | arguments


def print_angles(operands: Sequence[str]) -> list[str]:
    """C statements that fill ``sines`` and ``cosines``, four angles at a time."""
    n = len(operands)
    lines = [f"real sines[{n}], cosines[{n}];"]
    start, sign = 0, "bits far ="
    for size, name in ((4, "four"), (2, "two"), (1, "one")):
        while n - start >= size:
            group = ", ".join(operands[start : start + size])
            lines.append(f"{sign} sincos_{name}({group}, sines + {start}, cosines + {start});")
            start, sign = start + size, "far |="
    far = [f"sincos_far({a}, sines + {k}, cosines + {k});" for k, a in enumerate(operands)]
    if n <= 2:
        return [*lines, f"if (any_far(far)) {{ {' '.join(far)} }}"]
    return [*lines, "if (any_far(far)) {", *(f"    {line}" for line in far), "}"]
