"""Stage emit: segments of a block -> fewer and longer ones: kinds that alternate, and loops in a row, become one loop.

A loop that follows another reads from memory what that has stored, member by member.  In one loop it stands in a
variable, and is stored only if others read it (loop fusion: K. Kennedy and K. McKinley, Maximizing loop parallelism and
improving data locality via loop fusion and distribution, LNCS 768 (1994), 301-320).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from .repeats import FEW, find_repeats
from .segment_reader import SegmentReader

Segment = tuple[int, ...]

PERIOD = 16  #: kinds that alternate at most
CALLS = 8  #: of functions that have to be spared
SEVERAL = 4  #: members of one loop that belong with one of another at most
ENDS = 2  #: members at the ends of two loops that may stay outside of the common one


def fuse(reader: SegmentReader, segments: Sequence[Segment], longest: int, entries: Mapping[int, int]) -> list[Segment]:
    """Segments of at most so many statements in an order in which they can be evaluated.

    ``entries`` maps what is no statement, but an entry of a list, to the list that has to be there first.
    """
    return _Runs(reader, longest, entries).fused(_alternating(reader, segments, longest))


def _alternating(reader: SegmentReader, segments: Sequence[Segment], longest: int) -> list[Segment]:
    """Segments; groups of them that repeat themselves are one where that makes members of one kind."""
    result: list[Segment] = []
    done = 0
    for start, period, count in find_repeats([reader.read(segment)[0] for segment in segments], PERIOD, CALLS):
        groups = [segments[k : k + period] for k in range(start, start + count * period, period)]
        if period == 1 or sum(map(len, groups[0])) > longest or any(s[0] in reader.alone for s in groups[0]):
            continue
        result += segments[done:start]
        done = start + count * period
        joined = [sum(group, ()) for group in groups]
        kinds = Counter(reader.read(one)[0] for one in joined)
        usual, often = kinds.most_common(1)[0]
        for group, one in zip(groups, joined, strict=True):
            result += [one] if often >= FEW and reader.read(one)[0] == usual else group
    return [*result, *segments[done:]]


class _Groups:
    """Members of a run, so many together from one of the first on."""

    def __init__(self, run: list[Segment], size: int, start: int) -> None:
        self.run, self.size, self.start = run, size, start
        ends = range(start + size, len(run) + 1, size)
        self.groups: list[Segment] = [sum(run[end - size : end], ()) for end in ends]

    def group(self, member: int) -> int:
        """The number of the group of a member; those outside have numbers below and above."""
        return (member - self.start) // self.size

    def member(self, group: int) -> int:
        """The first member of a group."""
        return self.start + group * self.size


class _Runs:
    """Runs of segments of one kind, in order, and which of them a statement is in."""

    def __init__(self, reader: SegmentReader, longest: int, entries: Mapping[int, int]) -> None:
        self.reader, self.longest, self.entries = reader, longest, entries
        self.runs: list[list[Segment]] = []  #: by number; a run that has become part of another is empty
        self.order: list[int] = []  #: numbers in the order of evaluation
        self.place: list[int] = []  #: of a number in that order
        self.home: dict[int, tuple[int, int]] = {}  #: statement -> number of its run, member

    def fused(self, segments: Sequence[Segment]) -> list[Segment]:
        for _, group in groupby(segments, key=lambda segment: self.reader.read(segment)[0]):
            run = list(group)
            if len(run) < FEW or run[0][0] in self.reader.alone or not self._join(run):
                self._insert(len(self.order), [run])
        return [segment for k in self.order for segment in self.runs[k]]

    def _insert(self, at: int, runs: Sequence[list[Segment]], instead: int = 0) -> None:
        """Put runs at a place of the order, in the place of so many there."""
        new = range(len(self.runs), len(self.runs) + len(runs))
        self.runs += runs
        self.place += [0] * len(runs)
        for k in self.order[at : at + instead]:
            self.runs[k] = []
        self.order[at : at + instead] = new
        for place in range(at, len(self.order)):
            self.place[self.order[place]] = place
        for k in new:
            for m, segment in enumerate(self.runs[k]):
                self.home.update(dict.fromkeys(segment, (k, m)))

    def _reads(self, segment: Segment) -> Iterator[tuple[int, int]]:
        """Place of the run, and member, of all that a segment reads."""
        for i in self.reader.read(segment)[1]:
            found = self.home.get(self.entries.get(i, i))
            if found is not None:
                yield self.place[found[0]], found[1]

    def _kind(self, segment: Segment) -> object:
        return self.reader.read(segment)[0]

    def _join(self, run: list[Segment]) -> bool:
        """Make one loop of a run and of that from which its middle member reads last, if that is possible.

        Where one has several times as many members, so many of them belong with one of the other.
        """
        at, _ = max(self._reads(run[len(run) // 2]), default=(-1, 0))
        if at < 0:
            return False
        other = self.runs[self.order[at]]
        if other[0][0] in self.reader.alone:
            return False
        several, of_other = (max(1, round(len(a) / len(b))) for a, b in ((run, other), (other, run)))
        if max(several, of_other) > SEVERAL or len(other[0]) * of_other + len(run[0]) * several > self.longest:
            return False
        return any(
            self._join_groups(at, _Groups(other, of_other, one), _Groups(run, several, two))
            for one in range(of_other)
            for two in range(several)
        )

    def _join_groups(self, at: int, other: _Groups, run: _Groups) -> bool:
        if len(run.groups) < FEW:
            return False
        middle = len(run.groups) // 2
        place, last = max(self._reads(run.groups[middle]), default=(-1, 0))
        if place != at:
            return False
        ahead = other.group(last) - middle  # group m of the run comes behind group m + ahead of the other
        first, end = max(0, -ahead), min(len(run.groups), len(other.groups) - ahead)
        if not first <= middle < end:
            return False
        joined = [(*other.groups[m + ahead], *run.groups[m]) for m in range(first, end)]
        usual = self._kind(joined[middle - first])
        if any(self._kind(one) != usual for one in joined[max(0, middle - first - 1) : middle - first + 2]):
            return False  # told by three of them, without reading all
        alike = [k for k, one in enumerate(joined) if self._kind(one) == usual]
        first, end, joined = first + alike[0], first + alike[-1] + 1, joined[alike[0] : alike[-1] + 1]
        most = max(len(run.groups), len(other.groups))
        if len(alike) < max(FEW, most - ENDS) or len(alike) < len(joined):
            return False
        for m in range(first, end):
            for place, member in self._reads(run.groups[m]):
                if place > at or (place == at and other.group(member) > m + ahead):
                    return False
        before, after = other.member(first + ahead), other.member(end + ahead)
        early, late = run.run[: run.member(first)], run.run[run.member(end) :]
        if any(read >= (at, before) for one in early for read in self._reads(one)):
            return False
        self._insert(at, [part for part in (other.run[:before], early, joined, other.run[after:]) if part], 1)
        if late:
            self._insert(len(self.order), [late])
        return True
