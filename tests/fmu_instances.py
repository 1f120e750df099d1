"""Instances of functional mock-up units of FMI 2.0 by FMPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model


def opened(path: Path, kind: type = FMU2Model) -> tuple[Any, dict[str, int]]:
    """An instance, and the references of its variables by name."""
    folder = extract(str(path))
    description = read_model_description(folder)
    instance = kind(guid=description.guid, unzipDirectory=folder, modelIdentifier=path.stem, instanceName="i")
    instance.instantiate()
    return instance, {v.name: v.valueReference for v in description.modelVariables}


def initialized(instance: Any) -> None:
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
