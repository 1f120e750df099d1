"""Names of instances: ``leg1.hip``, as people write it, -> ``leg1_hip``, as the model has it."""

from __future__ import annotations

from collections.abc import Mapping


def undotted(name: str, instances: Mapping[str, str]) -> str:
    """A name whose first part is an instance: its prefix and the rest, instances within instances too.

    Parameters
    ----------
    name : str
        Such as ``leg1.hip``, or ``leg1.shin.end`` of a marker.
    instances : mapping of str to str
        Name of an instance -> its prefix.
    """
    head, _, rest = name.partition(".")
    while rest and head in instances:
        name = instances[head] + rest
        head, _, rest = name.partition(".")
    return name
