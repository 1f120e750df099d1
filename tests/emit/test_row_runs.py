"""Tables of shapes as runs of rows: what is written gives every row again, and does not grow with alike bodies."""

from __future__ import annotations

import re

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import LAW

from eomgen import pipeline
from eomgen.emit import emit_c
from eomgen.emit.row_runs import runs_of, written


def again(table: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """The rows that the runs of a table give."""
    return [
        tuple(x + turn * step for x, step in zip(row, run.steps[k] if run.steps else [0] * len(row), strict=True))
        for run in runs_of(table)
        for turn in range(run.times)
        for k, row in enumerate(run.rows)
    ]


@pytest.mark.parametrize("seed", range(20))
def test_runs_give_every_row_again(seed: int) -> None:
    """Of tables of random runs between random rows."""
    rng = np.random.default_rng(seed)
    table: list[tuple[int, ...]] = []
    for _ in range(rng.integers(1, 6)):
        period, times = int(rng.integers(1, 5)), int(rng.integers(1, 9))
        base, step = rng.integers(-3, 40, (period, 3)), rng.integers(-1, 3, (period, 3))
        table += [tuple(map(int, base[k] + t * step[k])) for t in range(times) for k in range(period)]
    assert again(table) == table
    assert len(written(table)["rows"]) <= len(table)


def test_bodies_with_several_shapes_are_one_run() -> None:
    """Two shapes a body, and the same rows for any number of bodies."""
    rows = [[(body, place, 7) for body in range(count) for place in (3, 4)] for count in (40, 320)]
    few, many = (written(table) for table in rows)
    assert few["rows"] == many["rows"] == [(0, 3, 7), (0, 4, 7), (1, 0, 0), (1, 0, 0)]
    assert many["runs"] == [(2, 320)]


def test_text_of_contacts_does_not_grow_with_bodies() -> None:
    """Of segments, each a body, on the ground: as long for 40 as for 10, but for digits."""
    sizes = []
    for count in (10, 40):
        m, bodies = scenes.planar("many", count)
        links = {"shape": "segment", "on": bodies, "length": 0.1, "radius": 0.01}
        m.contacts("floor", links, {"shape": "half_plane", "on": m.ground}, LAW)
        sources = emit_c(pipeline.build(m.derive(), "c", ["rhs", "jacobian"]))
        sizes.append(len(sources["many_pairs_floor.c"]))
    assert sizes[1] < 1.01 * sizes[0]


def test_text_of_polygons_does_not_grow_with_corners() -> None:
    """Of two polygons: as long for 24 corners each as for 6, apart from tables of numbers."""
    sizes = []
    for corners in (6, 24):
        m, bodies = scenes.planar("two", 2)
        turns = 2.0 * np.pi * np.arange(corners) / corners
        points = [(0.2 * np.cos(turn), 0.1 * np.sin(turn)) for turn in turns.tolist()]
        m.contacts("touch", [{"shape": "polygon", "on": body, "points": points} for body in bodies], law=LAW)
        text = emit_c(pipeline.build(m.derive(), "c", ["rhs", "jacobian"]))["two_pairs_touch.c"]
        sizes.append(len(re.sub(r"(?s)(static )?const \w+ \w+\[\d+\](\[\d+\])? = \{.*?\n\};", "", text)))
    assert sizes[1] < 1.2 * sizes[0]
