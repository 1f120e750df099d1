"""Stage emit: a run of statements -> what it is like, so that alike ones can be one function."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from ..graph.core import Graph

#: ("x", 3): a place in an array; ("const", 2.0); ("t", 0).
Place = tuple[str, float]
#: Statements with what they read by number, and which of them are checked or are results, how often.
Signature = tuple[object, ...]


class SegmentReader:
    """Segments -> what they are made of, apart from where they read."""

    def __init__(
        self,
        graph: Graph,
        known: Mapping[int, Place],
        results: Mapping[int, tuple[int, ...]],
        checked: Collection[int],
        alone: Collection[int],
    ) -> None:
        self.nodes, self.known, self.results, self.checked = graph.nodes, known, results, checked
        self.alone = alone
        self.found: dict[tuple[int, ...], tuple[Signature, tuple[int, ...]]] = {}

    def read(self, segment: tuple[int, ...]) -> tuple[Signature, tuple[int, ...]]:
        """The signature of a segment, and what it reads from outside in order of first use."""
        if segment not in self.found:
            self.found[segment] = self._read(segment)
        return self.found[segment]

    def letters(self, segment: Sequence[int]) -> list[Signature]:
        """What each statement of a segment is like: where it reads, and whether others need it, but not which."""
        nodes, known = self.nodes, self.known
        found = []
        for i in segment:
            node = nodes[i]
            letter: list[object] = [node[0]]
            for j in node[1:]:
                place = known.get(j)
                letter.append("w" if place is None else place[0])
            letter += [len(self.results.get(i, ())), i in self.checked]
            found.append(tuple(letter))
        return found

    def _read(self, segment: Sequence[int]) -> tuple[Signature, tuple[int, ...]]:
        nodes, known = self.nodes, self.known
        local = {i: k for k, i in enumerate(segment)}
        numbers: dict[int, int] = {}
        signature: list[object] = []
        for i in segment:
            node = nodes[i]
            signature.append((node[0], i) if i in self.alone else node[0])
            for j in node[1:]:
                if j in self.alone and j not in self.known:
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
