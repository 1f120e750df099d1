"""Stage emit: a list of statements -> pairs of statements of two alike branches, which one vector operation computes.

Left and right legs, or arms, differ by numbers and by signs.  A statement of the one belongs with the statement of the
other that makes the same of what belongs together: both results are then the two elements of one vector.  The second
element may have the opposite sign, because branches that mirror each other differ so.  Every element is rounded as it
is alone, so results keep their bits, but for the sign of zero.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from ..graph.core import Graph
from ..program import Program

#: Operations on pairs; both signs of a sum are one, since signs may differ.
PAIRED = {"add": "+", "sub": "+", "mul": "*", "div": "/", "neg": "-", "sin": "sin", "cos": "cos"}
#: Vectors have to save such a part of the statements: they hold twice as many values, and registers are few.
WORTH = 0.125

Operand = tuple[int, int, int]  #: of the first branch, of the second, sign of the second


class Pairs(NamedTuple):
    """Statements that are computed together.

    Attributes
    ----------
    second : mapping of int to int
        Statement of the first branch -> that of the second.
    sign : mapping of int to int
        Statement of the first branch -> 1, or -1 where the vector holds minus the value of the second.
    operands : mapping of int to list of Operand
        Statement of the first branch -> its operands.
    """

    second: Mapping[int, int]
    sign: Mapping[int, int]
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
    found: dict[str, str] = {}
    slots = {k for start, _ in program.quaternion_slots for k in range(start, start + 4)}

    def pair(a: int, b: int) -> None:
        found[program.velocities[a]] = program.velocities[b]
        at, to = program.coordinate_of[a], program.coordinate_of[b]
        if at >= 0 and to >= 0 and not {at, to} & slots:
            found[program.coordinates[at]] = program.coordinates[to]
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
    return found


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
        self.given = program.parameter_only
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
        return "number" if self.nodes[k][0] == "const" else "given" if k in self.given else k

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
            own = self._key(node[0], map(self._stand_in, operands))
            other = self._key(node[0], (self.second.get(k, self._stand_in(k)) for k in operands))
            if own in seen:
                continue
            seen.add(own)
            if other in like:
                self._match(like[own], like[other])
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
        return self.nodes[k][0] == "sym" and k not in self.given and k not in self.second and k not in self.first

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
        """The sign of every second element, and the operands; products with numbers take the sign that is asked for."""
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
                asked = [s * m * n for s, m, n in zip(signs, one, other, strict=True)]
                loose = [k for k in (0, 1) if numbers[k] or ours[k] in free]
                if asked[0] != asked[1] and loose:
                    k = loose[-1]
                    if not numbers[k]:
                        self._turn(ours[k])
                    asked[k] = asked[1 - k]
                self.sign[a] = asked[0] if ours[0] in self.second or ours[1] not in self.second else asked[1]
                signs = [self.sign[a] * m * n for m, n in zip(one, other, strict=True)]
            else:
                for k, number in enumerate(numbers):
                    if number:
                        signs[k] = 1 if nodes[ours[k]][1] * nodes[theirs[k]][1] >= 0.0 else -1
                self.sign[a] = 1 if nodes[a][0] in ("sin", "cos") else _product(signs)
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
            if k in self.inside and k not in self.given and (k in self.operands or k in self.first):
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


def _product(signs: Iterable[int]) -> int:
    result = 1
    for s in signs:
        result *= s
    return result
