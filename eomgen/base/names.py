"""Names: one that is not known -> those that were probably meant; parts of dotted names; places of markers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

LONGEST = 64  #: characters of a name

MOST = 2000  #: names beyond which a comparison with each takes long


def closest(name: object, known: Iterable[str], most: int = 1) -> list[str]:
    """At most so many known names, those spelled most alike first; one that differs in case alone is the only one."""
    from difflib import get_close_matches  # only needed once something is wrong

    folded = {option.lower(): option for option in known}
    word = str(name).lower()
    if word in folded:
        return [folded[word]]
    return [folded[near] for near in get_close_matches(word, folded, most)] if len(folded) <= MOST else []


def hint(name: object, known: Iterable[str], quoted: bool = True) -> str:
    """``"did you mean 'theta'?"`` if a known name is near, else an empty text."""
    near = closest(name, known)
    return "" if not near else f"did you mean {near[0]!r}?" if quoted else f"did you mean {near[0]}?"


def joined(*parts: str, by: str = "; ") -> str:
    """The parts that are not empty."""
    return by.join(part for part in parts if part)


# -- names of instances: ``leg1.hip``, as people write it, -> ``leg1_hip``, as the model has it ------------------------


def undotted(name: str, instances: Mapping[str, str]) -> str:
    """A name whose first part is an instance: its prefix and the rest, instances within instances too.

    As ``leg1.hip``, or ``leg1.shin.end`` of a marker; ``instances`` has the prefix of each instance.
    """
    head, _, rest = name.partition(".")
    while rest and head in instances:
        name = instances[head] + rest
        head, _, rest = name.partition(".")
    return name


# -- place and velocity of a marker, in ground axes: ``x(rod.tip)`` and ``vx(rod.tip)`` --------------------------------


_PLACE = re.compile(r"(v?[xyz])\((\w+(?:\.\w+)*)\)")


def place_of_marker(name: object) -> tuple[str, str] | None:
    """``x`` or ``vx`` and the marker of a name such as ``x(rod.tip)``; None for other names."""
    match = _PLACE.fullmatch(name.replace(" ", "")) if isinstance(name, str) else None
    return (match[1], match[2]) if match else None


def acceleration_name(velocity: str) -> str:
    """``theta_dot`` -> ``theta_ddot``; ``ball_wx`` -> ``ball_wx_dot``."""
    return velocity[:-4] + "_ddot" if velocity.endswith("_dot") else velocity + "_dot"
