"""Golden recordings: every model of the registry computes what the version before the rebuilding computed."""

import json
from pathlib import Path
from typing import Any

import golden
import models
import numpy as np
import pytest

import eomgen as eg

#: Models whose compiled code is compared too, of each kind that the code generator tells apart; half are built anyway.
COMPILED = (
    "slider_crank", "peaucellier", "rolling_disc", "wheelset", "rimless_wheel", "hydraulic_boom", "heap", "skate",
    "every_joint",
)  # fmt: skip
CASES = [(name, "numpy") for name in models.MODELS] + [(name, "cython") for name in COMPILED]


def beyond(old: dict[str, object], new: dict[str, object]) -> dict[str, float]:
    return {key: gap for key, gap in golden.differences(old, new).items() if not gap <= 1.0}


@pytest.mark.parametrize(("name", "target"), CASES, ids=[f"{name}-{target}" for name, target in CASES])
def test_as_recorded(name: str, target: str) -> None:
    old = golden.read(name)
    new = golden.recording(name, target, old["states"])
    assert not beyond(old, new)
    assert new["freedoms"] == models.MODELS[name].freedoms  # counted by hand


def test_faulty_files_name_the_same_places() -> None:
    assert golden.faults() == golden.read("faults")


def test_the_schema_of_model_files() -> None:
    """As recorded, but for the place ``on`` whose axes another place may be given in."""
    assert without_on(golden.schema()) == golden.read("schema")


def without_on(value: Any) -> Any:
    if isinstance(value, dict):
        kept = {key: x for key, x in value.items() if key != "on" or x.get("$ref") != "#/$defs/placement"}
        return {key: without_on(x) for key, x in kept.items()}
    return [without_on(x) for x in value] if isinstance(value, list) else value


def test_a_difference_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = golden.read("slider_crank")
    for folder in ("old", "new"):
        (tmp_path / folder).mkdir()
        for name in ("slider_crank", "faults", "schema"):
            (tmp_path / folder / f"{name}.json").write_text(json.dumps(golden.read(name)))
    assert golden.compare(tmp_path / "old", tmp_path / "new") == 0
    old["bias"][1][2] *= 1 + 1e-8
    (tmp_path / "new" / "slider_crank.json").write_text(json.dumps(old))
    assert golden.compare(tmp_path / "old", tmp_path / "new") == 1
    assert "slider_crank.bias" in capsys.readouterr().out
    del old["rhs"]
    assert beyond(golden.read("slider_crank"), old)["rhs"] == np.inf


def test_every_example_is_recorded() -> None:
    shipped = {path.stem for path in Path(models.EXAMPLES).glob("*.yaml")}
    assert shipped <= models.MODELS.keys()
    assert {path.stem for path in golden.RECORDINGS.glob("*.json")} == models.MODELS.keys() | {"faults", "schema"}
    assert isinstance(models.build("cart_table"), eg.Model)
