"""The text of a unit -> its dimension and how many SI units it is.

Words that are SI units without a prefix are known here.  Every other word is looked up with pint, which is imported
then and not before.  The text is split into words and powers here, so that it is never run as code.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base.texts import closest
from ..elements import dimensions
from ..elements.dimensions import Dimension
from ..expr.texts import quoted

if TYPE_CHECKING:
    import pint

_CURRENT, _TEMPERATURE = Dimension(current=1), Dimension(temperature=1)
_POWER, _PRESSURE = dimensions.ENERGY.times(dimensions.TIME, -1), dimensions.FORCE.times(dimensions.LENGTH, -2)
_VOLT = _POWER.times(_CURRENT, -1)
#: SI units without prefix -> dimension; a value in them is the number that a module works with.
SI = {
    "m": dimensions.LENGTH, "kg": dimensions.MASS, "s": dimensions.TIME, "rad": dimensions.NONE, "A": _CURRENT,
    "K": _TEMPERATURE, "N": dimensions.FORCE, "J": dimensions.ENERGY, "W": _POWER, "Pa": _PRESSURE,
    "Hz": dimensions.SPIN, "V": _VOLT, "ohm": _VOLT.times(_CURRENT, -1), "C": _CURRENT.times(dimensions.TIME),
    "1": dimensions.NONE,
}  # fmt: skip
#: How a dimension is written, where a product of m, kg, s, ... is not what people write.
_WRITTEN = {
    dimensions.FORCE: "N", dimensions.ENERGY: "N*m", _POWER: "W", _PRESSURE: "Pa",
    dimensions.FORCE.times(dimensions.LENGTH, -1): "N/m",
    dimensions.FORCE.times(dimensions.SPEED, -1): "N*s/m",
    dimensions.ENERGY.times(dimensions.TIME): "N*m*s",
    dimensions.FORCE.times(dimensions.TIME): "N*s", _VOLT: "V", _VOLT.times(_CURRENT, -1): "ohm",
}  # fmt: skip
_BASES = ("m", "kg", "s", "", "A", "K")
_PINT = {
    "[length]": dimensions.LENGTH, "[mass]": dimensions.MASS, "[time]": dimensions.TIME, "[current]": _CURRENT,
    "[temperature]": _TEMPERATURE,
}  # fmt: skip
#: Words that are suggested for unknown ones.
COMMON = (
    *SI, "mm", "cm", "km", "g", "t", "ms", "min", "h", "deg", "rpm", "kN", "mN", "MPa", "GPa", "bar", "lb", "inch",
    "N*m", "N*s", "N*mm", "kN*m", "kg*m^2", "m^2", "m^3",
)  # fmt: skip
_TOKEN = re.compile(r"\s*(?:(?P<word>[^\W\d_]\w*|%|1)|(?P<mark>\*\*|[*/^()]|·))")
_EXPONENT = re.compile(r"\s*(\(\s*)?([+-]?\d{1,2}(?:\.\d{1,6})?)(?:\s*/\s*(\d{1,2}))?(?(1)\s*\))")
_FORM = "write products and powers of units, as in N*m/rad, kg*m^2, mm"


class Unit(NamedTuple):
    """A unit: its dimension, its size in SI units, its text with SI units in place of others, and as it was given."""

    dimension: Dimension
    size: float = 1.0
    si: str = ""
    text: str = ""


class UnitError(ValueError):
    """A text is no unit; ``remedy`` says what to write instead."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message)
        self.remedy = remedy


@cache
def read_unit(text: str) -> Unit:
    """The unit of a text such as ``kg*m^2``, ``N m/rad``, ``mm``.

    Raises UnitError if it is not made of units, or of units with an offset (degC).
    """
    if text and not text.strip():
        raise UnitError(f"{quoted(text)} is not a unit", "leave the unit out if there is none")
    text = text.strip()
    if not text or text == "-":
        return Unit(dimensions.NONE, 1.0, "")
    dimension, size, only_si = dimensions.NONE, 1.0, True
    for word, power in _factors(text):
        unit, factor, is_si = (SI[word], 1.0, True) if word in SI else _looked_up(word, text)
        dimension = dimension.times(unit, power)
        only_si = only_si and is_si
        try:
            size *= factor**power
        except OverflowError:
            size = math.inf
    if not (math.isfinite(size) and size > 0.0):
        raise UnitError(f"{quoted(text)} has a size that is not finite", _FORM)
    return Unit(dimension, size, text if only_si else si_text(dimension, text), text)


def sound_unit(text: Any) -> Unit | None:
    """The unit of a text; None where there is none, or it is at fault, which is reported where the unit is read."""
    try:
        return read_unit(text) if isinstance(text, str) and text else None
    except UnitError:
        return None


def si_text(dimension: Dimension, text: str = "") -> str:
    """The SI unit of a dimension; ``text`` is the unit that it stands for, by which angles keep their rad.

    Examples
    --------
    >>> from eomgen.elements.dimensions import ENERGY
    >>> si_text(ENERGY)
    'N*m'
    """
    dimension = Dimension(*(round(power, 9) + 0.0 for power in dimension))
    angle = bool(re.search(r"\b(rad|deg|degree|degrees|rev|rpm|turn|revolution|[a-z]*rad)\b", text))
    written = _WRITTEN.get(dimension)
    if written is None:
        powers = sorted(zip(_BASES, dimension, strict=True), key=lambda pair: pair[0] != "kg")  # kg*m^2
        over = "*".join(_powered(base, power) for base, power in powers if power > 0)
        under = "/".join(_powered(base, -power) for base, power in powers if power < 0)
        written = over + (f"/{under}" if under else "")
    if angle and (not written or written.startswith("/")):
        return f"rad{written}"
    return f"1{written}" if not written or written.startswith("/") else written


def _powered(base: str, power: float) -> str:
    return base if power == 1 else f"{base}^{power:g}"


def _factors(text: str) -> Iterator[tuple[str, float]]:
    """Words and their powers: ``a*b/c`` divides by c, ``a/(b*c)`` by both, a space multiplies."""
    position, sign, depth, signs = 0, 1.0, 0, [1.0]
    expect = True  # a word, rather than a mark
    while text[position:].strip():
        result = _TOKEN.match(text, position)
        if result is None or (result["mark"] not in (None, "(") and expect):
            break
        position, word, mark = result.end(), result["word"], result["mark"]
        if word is not None:
            power = 1.0
            raised = re.compile(r"\s*(\*\*|\^)").match(text, position)
            if raised:
                number = _EXPONENT.match(text, raised.end())
                if number is None:
                    break
                power, position = float(number[2]) / float(number[3] or 1), number.end()
            yield word, sign * signs[-1] * power
            sign, expect = 1.0, False
        elif mark == "(":
            signs.append(signs[-1] * sign)
            sign, depth, expect = 1.0, depth + 1, True
        elif mark == ")" and depth:
            signs.pop()
            depth -= 1
        elif mark in ("*", "/", "·"):
            sign, expect = (-1.0 if mark == "/" else 1.0), True
        else:
            break
    else:
        if not expect and not depth:
            return
    raise UnitError(f"{quoted(text)} is not a unit", _FORM)


@cache
def _registry() -> pint.UnitRegistry[Any]:
    """The units of pint; made once, as it takes a while."""
    import pint

    return pint.UnitRegistry()


def _looked_up(word: str, text: str) -> tuple[Dimension, float, bool]:
    """Dimension and size of one word."""
    registry = _registry()
    of = "" if word == text else f" in {quoted(text)}"
    unknown = f"no unit {quoted(word)}{of}"
    try:
        unit = registry.Unit("percent" if word == "%" else word)
        one = registry.Quantity(1.0, unit)
    except Exception as error:  # of many classes: the word may be any
        near = closest(word, COMMON)
        raise UnitError(unknown, (f"did you mean {near[0]!r}? " if near else "") + _FORM) from error
    if "number_meter" in str(unit):  # that of a yarn
        raise UnitError(unknown, "write N*m for a torque; " + _FORM)
    if not one._is_multiplicative:
        raise UnitError(
            f"{quoted(word)}{of} has a zero point of its own",
            "give the temperature in K" if "[temperature]" in dict(unit.dimensionality) else "give it in an SI unit",
        )
    dimension = dimensions.NONE
    powers: dict[str, Any] = dict(unit.dimensionality)
    for base, power in powers.items():
        if base not in _PINT:
            raise UnitError(f"{quoted(word)}{of} is a unit of {base.strip('[]')}, which models do not have", _FORM)
        dimension = dimension.times(_PINT[base], float(power))
    size: Any = one.to_base_units().magnitude
    return dimension, float(size), False
