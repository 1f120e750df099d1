"""A method for every type in the tables, and for every section of single entries; element_methods.pyi lists them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MethodType
from typing import Any

from ..elements.element_type import ElementType
from ..elements.kinds import Functions
from .fields import BODY, ELEMENTS, EVENT, FUNCTION, INPUT, OUTPUT_FIELDS, PARAMETER, PYTHON_SLOPES, SOLID, STATE
from .handles import Described, JointHandle, References
from .methods import method_of

#: Section of single entries -> the method that adds one, and its keys in the order of arguments.
ENTRIES = {
    "parameters": ElementType("parameter", "a parameter: a constant that can change between runs.", PARAMETER),
    "inputs": ElementType(
        "input",
        "an input, a quantity that is given over time.  Runs that give none take its signal; calls of the module's own "
        "functions take its value.",
        INPUT,
    ),
    "outputs": ElementType(
        "output",
        "an output: a named result of the model.  It may repeat a coordinate if the expression is that coordinate.",
        OUTPUT_FIELDS,
    ),
    "states": ElementType(
        "state",
        "a first-order state s with s' = rate: an activation, a pressure, what a filter or controller holds.  Its rate "
        "is ``<name>_dot``.",
        {key: STATE[key] for key in ("rate", "initial", "unit", "doc", "latex")},
    ),
    "events": ElementType(
        "event",
        "an event: runs find the time where an expression becomes zero, and can stop or reset the state there.  The "
        "times are in ``Trajectory.t_events[name]``.  With a restitution the expression is a gap between bodies: where "
        "it closes an impact opens it again, this much slower, with impulses that obey all joints.",
        EVENT,
    ),
    "functions": ElementType(
        "table",
        "a table: a smooth function through its points, which is called on SymPy expressions and, in texts, by its "
        "name.",
        FUNCTION["table"],
    ),
    "bodies": ElementType(
        "body",
        "a rigid body.  Values are numbers, texts or SymPy expressions of parameters; parameters stay symbols in the "
        'equations.  Solids are mappings ``{"type": "box", "size": (a, b, c), "density": rho, "at": (x, y, z), "rpy": '
        f'(r, p, y)}}`` of the types {", ".join(SOLID)}; ``"subtract": True`` makes a hole.  Points are ``{{"mass": m, '
        '"at": (x, y, z)}``.  Markers are positions, ``{"tip": (l, 0, 0)}``, or mappings of what '
        ":meth:`~.handles.BodyHandle.marker` takes.",
        BODY,
    ),
}
SAMPLED = ElementType(
    "sampled",
    "a state that is kept, and renewed at the times offset + k period: what a digital controller gives.  States of one "
    "period and offset are renewed together, in the order of their declaration; each takes those before it at their "
    "new values.  ``<name>_samples`` counts the samples and ``<name>_sampled`` is the event, for the first of them.",
    {
        "sampled": STATE["sampled"].replace(
            doc="the new value, of what the rate of a state may depend on; without one the state keeps its value, "
            "unless a run gives a function for it: ``simulate(controllers={name: f})``"
        ),
        "period": STATE["period"].replace(
            doc="time from one sampling time to the next (s); of parameters, if an expression"
        ),
        "offset": STATE["offset"].replace(doc="a sampling time (s), 0 unless given; of parameters too"),
        "initial": STATE["initial"].replace(doc="the value before the first sampling time", default=0.0),
        **{key: STATE[key] for key in ("unit", "doc", "latex")},
    },
)
NATIVE = ElementType(
    "native",
    "a function written in C; its source is compiled with the model and goes into exported packages.",
    {
        "source": FUNCTION["native"]["source"].replace(
            doc="C file that defines the functions named, each ``double f(double, ...)``; it includes nothing but "
            "system headers, and its other functions are static",
            annotation="Any",
            argument="str or path",
        ),
        "function": FUNCTION["native"]["function"].replace(doc="C function of the value, ``name`` unless given"),
        "arguments": FUNCTION["native"]["arguments"].replace(annotation="int", argument="int"),
        "derivatives": Functions("C functions of the derivative along each argument; None gives a central difference"),
        "second_derivatives": Functions(
            "those along arguments 1 1, 1 2, ..., 2 2, ...; None gives a central difference of a first one"
        ),
        "python": FUNCTION["native"]["python"].replace(
            doc="the same in Python, for what is evaluated without C: constraints, masses, target ``numpy``.  A "
            "callable takes floats, one point at a time (a NumPy ufunc: arrays); a file has functions of the same "
            "names as the C source",
            annotation="Any",
            argument="callable or path",
        ),
        **PYTHON_SLOPES,
    },
)


def methods() -> dict[str, Mapping[str, ElementType]]:
    """Section -> what its methods add, by name."""
    single: dict[str, Mapping[str, ElementType]] = {section: {one.name: one} for section, one in ENTRIES.items()}
    for section, one in (("states", SAMPLED), ("functions", NATIVE)):
        single[section] = {**single[section], one.name: one}
    return single | ELEMENTS


class ElementMethods(Described):
    """Methods of Model that add elements; bodies, markers and joints are handles or names.

    Where a joint is asked for, a coordinate (its SymPy symbol or its name) says which one of several is meant.
    """

    def joint(self, type: str, name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
        """Add a joint of any type.

        Parameters
        ----------
        type : str
            A type of joint, e.g. ``"revolute"``.
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers.
        **keys
            Whatever the method of the type takes.

        Returns
        -------
        JointHandle
        """
        between = [References(self).marker(end) for end in (predecessor, successor)]
        raw = {key: value for key, value in keys.items() if value is not None}
        return JointHandle(self, self._add("joints", name, {"type": type, "between": between, **raw}))

    def _method(self, name: str) -> Any:
        """The method of a type that was added to the tables later; None if there is none."""
        for section, types in ELEMENTS.items():
            if name in types:
                return MethodType(method_of(section, types[name]), self)
        return None


class _Unmade:
    """In the place of a type's method until it is first used: to make all of them takes 15 ms."""

    def __init__(self, section: str, types: Mapping[str, ElementType], name: str) -> None:
        self.section, self.types, self.name = section, types, name

    def __get__(self, model: Described | None, kind: Any) -> Any:
        method = method_of(self.section, self.types[self.name])
        setattr(ElementMethods, self.name, method)
        return method if model is None else MethodType(method, model)


for _section, _types in methods().items():
    for _name in _types:
        setattr(ElementMethods, _name, _Unmade(_section, _types, _name))
