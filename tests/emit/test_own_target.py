"""A target of a user's own: one function and one row."""

from __future__ import annotations

import json
import math
import operator
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import eomgen as eg
from eomgen.targets import TARGETS, Target


def listing(program: Any, context: dict[str, Any]) -> dict[str, str]:
    """The nodes of x', each an operation and the numbers of its operands, constants and names as they are."""
    block = next(block for block in program.blocks if block.name == "rhs")
    graph, found = program.graph, {}
    todo = [x.id for x in block.outputs]
    while todo:
        i = todo.pop()
        found[i] = graph.nodes[i]
        todo += [] if found[i][0] in ("const", "sym") else [k for k in found[i][1:] if k not in found]
    told = {"model": context["name"], "nodes": found, "out": [x.id for x in block.outputs]}
    return {"listing.json": json.dumps(told)}


def played(told: Any, given: dict[str, float]) -> list[float]:
    """What the listing says, by Python's own arithmetic."""
    named: dict[str, Callable[..., float]] = {"add": operator.add, "sub": operator.sub, "mul": operator.mul}
    named |= {"div": operator.truediv, "neg": operator.neg}

    def value(i: int) -> float:
        kind, *rest = told["nodes"][str(i)]
        if kind in ("const", "sym"):
            return float(rest[0]) if kind == "const" else given[rest[0]]
        return named.get(kind, getattr(math, kind, None))(*map(value, rest))  # type: ignore[misc]

    return [value(i) for i in told["out"]]


def test_a_target_is_one_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against theta'' = -g sin(theta) / l."""
    m = eg.Model("swing", gravity=[0, "-g", 0])
    for name, value in (("g", 9.81), ("l", 0.7)):
        m.parameter(name, value)
    m.body("bob", mass=2.0, com=["l", 0, 0], inertia={"zz": 0})
    m.revolute("pin", m.ground, "bob", coordinate="theta")
    m.save(tmp_path / "swing.yaml")
    from eomgen.generation import generate

    with pytest.raises(eg.UsageError, match="no target 'listing'; there are cython, numpy, c"):
        generate(m, tmp_path, target="listing")
    monkeypatch.setitem(TARGETS, "listing", Target("list of operations", listing))
    path = generate(m, tmp_path, target="listing")
    told = json.loads((path / "listing.json").read_text(encoding="utf-8"))
    assert told["model"] == "swing"
    x = played(told, {"theta": 0.3, "theta_dot": -1.1, "g": 9.81, "l": 0.7})
    assert x == pytest.approx([-1.1, -9.81 * math.cos(0.3) / 0.7], rel=1e-14)
    with pytest.raises(eg.UsageError, match="makes a list of operations, not a Python module"):
        m.compile(target="listing")


def test_the_command_line_lists_the_targets() -> None:
    from eomgen.cli.verb_generate import generate

    said = CliRunner().invoke(generate, ["--help"]).output
    for name, row in TARGETS.items():
        assert f"{name}: {row.about.split()[0]}" in " ".join(said.split())
