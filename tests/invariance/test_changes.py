"""Each change on its own: shipped examples and random models; and that the comparison sees what is wrong."""

from __future__ import annotations

import math
from typing import Any

import models
import numpy as np
import pytest
from invariance.random_models import random_tree
from sweeps import part_of

import eomgen as eg
from eomgen.describe.description import Description
from eomgen.describe.rewritten_texts import scaled
from eomgen.describe.visit import copied
from eomgen.verification import Finding
from eomgen.verification.variants import CHANGES, Variant, variant_findings
from eomgen.verification.variants.compare import compare
from eomgen.verification.variants.findings import RUN, all_at_once, original_of
from eomgen.verification.variants.short_runs import run_findings
from eomgen.verification.variants.variant import drop

#: Small examples that together have every change: loops, redundant rows, rods, rolling, cams, gears, drivers, a table.
EXAMPLES = ("four_bar", "double_wishbone", "planetary_gear", "car_axis", "hoecken")
#: Those that are tried in every way besides.
EVERY_WAY = ("slider_crank", "rolling_disc", "cam_follower", "pendulum", "gear_train", "hydraulic_boom")


def failures(findings: list[Finding]) -> list[str]:
    return [f"{f.check}: {f.worst:.2g} > {f.limit:.2g} {f.where} {f.note}" for f in findings if not f.ok]


def changed(model: eg.Model, seed: int = 0) -> list[Finding]:
    """All changes of the description, and a short run of all of them at once."""
    original = original_of(model, seed)
    random = np.random.default_rng(seed)
    found = [compare(name, original, change, random) for name, change in CHANGES.items()]
    return [*found, run_findings(RUN, original, {"all at once": all_at_once}, random)]


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_as_variants(name: str) -> None:
    found = changed(eg.load(models.EXAMPLES / f"{name}.yaml"))
    assert failures(found) == []
    assert sum(not f.left_out for f in found) >= 6


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    part_of(sorted(models.EXAMPLES.glob("*.yaml")), lambda path: path.stem in EVERY_WAY),
    ids=lambda path: path.stem,
)
def test_every_way_of_an_example(path: Any) -> None:
    """With every method, target, way to give parameters, inputs and states, and reactions."""
    assert failures(variant_findings(eg.load(path), seconds=math.inf)) == []


@pytest.mark.parametrize("seed", part_of((0, 83, 166, 249, 332, 415, 498), lambda seed: seed in (0, 249)))
def test_random_trees_as_variants(seed: int) -> None:
    assert failures(changed(random_tree(seed), seed)) == []


def test_a_description_of_python_is_compared_with_its_plain_form() -> None:
    found = variant_findings(models.offset_slider_crank(), only="YAML round trip")
    assert [f.ok and not f.left_out for f in found] == [True]


def heavier(description: Description, random: Any) -> Variant:
    """A part in 10^9 more mass on every body: no rounding."""
    made = copied(description)
    for entry in made.sections["bodies"]:
        if "mass" in entry.values and entry.name != "slider":
            entry.values["mass"] = scaled(entry.values["mass"], 1 + 1e-9)
    return Variant(made)


def freed(description: Description, random: Any) -> Variant:
    """One joint less."""
    made = copied(description)
    made.sections["joints"] = [e for e in made.sections["joints"] if e.name != "C"]
    drop(made, ["C"])
    return Variant(made)


def refused(description: Description, random: Any) -> Variant:
    """A mass that no body has."""
    made = copied(description)
    made.sections["bodies"][0].values["mass"] = -1
    return Variant(made)


def unlike(description: Description, random: Any) -> Variant:
    """A result that is no number."""
    made = copied(description)
    made.sections["outputs"][0].values["expression"] = "log(-1 - theta**2)"
    return Variant(made)


@pytest.mark.parametrize(
    ("change", "words"), [(heavier, ""), (freed, "degrees of freedom instead of 1"), (refused, "refused"), (unlike, "")]
)
def test_what_is_wrong_is_found(change: Any, words: str) -> None:
    original = original_of(eg.load(models.EXAMPLES / "slider_crank.yaml"), 0)
    finding = compare("check", original, change, np.random.default_rng(0))
    assert not finding.ok
    assert words in finding.note


def test_a_limit_of_time_is_told() -> None:
    found = variant_findings(eg.load(models.EXAMPLES / "pendulum.yaml"), seconds=0.0)
    assert all(f.left_out and "not reached" in f.note for f in found)
    assert all(f.ok for f in found)
