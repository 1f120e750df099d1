"""LaTeX given for names -> checked, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..base.latex import NotationError, read_latex, spaced
from ..elements import kinds
from ..expr.shown import quoted, shown
from .description import Description, items
from .names import nearest
from .sympy_face import name_of, named
from .values import Reader

#: What multipliers of constraint equations are called, with a number; the second word where names look like the first.
MULTIPLIERS = ("lambda", "multiplier")


def numbered(word: str, count: int) -> list[str]:
    """``lambda_1``, ``lambda_2``, ...

    Parameters
    ----------
    word : str
    count : int
    """
    return [f"{word}_{k + 1}" for k in range(count)]


def take_latex(reader: Reader, path: str, name: Any, given: Any) -> None:
    """Take in the LaTeX of a name; what is no LaTeX of a symbol is a fault."""
    text = reader.text(path, given)
    if not text:
        return
    try:
        read_latex(text)
    except NotationError as error:
        reader.fault(path, str(error), error.remedy, "EG-NOTATION")
        return
    text = spaced(text)
    if reader.latex.setdefault(str(name), text) != text:  # an output that repeats a coordinate
        remedy = "leave one of them out"
        reader.fault(path, f"{name!r} is printed as {quoted(reader.latex[name])} already", remedy, "EG-NAME-TAKEN")


def take_coordinates_latex(
    reader: Reader, path: str, coordinates: Sequence[str], given: Any, others: Sequence[str] = ()
) -> None:
    """Take in the LaTeX of coordinates: a text for one, a list in their order, or a mapping of names.

    A mapping may hold other names too, such as those of velocities and multipliers.
    """
    if isinstance(given, Mapping):
        for key, text in given.items():
            name = name_of(key)
            if name in coordinates or name in others:
                take_latex(reader, f"{path}.{name}", name, text)
            else:
                remedy = nearest(shown(name), [*coordinates, *others], f"coordinates{' and velocities' * bool(others)}")
                reader.fault(f"{path}.{shown(name)}", f"no coordinate {quoted(name)}", remedy, "EG-NAME-UNKNOWN")
        return
    listed = [given] if isinstance(given, str) else items(given)
    if listed is None:
        reader.wrong(path, given, kinds.Latexes)
    elif listed and len(listed) != len(coordinates):
        message = f"{len(listed)} texts for {len(coordinates)} coordinates"
        reader.fault(path, message, f"give one for each: {', '.join(coordinates) or 'none'}", "EG-SHAPE")
    else:
        for k, (name, text) in enumerate(zip(coordinates, listed, strict=False)):
            if text is not None:
                take_latex(reader, path if isinstance(given, str) else f"{path}[{k}]", name, text)


def give_latex(description: Description, section: str, latex: Mapping[Any, str] | None) -> None:
    """Put the LaTeX of names where each is described: parameters, inputs, outputs, else coordinates of the section."""
    entries = {e.name: e for place in ("outputs", "parameters", "inputs") for e in description.sections[place]}
    for name, text in named("latex", latex).items():
        home = entries[name].values if name in entries else description.values[section].setdefault("latex", {})
        home["latex" if name in entries else name] = text
