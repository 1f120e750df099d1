"""A straight-line block -> alike segments of its statements -> C99 functions, one for each kind, that are loops.

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
from typing import NamedTuple

import numpy as np

from ..expr.core import LEAVES, Graph, parts, reachable
from ..expr.records import Record
from .c_layout import places_again
from .c_text import BlockPrinter, Printed, direct_results, function_text, print_block
from .pair_sums import PairLists
from .program import Block, Program
from .statements import CIRCULAR, Operand, Pairs, Pieces, PrintedFunction, conditions, find_pairs, references

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


# -- segments -> functions that go through tables of places, and alike branches over the type ``both`` -----------------

CALLED = 24  #: runs in one function; more go through a table of runs
ROW = 12  #: numbers in a line of a table
REGISTERS = 6  #: values that a loop keeps in variables from one body to the next at most
#: A function is made of loops where that takes the text of so many times fewer statements.
ALIKE = 2


def print_rolled(program: Program, block: Block) -> Printed | None:
    """The C functions of a block whose alike segments are loops; None if too few of its segments are alike."""
    name, texts = f"{block.name}_block", references(program, block)
    result = find_segments(program, block, {i: _place(text) for i, text in texts.items()})
    if ALIKE * result.written > result.performed:
        return None
    result.lists.again = places_again(program, block)
    recurrences = _find_recurrences(result)
    printed = [
        _print_kind(program, result, kind, along, f"{name}_{n}")
        for n, (kind, along) in enumerate(zip(result.kinds, recurrences, strict=True))
    ]
    made = {i for k in result.kinds for segment in k.members for i in segment}
    direct = tuple((k, y.id) for k, y in enumerate(block.outputs) if y.id not in made)
    bare = tuple(sorted({y.id for y in block.checks} - made))
    pieces = Pieces((), direct, bare, 0)
    printer = BlockPrinter(program, texts, pieces)
    main = direct_results(printer, pieces)
    main += [f"EOMGEN_REJECT({printer.failed(i, None)})" for i in bare]
    angles, first = _print_angles(result, name)
    runs, calls = _print_runs(result.runs, name, len(result.kinds))
    text = function_text(f"static flag {name}", [*main, *first, *calls])
    return Printed("\n".join([*printed, angles + runs + text]), (), result.work)


class PlaceTable:
    """What differs between the members of a kind: rows of whole numbers, each column up to a constant.

    Columns that differ by a constant share one; columns that grow evenly need none.
    """

    def __init__(self, name: str, members: int) -> None:
        self.name, self.steps = name, np.arange(members)
        self.columns: dict[bytes, int] = {}
        self.rows: list[np.ndarray] = []

    def text(self, column: Sequence[float]) -> str:
        """The text of what stands in a column at row ``m``."""
        values = np.asarray(column, dtype=np.int64)
        start = int(values[0])
        apart = values - start
        if not apart.any():
            return str(start)
        step = int(apart[1])
        if (apart == step * self.steps).all():
            return f"{start} + {step}*m" if step >= 0 else f"{start} - {-step}*m"
        key = apart.tobytes()
        if key not in self.columns:
            self.columns[key] = len(self.rows)
            self.rows.append(values)
        at = self.columns[key]
        offset = start - int(self.rows[at][0])
        return f"{self.name}[{at}]" + (f" + {offset}" if offset > 0 else f" - {-offset}" if offset else "")


def _place(text: str) -> Place:
    return (text, 0) if text == "t" else (text[0], int(text[2:-1]))


def _print_list(result: Segments, i: int, name: str) -> str:
    """A function that makes a list of a sum over pairs."""
    by_array: dict[str, list[tuple[int, float]]] = {}
    for place, operand in result.lists.fills(i):
        array, at = result.places[operand]
        by_array.setdefault(array, []).append((place, at))
    tables, filled = "", []
    for array, pairs in by_array.items():
        to = f"{name}_to_{array}"
        tables += f"EOMGEN_SHARED const int {to}[{len(pairs)}] = {{\n{_lines([place for place, _ in pairs])}\n}};\n"
        value = "t"
        if array != "t":
            kind, form = ("double", "same({})") if array == "const" else ("int", f"{array}[{{}}]")
            source = f"{name}_from_{array}"
            tables += (
                f"EOMGEN_SHARED const {kind} {source}[{len(pairs)}] = {{\n{_lines([at for _, at in pairs])}\n}};\n"
            )
            value = form.format(f"{source}[i]")
        filled.append(f"for (int i = 0; i < {len(pairs)}; i++) {{ w[{to}[i]] = {value}; }}")
    lines = "\n".join(f"    {line}" for line in ("(void)first; (void)last;", *result.lists.lines(i, filled)))
    head = f"static EOMGEN_APART flag {name}(EOMGEN_ARGUMENTS, int first, int last)"
    return f"{tables}{head}\n{{\n    EOMGEN_BEGIN\n{lines}\n    EOMGEN_RETURN\n}}\n"


class Recurrence(NamedTuple):
    """What every member of a kind reads from the one before it, so that it stays in a variable.

    Read from memory, right-hand sides of closed chains of 40 and 100 links take 1.07 of the time, Jacobians 1.11.
    """

    reads: dict[int, int]  #: what the first member reads -> number of the export of the member before
    first: dict[int, int]  #: number of the export -> where the first member reads it
    unread: frozenset[int]  #: exports that nothing else reads, which are stored by the last member of a run


def _find_recurrences(collected: Segments) -> list[Recurrence]:
    """Of every kind; kinds that read much of it are left as they are, since registers are few."""
    result = []
    read: set[int] = set()
    for kind in collected.kinds:
        stride, n = len(kind.exports), len(kind.members)
        reads, first = {}, {}
        for column in zip(*kind.reads, strict=True):
            places = [int(at) if array == "w" else -1 for array, at in (collected.places[j] for j in column)]
            e = places[1] - kind.start if n > 1 else -1
            follows = 0 <= e < stride and all(at == kind.start + m * stride + e for m, at in enumerate(places[1:]))
            if follows and e not in first and n > FEW:
                reads[column[0]], first[e] = e, places[0]
                read.add(places[0])  # which may lie inside a chain of another kind
            else:
                read.update(places)
        if len(reads) > REGISTERS:
            read.update(kind.start + m * stride + e for e in first for m in range(n))
            reads, first = {}, {}
        result.append((reads, first))
    return [
        Recurrence(reads, first, frozenset(e for e in first if read.isdisjoint(
            range(kind.start + e, kind.start + (len(kind.members) - 1) * len(kind.exports), len(kind.exports)))))
        for kind, (reads, first) in zip(collected.kinds, result, strict=True)
    ]  # fmt: skip


def _print_kind(program: Program, result: Segments, kind: SegmentKind, recurrence: Recurrence, name: str) -> str:
    """A function that evaluates members ``first`` to ``last`` of a kind."""
    if result.lists.is_list(kind.members[0][0]):
        return _print_list(result, kind.members[0][0], name)
    n = len(kind.members)
    table = PlaceTable("i", n)
    numbers: dict[tuple[float, ...], int] = {}
    fixed, loads = {}, {}
    for column in zip(*kind.reads, strict=True):
        i = column[0]
        where = [result.places[j] for j in column]
        array = where[0][0]
        if array == "const":
            values = tuple(value for _, value in where)
            if len(set(values)) > 1:
                fixed[i] = f"k[{numbers.setdefault(values, len(numbers))}]"
        elif i in recurrence.reads:
            fixed[i] = f"r{recurrence.reads[i]}"
        elif array == "w":
            loads[i] = table.text([at for _, at in where])
        else:
            fixed[i] = "t" if array == "t" else f"{array}[{table.text([at for _, at in where])}]"
    statements = kind.members[0]
    stride = len(kind.exports)
    stores = {
        statements[index]: table.text([kind.start + e + m * stride for m in range(n)])
        for e, index in enumerate(kind.exports)
        if e not in recurrence.unread
    }
    results = {
        i: tuple(
            table.text([result.results[one[k]][at] for one in kind.members]) for at in range(len(result.results[i]))
        )
        for k, i in enumerate(statements)
        if i in result.results
    }
    kept = {*(statements[index] for index in kind.exports), *results}
    checks = result.checks.intersection(statements)
    inlined = conditions(program.graph, statements, kept, checks)
    printer = BlockPrinter(program, fixed, Pieces((), (), (), 0))
    printer.lists = result.lists
    printer.named = frozenset(statements[kind.exports[e]] for e in recurrence.first)
    lines = printer.lines(PrintedFunction(statements, loads, stores, results, checks, inlined))
    lines += [f"r{e} = {printer.real(statements[kind.exports[e]])};" for e in recurrence.first]
    before, after = _print_recurrence(kind, recurrence)
    head = [f"const int *restrict const i = {name}_places[m];"] if table.rows else []
    head += [f"const double *restrict const k = {name}_numbers[m];"] if numbers else []
    body = "\n".join(f"        {line}" for line in head + lines)
    tables = ""
    if table.rows:
        rows = np.array(table.rows).T.tolist()
        tables += f"EOMGEN_SHARED const int {name}_places[{n}][{len(table.rows)}] = {{\n{_rows(rows)}\n}};\n"
    if numbers:
        every = list(zip(*numbers, strict=True))
        tables += f"EOMGEN_SHARED const double {name}_numbers[{n}][{len(numbers)}] = {{\n{_rows(every)}\n}};\n"
    opening, closing = ("".join(f"    {line}\n" for line in part) for part in (before, after))
    signature = f"static EOMGEN_APART flag {name}(EOMGEN_ARGUMENTS, int first, int last)"
    loop = f"    for (int m = first; m < last; m++) {{\n{body}\n    }}\n"
    inside = f"    EOMGEN_BEGIN\n{opening}{loop}{closing}    EOMGEN_RETURN"
    return f"{tables}{signature}\n{{\n{inside}\n}}\n"


def _print_recurrence(kind: SegmentKind, recurrence: Recurrence) -> tuple[list[str], list[str]]:
    """What comes before and after the loop over members."""
    stride = len(kind.exports)
    before, after = [], []
    for e, place in recurrence.first.items():
        last = f"{kind.start + e - stride} + {stride}"
        before.append(f"real r{e} = w[first ? {last}*first : {place}];")
        if e in recurrence.unread:
            after.append(f"w[{last}*last] = r{e};")
    return before, after


def _rows(rows: Sequence[Sequence[float]]) -> str:
    return ",\n".join("    { " + ", ".join(repr(x) for x in row) + " }" for row in rows)


def _print_angles(result: Segments, name: str) -> tuple[str, list[str]]:
    """Sines and cosines of all symbols that are angles: a table of their places, if it needs one, and statements."""
    n = len(result.angles)
    if not n:
        return "", []
    at = [int(result.places[a][1]) for a in result.angles]
    apart, table = f"{at[0]} + ", ""
    closing = ""
    if at != list(range(at[0], at[0] + n)):
        table = f"EOMGEN_SHARED const int {name}_angles[{n}] = {{\n{_lines(at)}\n}};\n"
        apart, closing = f"{name}_angles[", "]"
    angle = [f"x[{apart}m{f' + {k}' if k else ''}{closing}]" for k in range(4)]
    whole = n - n % 4
    lines = [f"bits far = sincos_one(x[{at[0]}], w, w + {n});"]
    if whole:
        four = f"far |= sincos_four({', '.join(angle)}, w + m, w + {n} + m);"
        lines.append(f"for (int m = 0; m < {whole}; m += 4) {{ {four} }}")
    lines += [f"far |= sincos_one(x[{at[k]}], w + {k}, w + {n + k});" for k in range(whole, n)]
    far = f"for (int m = 0; m < {n}; m++) {{ sincos_far({angle[0]}, w + m, w + {n} + m); }}"
    return table, [*lines, f"if (any_far(far)) {{ {far} }}"]


def _print_runs(runs: Sequence[tuple[int, int]], name: str, kinds: int) -> tuple[str, list[str]]:
    """Calls of all functions in order: a table of the runs, if there are many, and statements."""
    done = [0] * kinds
    if len(runs) <= CALLED:
        lines = []
        for kind, count in runs:
            lines.append(f"EOMGEN_REJECT({name}_{kind}(t, x, u, c, out, w, {done[kind]}, {done[kind] + count}))")
            done[kind] += count
        return "", lines
    flat = [number for run in runs for number in run]
    table = f"EOMGEN_SHARED const int {name}_runs[{len(flat)}] = {{\n{_lines(flat)}\n}};\n"
    labels = [f"    case {k}: EOMGEN_REJECT({name}_{k}(t, x, u, c, out, w, first, last)) break;" for k in range(kinds)]
    return table, [
        f"int done[{kinds}] = {{ 0 }};",
        f"for (int r = 0; r < {len(flat)}; r += 2) {{",
        f"    const int kind = {name}_runs[r], first = done[kind], last = first + {name}_runs[r + 1];",
        "    done[kind] = last;",
        "    switch (kind) {",
        *labels,
        "    }",
        "}",
    ]


def _lines(numbers: Sequence[float]) -> str:
    return ",\n".join("    " + ", ".join(map(str, numbers[k : k + ROW])) for k in range(0, len(numbers), ROW))


NONE = Pairs({}, {}, {})
FORMS = {"add": "both_plus", "sub": "both_minus", "mul": "both_times", "div": "both_over", "neg": "both_negated"}


class BranchPrinter(BlockPrinter):
    """Prints statements of pairs as one, the others as they are."""

    def __init__(self, program: Program, references: dict[int, str], pieces: Pieces) -> None:
        super().__init__(program, references, pieces)
        pairs = pieces.pairs or NONE
        self._second, self._sign, self._operands = pairs.second, pairs.sign, pairs.operands
        self._first = {b: a for a, b in pairs.second.items()}
        self._both: dict[Operand, str] = {}  #: vectors of this piece
        self._count = 0
        self._single: set[int] = set()  #: elements that have a variable of their own in this piece

    def lines(self, piece: PrintedFunction) -> list[str]:
        self._both, self._single = {}, set()
        return super().lines(piece)

    def _new(self, key: Operand, text: str, result: list[str]) -> str:
        name = self._both[key] = f"b{self._count}"
        self._count += 1
        result.append(f"const both {name} = {text};")
        return name

    def _pair(self, a: int) -> Operand:
        return (a, self._second[a], self._sign[a])

    def _vector(self, operand: Operand, piece: PrintedFunction, loaded: set[int], result: list[str]) -> str:
        """The name of a vector of two operands, or two numbers."""
        x, y, sign = operand
        if self._nodes[x][0] == "const":
            return f"both_of({self._nodes[x][1]!r}, {sign * self._nodes[y][1]!r})"
        if operand in self._both:
            return self._both[operand]
        if x in self._second:
            at = self._pair(x)
            if at not in self._both:
                self._new(at, f"both_at(w + {piece.loads[x]})", result)
            return self._both[at] if at == operand else self._new(operand, f"both_turned({self._both[at]})", result)
        for k in (x, y):
            self._read(k, piece, loaded, result)
        minus = "-" if sign < 0 else ""
        return self._new(operand, f"both_of({self.real(x)}, {minus}{self.real(y)})", result)

    def _read(self, i: int, piece: PrintedFunction, loaded: set[int], result: list[str]) -> None:
        a = self._first.get(i, i)
        if a not in self._second:
            super()._read(i, piece, loaded, result)
        elif i not in self._single:
            self._single.add(i)
            self._name_waiting(result)
            minus = "-" if i != a and self._sign[a] < 0 else ""
            if self._pair(a) in self._both:
                text = f"{'first' if i == a else 'second'}_of({self._both[self._pair(a)]})"
            else:
                text = f"w[{piece.loads[i]}]"
            result.append(f"const real {self._name(i)} = {minus}{text};")

    def _statement(self, i: int, piece: PrintedFunction, loaded: set[int], result: list[str]) -> None:
        if i in self._first:
            return  # printed with the first
        if i not in self._second:
            super()._statement(i, piece, loaded, result)
            return
        self._name_waiting(result)
        kind = self._nodes[i][0]
        b = self._second[i]
        if kind in CIRCULAR:
            name = self._new(self._pair(i), self._circular(kind, *self._operands[i][0][:2]), result)
        else:
            texts = [self._vector(operand, piece, loaded, result) for operand in self._operands[i]]
            name = self._new(self._pair(i), f"{FORMS[kind]}({', '.join(texts)})", result)
        minus = "-" if self._sign[i] < 0 else ""
        for k, text in ((i, f"first_of({name})"), (b, f"{minus}second_of({name})")):
            if k in piece.checks:
                self._read(k, piece, loaded, result)
                result.append(f"EOMGEN_REJECT({self.failed(k, piece)})")
            if k in piece.results:
                result += [f"out[{at}] = {text};" for at in piece.results[k]]
        if i in piece.stores:
            result.append(f"both_put(w + {piece.stores[i]}, {name});")

    def _circular(self, kind: str, x: int, y: int) -> str:
        name, at, to = "sines" if kind == "sin" else "cosines", self._angles[x], self._angles[y]
        return f"both_at({name} + {at})" if to == at + 1 else f"both_of({name}[{at}], {name}[{to}])"


def print_block_of_branches(program: Program, block: Block) -> Printed:
    """The C functions of a block, with vectors where that takes clearly fewer instructions."""
    return print_block(program, block, BranchPrinter, partial(find_pairs, program))
