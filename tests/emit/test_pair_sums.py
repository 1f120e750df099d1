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
            text = re.sub(r"(?s)metadata_texts\[\] = \{.*?\n\};", "", text)  # the description of the model
            found[file.name] = re.sub(r"\d+", "0", text)
        texts.append(found)
    assert texts[0].keys() == texts[1].keys()
    assert "rows_pairs_touch.c" in texts[0]
    for name, text in texts[0].items():
        assert len(text) < 200_000
        assert Counter(re.findall(r"\w+|\S", text)) == Counter(re.findall(r"\w+|\S", texts[1][name])), name


def many_bodies(count: int, bulk: bool = True) -> eg.Model:
    """Circles, each a body, on a floor and beside each other."""
    m, bodies = scenes.planar("many", count)
    if bulk:
        circles = {"shape": "circle", "on": bodies, "radius": 0.06}
        m.contacts("floor", circles, {"shape": "half_plane", "on": m.ground}, LAW)
        m.contacts("among", circles, law=LAW)
        return m
    for i, body in enumerate(bodies):
        m.sphere_plane(f"f{i}", m.ground.at(0, 0, 0, rpy=(-np.pi / 2, 0, 0)), body, radius=0.06, **LAW)
        for j in range(i):
            m.sphere_sphere(f"s{i}_{j}", bodies[j], body, radii=(0.06, 0.06), **LAW)
    return m


def test_text_of_derivatives_grows_with_the_bodies_alone(tmp_path: Path) -> None:
    """Not with their pairs: all kernels of 10, 20 and 40 circles that all may touch."""
    sizes = []
    for count in (10, 20, 40):
        folder = generate(many_bodies(count), tmp_path / str(count), target="c")
        sizes.append(sum(len(file.read_text()) for file in folder.rglob("many*.c")))
    assert np.all(np.diff(sizes) < 1.15 * np.array([1, 2]) * (sizes[1] - sizes[0]))
    assert sizes[-1] < 4e6


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_derivatives_by_direction_as_pair_by_pair(target: str) -> None:
    """Beside contacts described one by one, whose derivatives are written out, and differences."""
    bulk = many_bodies(12).compile(target=target, kernels=["rhs", "jacobian", "inverse_dynamics_derivatives"])
    single = many_bodies(12, bulk=False).compile(target="numpy", kernels=["rhs", "jacobian"])
    rng = np.random.default_rng(3)
    q = np.column_stack([0.1 * (np.arange(12) % 4), 0.055 + 0.1 * (np.arange(12) // 4), rng.uniform(-3, 3, 12)])
    x = np.concatenate([(q + rng.uniform(-1e-3, 1e-3, q.shape)).ravel(), rng.uniform(-1, 1, 36)])
    found, wanted = bulk.jacobian(0.0, x), single.jacobian(0.0, x)
    assert np.count_nonzero(np.abs(wanted[36:]) > 1.0) > 400
    assert np.abs(found - wanted).max() <= 1e-12 * np.abs(wanted).max()
    steps = 1e-7 * np.eye(72)
    slopes = np.array([(bulk.rhs(0.0, x + h) - bulk.rhs(0.0, x - h)) / 2e-7 for h in steps]).T
    assert np.abs(found - slopes).max() <= 1e-5 * np.abs(wanted).max()
    a = bulk.rhs(0.0, x)[36:]
    by_motion = bulk.kernels.motion("inverse_dynamics_derivatives")(x[:36], x[36:], a)
    mass = by_motion[:, 72:]
    assert np.allclose(
        np.linalg.solve(mass, -by_motion[:, :72]), found[36:], rtol=1e-9, atol=1e-9 * np.abs(found).max()
    )


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
