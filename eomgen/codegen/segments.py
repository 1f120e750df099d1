"""A straight-line block -> alike segments of its statements, each kind to be written once, as a loop.

A recursion over a big tree does the same for many bodies, but for where it reads and writes.  The graph marks where the
part of another body begins.  Statements between two marks are a segment; segments whose statements are the same
function of what they read are of one kind.  What has no marks is cut where it repeats itself.  Statements stay in the
order in which the graph was made, but that the segments of one body in several passes come together where what they
read allows; segments of several kinds that take turns are one, so that less is read from memory member by member.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from functools import partial
from heapq import heapify, heappop, heappush
from itertools import chain, groupby

import numpy as np

from ..expr.core import LEAVES, Graph, parts, reachable
from ..expr.records import Record
from .pair_sums import PairLists
from .program import Block, Program
from .statements import CIRCULAR

#: ("x", 3): a place in an array; ("const", 2.0); ("t", 0).
Place = tuple[str, float]
#: Statements with what they read by number, and which of them are checked or are results, how often.
Signature = tuple[object, ...]
Segment = tuple[int, ...]  #: statements in order


class SegmentReader:
    """Segments -> what they are made of, apart from where they read."""

    def __init__(
        self,
        graph: Graph,
        known: Mapping[int, Place],
        results: Mapping[int, tuple[int, ...]],
        checked: Collection[int],
        single: Collection[int],
    ) -> None:
        self.nodes, self.known, self.results, self.checked = graph.nodes, known, results, checked
        self.single = single
        self.signatures: dict[tuple[int, ...], tuple[Signature, tuple[int, ...]]] = {}

    def read(self, segment: Segment) -> tuple[Signature, tuple[int, ...]]:
        """The signature of a segment, and what it reads from outside in order of first use."""
        if segment not in self.signatures:
            self.signatures[segment] = self._read(segment)
        return self.signatures[segment]

    def letters(self, segment: Sequence[int]) -> list[Signature]:
        """What each statement of a segment is like: where it reads, and whether others need it, but not which."""
        nodes, known = self.nodes, self.known
        result = []
        for i in segment:
            node = nodes[i]
            letter: list[object] = [node[0]]
            for j in node[1:]:
                place = known.get(j)
                letter.append("w" if place is None else place[0])
            letter += [len(self.results.get(i, ())), i in self.checked]
            result.append(tuple(letter))
        return result

    def _read(self, segment: Sequence[int]) -> tuple[Signature, tuple[int, ...]]:
        nodes, known = self.nodes, self.known
        local = {i: k for k, i in enumerate(segment)}
        numbers: dict[int, int] = {}
        signature: list[object] = []
        for i in segment:
            node = nodes[i]
            signature.append((node[0], i) if i in self.single else node[0])
            for j in node[1:]:
                if j in self.single and j not in self.known:
                    continue  # a list
                at = local.get(j)
                if at is None:
                    at = numbers.get(j)
                    if at is None:
                        numbers[j] = at = -1 - len(numbers)
                        place = known.get(j)
                        signature.append("w" if place is None else place[0])
                signature.append(at)
            if i in self.results:
                signature.append((len(self.results[i]),))
            if i in self.checked:
                signature.append("check")
        return tuple(signature), tuple(numbers)


FEW = 3  #: segments of fewer members are not worth a loop
#: A repeat saves the text of so many statements, or is left alone: a loop is a function of its own, which keeps what
#: others read in memory.
WORTH = 60


def find_repeats(letters: Sequence[Hashable], longest: int, worth: int = WORTH) -> list[tuple[int, int, int]]:
    """Start, period and count of stretches that repeat themselves, in order, none overlapping another.

    ``letters`` are equal for statements that may be alike, ``longest`` is the longest period, and a repeat spares
    ``worth`` statements at least.
    """
    numbers: dict[Hashable, int] = {}
    text = np.array([numbers.setdefault(x, len(numbers)) for x in letters], dtype=np.int32)
    waiting = []
    for period in range(1, min(longest, len(text) // FEW) + 1):
        waiting += [_offer(start, period, end) for start, end in _stretches(text, period, worth)]
    heapify(waiting)
    taken = np.zeros(len(text), dtype=bool)
    result = []
    while waiting:
        _, period, start, end = heappop(waiting)
        free = _free_parts(taken, start, end)
        if free == [(start, end)]:
            count = (end - start) // period
            result.append((start, period, count))
            taken[start : start + count * period] = True
            continue
        for first, last in free:
            if _saved(first, period, last) >= worth:
                heappush(waiting, _offer(first, period, last))
    return sorted(result)


def _saved(start: int, period: int, end: int) -> int:
    """Statements that need not be written; none of too few members."""
    count = (end - start) // period
    return (count - 1) * period if count >= FEW else 0


def _offer(start: int, period: int, end: int) -> tuple[int, int, int, int]:
    return -_saved(start, period, end), period, start, end


def _stretches(text: np.ndarray, period: int, worth: int) -> list[tuple[int, int]]:
    """Start and end of all that repeat themselves after a period and are worth a loop."""
    unlike = np.flatnonzero(text[period:] != text[:-period])
    edges = np.concatenate(([-1], unlike, [len(text) - period]))
    starts, ends = edges[:-1] + 1, edges[1:] + period
    count = (ends - starts) // period
    good = (count >= FEW) & ((count - 1) * period >= worth)
    return list(zip(starts[good].tolist(), ends[good].tolist(), strict=True))


def _free_parts(taken: np.ndarray, start: int, end: int) -> list[tuple[int, int]]:
    """What of a stretch is not taken."""
    free = np.concatenate(([True], taken[start:end], [True]))
    edges = np.flatnonzero(free[1:] != free[:-1]) + start
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


PERIOD = 16  #: kinds that alternate at most
CALLS = 8  #: of functions that have to be spared


def _alternating(reader: SegmentReader, segments: Sequence[Segment], longest: int) -> list[Segment]:
    """Segments; groups of them that repeat themselves are one where that makes members of one kind."""
    result: list[Segment] = []
    done = 0
    for start, period, count in find_repeats([reader.read(segment)[0] for segment in segments], PERIOD, CALLS):
        groups = [segments[k : k + period] for k in range(start, start + count * period, period)]
        if period == 1 or sum(map(len, groups[0])) > longest or any(s[0] in reader.single for s in groups[0]):
            continue
        result += segments[done:start]
        done = start + count * period
        joined = [sum(group, ()) for group in groups]
        kinds = Counter(reader.read(one)[0] for one in joined)
        commonest, often = kinds.most_common(1)[0]
        for group, one in zip(groups, joined, strict=True):
            result += [one] if often >= FEW and reader.read(one)[0] == commonest else group
    return [*result, *segments[done:]]


class SegmentKind(Record):
    """Segments that are the same function of what they read."""

    members: tuple[tuple[int, ...], ...]  #: statements of every segment, in order of evaluation
    reads: tuple[tuple[int, ...], ...]  #: ids that every segment reads from outside, numbered alike
    #: indices of statements that later segments read; place ``k`` of the block of member ``m`` holds entry k
    exports: tuple[int, ...]
    start: int  #: where in the work array the blocks of the members begin


class Segments(Record):
    """All of a block."""

    kinds: tuple[SegmentKind, ...]
    runs: tuple[tuple[int, int], ...]  #: number of a kind, and how many of its members come next
    #: symbols whose sines and cosines are computed first, from places 0 and ``len(angles)`` of the work array on
    angles: tuple[int, ...]
    places: Mapping[int, Place]  #: where each value is that a segment reads from outside
    results: Mapping[int, tuple[int, ...]]  #: node id -> places in the result
    checks: frozenset[int]
    lists: PairLists  #: of sums over pairs; each is a segment by itself
    work: int

    @property
    def written(self) -> int:
        """Statements that are written."""
        return sum(len(kind.members[0]) for kind in self.kinds)

    @property
    def performed(self) -> int:
        """Statements that are carried out."""
        return sum(len(kind.members) * len(kind.members[0]) for kind in self.kinds)


def find_segments(program: Program, block: Block, known_places: Mapping[int, Place]) -> Segments:
    """The segments of a block and their kinds; symbols and hoisted values are at ``known_places``."""
    graph, nodes, skipped = program.graph, program.graph.nodes, program.made_before(block)
    longest = max(1, program.limits.statements // 2)
    places: dict[int, list[int]] = {}
    for k, y in enumerate(block.outputs):
        places.setdefault(y.id, []).append(k)
    checked = frozenset(y.id for y in block.checks)
    every = reachable(graph, [*places, *checked], stop=skipped)
    statements = [i for i in every if nodes[i][0] not in LEAVES and i not in skipped]
    kept = {*places, *checked}
    turning = [i for i in statements if nodes[i][0] in CIRCULAR and i not in kept]
    turning = [i for i in turning if known_places.get(nodes[i][1], ("", 0))[0] == "x"]
    angles = sorted({nodes[i][1] for i in turning})
    known: dict[int, Place] = dict(known_places)
    known.update((i, ("const", nodes[i][1])) for i in every if nodes[i][0] == "const")
    slot = {a: k for k, a in enumerate(angles)}
    known.update((i, ("w", slot[nodes[i][1]] + (len(angles) if nodes[i][0] == "cos" else 0))) for i in turning)
    lists = PairLists(graph, statements, 2 * len(angles))
    items = {i for i in statements if graph.calls and lists.call(i) is not None and not lists.is_list(i)}
    known.update((i, ("w", lists.place(i))) for i in items)
    single = {*lists.every, *(items & kept)}
    early = {*turning, *(items - kept)}
    left = [i for i in statements if i not in early]
    results = {i: tuple(at) for i, at in places.items()}
    reader = SegmentReader(graph, known, results, checked, single)
    groups = _grouped(graph, _apart(parts(graph, left), single), items - kept, single)
    common = _common(reader, [tuple(chain.from_iterable(group)) for group in groups])
    segments: list[Segment] = []
    for group, alike in zip(groups, common, strict=True):
        segments += [tuple(chain.from_iterable(group))] if alike else group
    segments = _merged(segments, _kept(reader, segments))
    if program.is_searched(block.name):
        segments = _cut(segments, _kept(reader, segments), partial(_repeated, reader, 2 * longest))
        segments = _merged(segments, _kept(reader, segments))
    segments = _cut(segments, _kept(reader, segments), partial(_equal_parts, length=longest))
    segments = _alternating(reader, segments, longest)
    read = [reader.read(segment) for segment in segments]
    return _laid_out(segments, read, tuple(angles), known, results, checked, lists)


def _apart(every: Sequence[tuple[int, Sequence[int]]], single: Collection[int]) -> list[tuple[int, tuple[int, ...]]]:
    """Segments cut so that some statements are segments of their own."""
    result: list[tuple[int, tuple[int, ...]]] = []
    for number, part in every:
        for by_itself, grouped in groupby(part, key=single.__contains__):
            run = tuple(grouped)
            result += [(0, (i,)) for i in run] if by_itself else [(number, run)]
    return result


def _grouped(
    graph: Graph, every: Sequence[tuple[int, tuple[int, ...]]], items: Collection[int], single: Collection[int]
) -> list[list[Segment]]:
    """Segments of several passes over one body together, as far as what they read allows.

    A segment goes to the last group that it reads from, unless that holds one of the same pass, or a list.  Entries of
    lists (``items``) are there when their list is.
    """
    nodes = graph.nodes
    groups: list[list[Segment]] = []
    passes: list[set[int]] = []
    home: dict[int, int] = {}
    for number, segment in every:
        read = (nodes[j][1] if j in items else j for i in segment for j in nodes[i][1:])
        last = max((home.get(j, -1) for j in read), default=-1)
        if last < 0 or not number or number in passes[last] or groups[last][0][0] in single:
            last = len(groups)
            groups.append([])
            passes.append(set())
        groups[last].append(segment)
        passes[last].add(number)
        home.update(dict.fromkeys(segment, last))
    return groups


def _common(reader: SegmentReader, segments: Sequence[Segment]) -> list[bool]:
    """Whether a segment is one of several of its kind."""
    signatures = [reader.read(segment)[0] for segment in segments]
    counts = Counter(signatures)
    return [counts[signature] >= FEW for signature in signatures]


def _kept(reader: SegmentReader, segments: Sequence[Segment]) -> list[bool]:
    """Whether a segment stays as it is: one of several of its kind, or a list."""
    alike = _common(reader, segments)
    return [segment[0] in reader.single or common for segment, common in zip(segments, alike, strict=True)]


def _merged(segments: Sequence[Segment], common: Sequence[bool]) -> list[Segment]:
    """Segments; rare ones that follow each other are one."""
    result: list[Segment] = []
    for alike, run in groupby(zip(segments, common, strict=True), key=lambda pair: pair[1]):
        every = [segment for segment, _ in run]
        result += every if alike else [tuple(chain.from_iterable(every))]
    return result


Cut = Callable[[Segment], list[Segment]]


def _cut(segments: Sequence[Segment], common: Sequence[bool], cut: Cut) -> list[Segment]:
    """Segments; rare ones are cut."""
    pairs = zip(segments, common, strict=True)
    return [part for segment, alike in pairs for part in ([segment] if alike else cut(segment))]


def _equal_parts(segment: Segment, length: int) -> list[Segment]:
    """Parts of this length, the last one shorter."""
    return [segment[k : k + length] for k in range(0, len(segment), length)]


def _repeated(reader: SegmentReader, longest: int, segment: Segment) -> list[Segment]:
    """A segment cut where it repeats itself."""
    result, done = list[Segment](), 0
    for start, period, count in find_repeats(reader.letters(segment), longest):
        result += [segment[done:start]] if start > done else []
        done = start + period * count
        result += _equal_parts(segment[start:done], period)
    return [*result, segment[done:]] if done < len(segment) else result


def _laid_out(
    segments: Sequence[Segment],
    read: Sequence[tuple[Signature, tuple[int, ...]]],
    angles: tuple[int, ...],
    known: dict[int, Place],
    results: Mapping[int, tuple[int, ...]],
    checked: frozenset[int],
    lists: PairLists,
) -> Segments:
    """Where every value goes that a later segment reads."""
    number: dict[Signature, int] = {}
    kind_of = [number.setdefault(signature, len(number)) for signature, _ in read]
    members: list[list[int]] = [[] for _ in number]
    for s, k in enumerate(kind_of):
        members[k].append(s)
    home: dict[int, tuple[int, int]] = {}  #: statement -> kind, index
    for s, segment in enumerate(segments):
        home.update((i, (kind_of[s], at)) for at, i in enumerate(segment))
    first: list[dict[int, tuple[int, int]]] = [{} for _ in number]  #: index of an export -> who reads it first, where
    for s, (_, reads) in enumerate(read):
        for at, i in enumerate(reads):
            if i in home:
                k, index = home[i]
                use = (kind_of[s], at)
                if use < first[k].get(index, (len(number), 0)):
                    first[k][index] = use
    work = lists.end
    kinds = []
    for k, of in enumerate(members):
        exports = tuple(sorted(first[k], key=first[k].__getitem__))
        for m, s in enumerate(of):
            base = work + m * len(exports)
            known.update((segments[s][index], ("w", base + e)) for e, index in enumerate(exports))
        kinds.append(SegmentKind(tuple(segments[s] for s in of), tuple(read[s][1] for s in of), exports, work))
        work += len(of) * len(exports)
    runs = tuple((k, len(list(run))) for k, run in groupby(kind_of))
    return Segments(tuple(kinds), runs, angles, known, results, checked, lists, work)
