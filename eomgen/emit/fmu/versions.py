"""Versions of the standard, and what a Program must be to follow it."""

from __future__ import annotations

from ...errors import ModelError, Problem, no_choice
from ...program import Program
from ...targets import FMI_VERSIONS

#: Kernels that a unit calls; an FMU has those of them that the model has.
KERNELS = (
    *("rhs", "jacobian", "input_jacobian", "parameter_jacobian", "project", "kinematics"),
    *("outputs", "output_derivatives", "events", "resets"),
)


def check_version(version: str) -> str:
    """The version in full, from '2', '2.0', '3' or '3.0'.

    Raises
    ------
    UsageError
    """
    for known in FMI_VERSIONS:
        if str(version) in (known, known.partition(".")[0]):
            return known
    raise no_choice(f"there is no version {version!r} of FMI here; there are {', '.join(FMI_VERSIONS)}")


def refuse_impacts(program: Program) -> None:
    """Refuse events and contacts whose impacts the generated code leaves to Python.

    Raises
    ------
    ModelError
    """
    remedy = "describe the new velocities with reset, or leave the event out"
    problems = [
        Problem(f"events.{event['name']}.restitution", "an FMU cannot hold an impact", remedy, code="EG-UNSUPPORTED")
        for event in program.metadata.get("events", ())
        if event["restitution"] is not None
    ]
    problems += [
        Problem(
            f"contacts.{name}.normal_law",
            "rigid contacts exert impulses, which an FMU cannot hold",
            "choose another normal_law",
            code="EG-UNSUPPORTED",
        )
        for name in program.metadata.get("rigid_only", ())
    ]
    if problems:
        raise ModelError(problems)
