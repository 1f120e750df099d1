"""Stage emit: a straight-line block -> alike segments of its statements, each kind to be written once, as a loop.

A recursion over a big tree does the same for many bodies, but for where it reads and writes.  The graph marks where the
part of another body begins.  Statements between two marks are a segment; segments whose statements are the same
function of what they read are of one kind.  What has no marks is cut where it repeats itself (:mod:`.repeats`).
Statements stay in the order in which the graph was made, but that the segments of one body in several passes come
together where what they read allows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import chain, groupby

from ..graph.core import Expr, Graph
from ..graph.traverse import LEAVES, parts, reachable
from ..records import dataclass
from .angles import CIRCULAR
from .fused import fuse
from .pair_statements import PairLists
from .repeats import FEW, find_repeats
from .segment_reader import Place, SegmentReader, Signature


@dataclass(frozen=True)
class SegmentKind:
    """Segments that are the same function of what they read.

    Attributes
    ----------
    members : tuple of tuple of int
        Statements of every segment, in order of evaluation.
    reads : tuple of tuple of int
        Ids that every segment reads from outside, numbered alike.
    exports : tuple of int
        Indices of statements that later segments read; place ``k`` of the block of member ``m`` holds entry k.
    start : int
        Where in the work array the blocks of the members begin.
    """

    members: tuple[tuple[int, ...], ...]
    reads: tuple[tuple[int, ...], ...]
    exports: tuple[int, ...]
    start: int


@dataclass(frozen=True)
class Segments:
    """All of a block.

    Attributes
    ----------
    kinds : tuple of SegmentKind
    runs : tuple of (int, int)
        Number of a kind, and how many of its members come next.
    angles : tuple of int
        Symbols whose sines and cosines are computed first, from places 0 and ``len(angles)`` of the work array on.
    places : mapping of int to Place
        Where each value is that a segment reads from outside.
    results : mapping of int to tuple of int
        Node id -> places in the result.
    checks : frozenset of int
    lists : PairLists
        Of sums over pairs; each is a segment of its own.
    work : int
    """

    kinds: tuple[SegmentKind, ...]
    runs: tuple[tuple[int, int], ...]
    angles: tuple[int, ...]
    places: Mapping[int, Place]
    results: Mapping[int, tuple[int, ...]]
    checks: frozenset[int]
    lists: PairLists
    work: int

    @property
    def written(self) -> int:
        """Statements that are written."""
        return sum(len(kind.members[0]) for kind in self.kinds)

    @property
    def carried_out(self) -> int:
        """Statements that are carried out."""
        return sum(len(kind.members) * len(kind.members[0]) for kind in self.kinds)


def find_segments(
    graph: Graph,
    outputs: Sequence[Expr],
    checks: Sequence[Expr],
    skipped: frozenset[int],
    given: Mapping[int, Place],
    longest: int,
    searched: bool = True,
) -> Segments:
    """The segments of a block and the kinds that they are of.

    Parameters
    ----------
    skipped : frozenset of int
        Operations that are not evaluated here.
    given : mapping of int to Place
        Symbols and hoisted values.
    longest : int
        Most statements in a segment.
    searched : bool
        Whether statements between marks are searched for what repeats itself.
    """
    nodes = graph.nodes
    places: dict[int, list[int]] = {}
    for k, y in enumerate(outputs):
        places.setdefault(y.id, []).append(k)
    checked = frozenset(y.id for y in checks)
    every = reachable(graph, [*places, *checked], stop=skipped)
    statements = [i for i in every if nodes[i][0] not in LEAVES and i not in skipped]
    kept = {*places, *checked}
    turning = [i for i in statements if nodes[i][0] in CIRCULAR and i not in kept]
    turning = [i for i in turning if given.get(nodes[i][1], ("", 0))[0] == "x"]
    angles = sorted({nodes[i][1] for i in turning})
    known: dict[int, Place] = dict(given)
    known.update((i, ("const", nodes[i][1])) for i in every if nodes[i][0] == "const")
    slot = {a: k for k, a in enumerate(angles)}
    known.update((i, ("w", slot[nodes[i][1]] + (len(angles) if nodes[i][0] == "cos" else 0))) for i in turning)
    lists = PairLists(graph, statements, 2 * len(angles))
    items = {i for i in statements if graph.calls and lists.call(i) is not None and not lists.is_list(i)}
    known.update((i, ("w", lists.place(i))) for i in items)
    alone = {*lists.every, *(items & kept)}
    early = {*turning, *(items - kept)}
    left = [i for i in statements if i not in early]
    results = {i: tuple(at) for i, at in places.items()}
    reader = SegmentReader(graph, known, results, checked, alone)
    groups = _grouped(graph, _apart(parts(graph, left), alone), items - kept, alone)
    common = _common(reader, [tuple(chain.from_iterable(group)) for group in groups])
    segments: list[tuple[int, ...]] = []
    for group, alike in zip(groups, common, strict=True):
        segments += [tuple(chain.from_iterable(group))] if alike else group
    segments = _merged(segments, _kept(reader, segments))
    if searched:
        segments = _repeated(reader, segments, _kept(reader, segments), 2 * longest)
        segments = _merged(segments, _kept(reader, segments))
    segments = _shortened(segments, _kept(reader, segments), longest)
    segments = fuse(reader, segments, longest, {i: nodes[i][1] for i in items - kept})
    read = [reader.read(segment) for segment in segments]
    return _laid_out(segments, read, tuple(angles), known, results, checked, lists)


def _apart(every: Sequence[tuple[int, Sequence[int]]], alone: Collection[int]) -> list[tuple[int, tuple[int, ...]]]:
    """Segments cut so that some statements are segments of their own."""
    found: list[tuple[int, tuple[int, ...]]] = []
    for number, part in every:
        for by_itself, grouped in groupby(part, key=alone.__contains__):
            run = tuple(grouped)
            found += [(0, (i,)) for i in run] if by_itself else [(number, run)]
    return found


def _grouped(
    graph: Graph, every: Sequence[tuple[int, tuple[int, ...]]], items: Collection[int], alone: Collection[int]
) -> list[list[tuple[int, ...]]]:
    """Segments of several passes over one body together, as far as what they read allows.

    A segment goes to the last group that it reads from, unless that holds one of the same pass, or a list.  Entries of
    lists (``items``) are there when their list is.
    """
    nodes = graph.nodes
    groups: list[list[tuple[int, ...]]] = []
    passes: list[set[int]] = []
    home: dict[int, int] = {}
    for number, segment in every:
        read = (nodes[j][1] if j in items else j for i in segment for j in nodes[i][1:])
        last = max((home.get(j, -1) for j in read), default=-1)
        if last < 0 or not number or number in passes[last] or groups[last][0][0] in alone:
            last = len(groups)
            groups.append([])
            passes.append(set())
        groups[last].append(segment)
        passes[last].add(number)
        home.update(dict.fromkeys(segment, last))
    return groups


def _common(reader: SegmentReader, segments: Sequence[tuple[int, ...]]) -> list[bool]:
    """Whether a segment is one of several of its kind."""
    signatures = [reader.read(segment)[0] for segment in segments]
    counts = Counter(signatures)
    return [counts[signature] >= FEW for signature in signatures]


def _kept(reader: SegmentReader, segments: Sequence[tuple[int, ...]]) -> list[bool]:
    """Whether a segment stays as it is: one of several of its kind, or a list."""
    alike = _common(reader, segments)
    return [segment[0] in reader.alone or common for segment, common in zip(segments, alike, strict=True)]


def _merged(segments: Sequence[tuple[int, ...]], common: Sequence[bool]) -> list[tuple[int, ...]]:
    """Segments; rare ones that follow each other are one."""
    result: list[tuple[int, ...]] = []
    for alike, run in groupby(zip(segments, common, strict=True), key=lambda pair: pair[1]):
        every = [segment for segment, _ in run]
        result += every if alike else [tuple(chain.from_iterable(every))]
    return result


def _repeated(
    reader: SegmentReader, segments: Sequence[tuple[int, ...]], common: Sequence[bool], longest: int
) -> list[tuple[int, ...]]:
    """Segments; rare ones are cut where they repeat themselves."""
    result: list[tuple[int, ...]] = []
    for segment, alike in zip(segments, common, strict=True):
        done = 0
        for start, period, count in () if alike else find_repeats(reader.letters(segment), longest):
            result += [segment[done:start]] if start > done else []
            done = start + period * count
            result += [segment[k : k + period] for k in range(start, done, period)]
        result += [segment[done:]] if done < len(segment) else []
    return result


def _shortened(segments: Sequence[tuple[int, ...]], common: Sequence[bool], longest: int) -> list[tuple[int, ...]]:
    """Segments; rare ones are as long as may be."""
    result: list[tuple[int, ...]] = []
    for segment, alike in zip(segments, common, strict=True):
        step = len(segment) if alike else longest
        result += [segment[k : k + step] for k in range(0, len(segment), step)]
    return result


def _laid_out(
    segments: Sequence[tuple[int, ...]],
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
