"""Sums over pairs of shapes in generated code: text apart from tables, targets that have none, packages."""

from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import LAW, PLANAR, on

import eomgen as eg
from eomgen.errors import UsageError
from eomgen.generation import generate


def rows(count: int) -> eg.Model:
    """Two bodies with many circles each."""
    m, bodies = scenes.planar("rows", 2)
    groups = [
        [{"shape": "circle", "on": [body.at(0.1 * k, 0.01 * k * k, 0) for k in range(count)], "radius": 0.06}]
        for body in bodies
    ]
    m.contacts("touch", *groups, LAW)
    return m


def test_text_does_not_grow_with_the_pairs(tmp_path: Path) -> None:
    """C files of 40 and of 320 shapes differ in tables, in lengths and in the order of factors alone."""
    texts: list[dict[str, str]] = []
    for count in (40, 320):
        folder = generate(rows(count), tmp_path / str(count), target="c")
        found = {}
        for file in sorted(folder.rglob("*.c")):
            text = re.sub(r"(?s)(static )?const \w+ \w+\[\d+\](\[\d+\])? = \{.*?\n\};", "", file.read_text())
            text = re.sub(r"(\d+,\s*){25,}", "", text)  # the description of the model, as bytes
            found[file.name] = re.sub(r"\d+", "0", text)
        texts.append(found)
    assert texts[0].keys() == texts[1].keys()
    assert "rows_pairs_touch.c" in texts[0]
    for name, text in texts[0].items():
        assert len(text) < 200_000
        assert Counter(re.findall(r"\w+|\S", text)) == Counter(re.findall(r"\w+|\S", texts[1][name])), name


def test_many_shapes_as_in_the_graph() -> None:
    c, python = (rows(30).compile(target=target) for target in ("cython", "numpy"))
    x = c.x0(j1_y=0.11, j1_3=0.1, j0_3_dot=2.0)
    assert np.abs(python.rhs(0.0, x)[6:]).min() > 1.0
    for call in ("rhs", "jacobian"):
        found, wanted = getattr(c, call)(0.0, x), getattr(python, call)(0.0, x)
        assert np.abs(found - wanted).max() <= 1e-12 * np.abs(wanted).max()


@pytest.mark.parametrize("convert", ["to_casadi", "to_jax"])
def test_languages_without_loops_refuse_by_name(convert: str) -> None:
    pytest.importorskip(convert.removeprefix("to_"))
    with pytest.raises(UsageError, match=r"no contacts between groups of shapes \(here touch\); use target c, cython"):
        getattr(rows(2).derive(), convert)()


@pytest.mark.parametrize("target", ["cuda", "casadi", "jax"])
def test_targets_without_loops_refuse_by_name(target: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no contacts between groups of shapes"):
        generate(rows(2), tmp_path, target=target)


def test_single_precision_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="precision='float' has no contacts between groups"):
        generate(rows(2), tmp_path, target="c", precision="float")


def test_second_derivatives_are_refused() -> None:
    with pytest.raises(UsageError, match="second derivatives of contacts between groups are not made"):
        rows(2).compile(target="numpy", kernels=["rhs", "rhs_hessian_product"])


def test_numpy_package_stands_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    m, (a, b) = scenes.planar("alone", 2)
    m.contacts("touch", on(PLANAR["box"], a), on(PLANAR["circle"], b), LAW)
    mod = m.compile(target="numpy")
    generate(m, tmp_path, target="numpy")
    monkeypatch.syspath_prepend(str(tmp_path))
    package: Any = __import__("alone")
    x = mod.x0(j1_y=0.15, j0_x_dot=1.0)
    assert np.array_equal(package.rhs(0.0, x), mod.rhs(0.0, x))
    assert np.abs(package.rhs(0.0, x)[6:]).max() > 10.0
    assert not [name for name in sys.modules if name.startswith("alone.graph")]
