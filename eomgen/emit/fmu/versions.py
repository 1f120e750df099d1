"""Versions of the standard, and what a Program must be to follow it."""

from __future__ import annotations

from ...errors import ModelError, UsageError
from ...program import Program

VERSIONS = ("2.0", "3.0")

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
    for known in VERSIONS:
        if str(version) in (known, known.partition(".")[0]):
            return known
    raise UsageError(f"there is no version {version!r} of FMI here; there are {', '.join(VERSIONS)}")


def require_values(program: Program) -> None:
    """Refuse what a unit cannot hold, all of it at once.

    Raises
    ------
    ModelError
        Parameters without values, or events whose impacts the generated code leaves to Python.
    """
    metadata, found = program.metadata, []
    missing = [name for name, x in zip(metadata["p_names"], metadata["p_values"], strict=True) if x is None]
    if missing:
        found.append(f"every parameter of an FMU needs a start value; give one to {', '.join(missing)}")
    impacts = [event["name"] for event in metadata.get("events", ()) if event["restitution"] is not None]
    if impacts:
        found.append(
            f"events with restitution cannot be exported to an FMU: {', '.join(impacts)}; describe the new velocities "
            "with reset"
        )
    if not metadata["n_x"]:
        found.append("the model has no coordinates, so that an FMU of it would have no states")
    if found:
        raise ModelError("; ".join(found))
