"""Loops that alternate or follow each other are one loop: in an order that can be evaluated, and none that cannot."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain, groupby

import numpy as np
import pytest
from emit.test_repeats import four_bars

from eomgen import pipeline
from eomgen.emit import emit_c
from eomgen.emit.fused import ENDS, fuse
from eomgen.emit.segment_reader import Place, SegmentReader
from eomgen.graph.core import Expr, Graph

N = 12
LONG = 10**6


class Scene:
    """Statements over N values x and N values y, written as segments."""

    def __init__(self) -> None:
        self.graph = Graph()
        self.x = [self.graph.symbol(f"x{k}") for k in range(N + 2)]
        self.segments: list[tuple[int, ...]] = []

    def add(self, *made: Expr) -> Expr:
        self.segments.append(tuple(y.id for y in made))
        return made[-1]

    def fused(self, longest: int = LONG, entries: Mapping[int, int] | None = None) -> list[tuple[int, ...]]:
        known: dict[int, Place] = {y.id: ("x", k) for k, y in enumerate(self.x)}
        reader = SegmentReader(self.graph, known, {}, frozenset(), frozenset())
        found = fuse(reader, self.segments, longest, entries or {})
        for segments in (self.segments, found):
            done = set(known)
            for i in chain.from_iterable(segments):
                assert done.issuperset(k for k in self.graph.nodes[i][1:] if self.graph.nodes[k][0] != "const")
                done.add(i)
        every = [sorted(chain.from_iterable(one)) for one in (found, self.segments)]
        assert every[0] == every[1]
        self.lengths = [(len(kind[0]), len(kind)) for kind in self._runs(reader, found)]
        return found

    def _runs(self, reader: SegmentReader, found: list[tuple[int, ...]]) -> list[list[tuple[int, ...]]]:
        return [list(run) for _, run in groupby(found, key=lambda one: reader.read(one)[0])]


def squares(scene: Scene) -> list[Expr]:
    return [scene.add(x * x) for x in scene.x[:N]]


def test_a_loop_joins_that_from_which_it_reads() -> None:
    scene = Scene()
    for k, y in enumerate(squares(scene)):
        scene.add(y + scene.x[k])
    scene.fused()
    assert scene.lengths == [(2, N)]


def test_kinds_that_alternate_are_one_kind() -> None:
    """Sixty statements have to be spared for that."""
    scene = Scene()
    y = scene.x[0]
    for _ in range(40):
        z = scene.add(y * y)
        y = scene.add(z + scene.x[1])
    scene.fused()
    assert scene.lengths == [(1, 1), (2, 39), (1, 1)]  # the first reads x


@pytest.mark.parametrize("ahead", [-2, -1, 0, 1, 2])
def test_a_loop_may_read_from_members_before_and_behind(ahead: int) -> None:
    """Members at the ends that have no partner stay outside."""
    scene = Scene()
    made = squares(scene)
    for k in range(N):
        scene.add((made[k + ahead] if 0 <= k + ahead < N else scene.x[N]) + scene.x[k])
    scene.fused()
    size, members = max(scene.lengths, key=lambda pair: pair[1])
    assert (size, members) == (2, N - abs(ahead))


def test_a_loop_that_reads_all_of_another_stays_behind_it() -> None:
    scene = Scene()
    total, *rest = squares(scene)
    sums = [total := total + y for y in rest]
    scene.add(*sums)
    for k in range(N):
        scene.add(total * scene.x[k])
    scene.fused()
    assert scene.lengths == [(1, N), (N - 1, 1), (1, N)]


def test_a_loop_that_reads_another_backwards_stays_behind_it() -> None:
    scene = Scene()
    for k, y in enumerate(reversed(squares(scene))):
        scene.add(y + scene.x[k])
    scene.fused()
    assert scene.lengths == [(1, N), (1, N)]


def test_what_stands_between_is_passed_if_it_is_not_read() -> None:
    scene = Scene()
    made = squares(scene)
    one = scene.add(made[3] * 0.5, made[3] * 0.5 - scene.x[0])
    for k, y in enumerate(made):
        scene.add(y + scene.x[k])
    scene.add(one + 1.0)
    scene.fused()
    assert scene.lengths == [(2, N), (2, 1), (1, 1)]


def test_two_members_of_one_loop_join_one_of_another() -> None:
    scene = Scene()
    made = squares(scene)
    for k in range(0, N, 2):
        scene.add(made[k] + made[k + 1])
    scene.fused()
    assert scene.lengths == [(3, N // 2)]


def test_one_member_of_a_loop_joins_two_of_another() -> None:
    scene = Scene()
    for y in squares(scene):
        scene.add(y + scene.x[N])
        scene.add(y + scene.x[N + 1])
    scene.segments.sort(key=lambda segment: scene.graph.nodes[segment[0]][0] == "add")
    scene.fused()
    assert scene.lengths == [(3, N)]


def test_loops_become_no_longer_than_asked_for() -> None:
    scene = Scene()
    made = squares(scene)
    for k in range(N):
        made[k] = scene.add(made[k] + scene.x[k])
    for k in range(N):
        made[k] = scene.add(made[k] * scene.x[k + 1])
    scene.fused(longest=2)
    assert scene.lengths == [(2, N), (1, N)]


def test_loops_of_other_lengths_stay_apart() -> None:
    scene = Scene()
    made = squares(scene)
    for k in range(N - ENDS - 3):
        scene.add(made[k] + scene.x[k])
    scene.fused()
    assert scene.lengths == [(1, N), (1, N - ENDS - 3)]


def test_a_loop_that_reads_entries_of_a_list_stays_behind_the_list() -> None:
    """Entries are no statements, but the list is one."""
    scene = Scene()
    made = squares(scene)
    listed = scene.add(made[3] * 0.5)
    for k, y in enumerate(made):
        scene.add(y + scene.x[k])
    for read in (scene.x[N - 1 :], scene.x):
        scene.fused(entries={x.id: listed.id for x in read})
        assert scene.lengths == [(1, N), (1, 1), (1, N)]
    scene.fused(entries={scene.x[N].id: listed.id})
    assert scene.lengths == [(2, N), (1, 1)]


@pytest.mark.parametrize("seed", range(40))
def test_any_order_that_is_found_can_be_evaluated(seed: int) -> None:
    """Random loops that read from others at random distances, with single statements between them."""
    random = np.random.default_rng(seed)
    scene = Scene()
    loops = [scene.x[:N], squares(scene)]
    for _ in range(8):
        source, other = (loops[k] for k in random.integers(0, len(loops), 2))
        n, shift, step = int(random.integers(3, 2 * N)), int(random.integers(-3, 4)), int(random.choice([1, 1, 2, -1]))
        operation = str(random.choice(["max", "min", "atan2"]))
        new = []
        for k in range(n):
            a, b = (row[(step * k + shift) % len(row)] for row in (source, other))
            y = a if a == b else scene.graph.apply(operation, a, b)
            if a != b and y.id not in chain.from_iterable(scene.segments):
                scene.add(y)
            new.append(y)
        loops.append(new)
    scene.fused()


def test_a_row_of_four_bars_goes_through_few_loops() -> None:
    """Rows and columns of its loops alternate as they are made, and every run of alike ones takes a call."""
    program = pipeline.build(four_bars(40).derive("recursive"), "c", ["rhs"])
    limits = replace(program.limits, rolled=0, repeated=0, repeated_dynamics=0)
    text = emit_c(replace(program, limits=limits), lanes=False)[f"{program.name}.c"]
    calls = {
        name: max(
            text.count(f"EOMGEN_REJECT({name}_block_"),
            *(int(n) // 2 for n in re.findall(rf"const int {name}_block_runs\[(\d+)\]", text)),
        )
        for name in ("closing", "dynamics", "regular_closing", "regular_dynamics")
    }
    assert max(calls.values()) <= 150
    assert sum(calls.values()) <= 350  # 1,652 without
