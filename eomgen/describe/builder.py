"""Stage describe, the builder: Python calls -> Description -> Mechanism."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

from ..base.names import hint
from ..constraints import CONSTRAINTS
from ..errors import UnavailableError
from ..forces import FORCES
from ..joints import JOINTS
from .build_mechanism import build
from .description import GROUND_NAME, SECTIONS, Description, without_defaults
from .element_methods import ElementMethods
from .handles import BodyHandle, JointHandle, Names, Settings
from .keywords import check_keywords, keywords_of
from .model_bodies import BodyMethods
from .model_components import ComponentMethods
from .model_functions import FunctionMethods
from .model_states import StateMethods
from .model_totals import TotalMethods
from .sympy_face import named, names_of, one_or_several, symbol

if TYPE_CHECKING:
    from os import PathLike

    from .mechanism import Mechanism

Value = Any  # a number, a text or a SymPy expression
Vector = Sequence[Any]


class Builder(BodyMethods, ElementMethods, FunctionMethods, StateMethods, TotalMethods, ComponentMethods):
    """What a :class:`~..api.model.Model` is told: methods that add to its description."""

    def __init__(
        self, name: str, gravity: Vector | None = None, doc: str = "", *, check_inertia: bool | str = True
    ) -> None:
        values: dict[str, Any] = {"name": name}
        if gravity is not None:
            values["gravity"] = gravity
        if not isinstance(doc, str) or doc:
            values["doc"] = doc
        if check_inertia is not True:
            values["check_inertia"] = check_inertia
        self._start(Description(values=values))
        self._note_line("name", "gravity")

    def _start(self, description: Description) -> None:
        self._description = description
        for key in ("initial", "guess", "simulation"):
            if isinstance(description.values.get(key, {}), dict):
                description.values[key] = Settings(description.values.get(key, {}))
        independent = description.values.get("independent", [])
        if isinstance(independent, list | tuple):
            description.values["independent"] = Names(independent)

    @classmethod
    def from_description(cls, description: Description) -> Self:
        """Make a model from a description, as the readers of model files do."""
        model = cls.__new__(cls)
        model._start(description)
        if not description.lines:  # of no file
            model._note_line(*description.values, *SECTIONS)
        return model

    @classmethod
    def from_lagrangian(
        cls,
        name: str,
        L: Any,
        coordinates: Sequence[Any],
        forces: Sequence[Any] | Mapping[Any, Any] | None = None,
        dissipation: Any = None,
        constraints: Sequence[Any] = (),
        parameters: Mapping[Any, Any] | None = None,
        inputs: Mapping[Any, Any] | None = None,
        latex: Mapping[Any, str] | None = None,
    ) -> Self:
        """Make a model from a Lagrangian; see :func:`eomgen.describe.lagrangian.describe_lagrangian`."""
        from .lagrangian import describe_lagrangian
        from .sympy_names import SympyNames

        coordinates = one_or_several(coordinates)
        given = [L, coordinates, forces, dissipation, constraints, parameters, inputs]
        names = SympyNames(given, coordinates)
        return cls.from_description(names.noted(describe_lagrangian(name, *names.put([*given, names.latex(latex)]))))

    @classmethod
    def from_equations(
        cls, name: str, coordinates: Sequence[Any], mass_matrix: Any, forcing: Any, **further: Any
    ) -> Self:
        """Make a model from equations M v' = f; see :func:`eomgen.describe.given_equations.describe_equations`."""
        from .given_equations import describe_equations
        from .sympy_names import SympyNames

        check_keywords("from_equations", further, keywords_of(describe_equations))
        coordinates = one_or_several(coordinates)
        names = SympyNames([coordinates, mass_matrix, forcing, further], coordinates)
        further = names.put(further) | {"latex": names.latex(further.get("latex"))}
        return cls.from_description(
            names.noted(describe_equations(name, *names.put([coordinates, mass_matrix, forcing]), **further))
        )

    # -- quantities -----------------------------------------------------------------------------------------------
    def parameter(self, name: str, value: Value = None, unit: str = "", doc: str = "", latex: str = "") -> Any:
        """Declare a parameter: a constant that can change between runs.

        Parameters
        ----------
        name : str
            Identifier.
        value : number, optional
            Needed to compile, not to derive.
        unit : str, optional
            Unit of the value, such as ``"mm"`` or ``"N*m/rad"``; the value is converted to SI units.
        doc : str, optional
            For display.
        latex : str, optional
            How formulas and plots print it, such as ``"m_{c}"``; from its name unless given.

        Returns
        -------
        sympy.Symbol
        """
        self._quantity("parameters", name, value, unit, doc, latex)
        return symbol(name)

    def input(
        self,
        name: str,
        value: Value = 0.0,
        unit: str = "",
        doc: str = "",
        signal: Value | None = None,
        latex: str = "",
    ) -> Any:
        """Declare an input, a quantity that is given over time; ``value`` is used as long as a call gives none.

        ``signal``, an expression of t, coordinates, velocities and parameters, is what runs take that give none;
        calls of the module's own functions still take ``value``.  ``unit``, ``doc`` and ``latex`` are those
        of :meth:`parameter`.

        Returns
        -------
        sympy.Symbol
        """
        self._quantity("inputs", name, value, unit, doc, latex)
        if signal is not None:
            self._description.sections["inputs"][-1].values["signal"] = signal
        return symbol(name)

    def output(self, name: str, expression: Value, unit: str = "", doc: str = "", latex: str = "") -> None:
        """Declare an output: a named result of the model.

        Parameters
        ----------
        name : str
            Identifier; it may repeat a coordinate if the expression is that coordinate.
        expression : number, str or SymPy expression
            In t, parameters, inputs, coordinates, their rates, the motion of markers and other outputs.
        unit : str, optional
            Unit in which the result is given; without one it is in SI units.
        doc : str, optional
            For display.
        latex : str, optional
            How formulas and plots print it, in LaTeX; from its name unless given.
        """
        self._quantity("outputs", name, expression, unit, doc, latex, key="expression")

    def event(
        self,
        name: str,
        expression: Value,
        terminal: bool | int = False,
        direction: int = 0,
        reset: Mapping[Any, Value] | None = None,
        restitution: Value | None = None,
        doc: str = "",
        friction: Value | None = None,
        slip: str | Sequence[str] | None = None,
    ) -> None:
        """Declare an event: runs find the time where an expression becomes zero, and can stop or reset the state there.

        Parameters
        ----------
        name : str
            Identifier, for ``Trajectory.t_events[name]``.
        expression : number, str or SymPy expression
            In t, parameters, inputs, coordinates, velocities, the position and velocity of markers, and outputs that
            need no accelerations.
        terminal : bool or int
            End the run there; a number: when it has happened so often.
        direction : {0, 1, -1}
            Both ways, only where it rises, only where it falls.
        reset : mapping of coordinates and velocities to expressions, optional
            New values, all from the state right before.  Positions and velocities are brought back onto the
            constraints afterwards.
        restitution : float, optional
            The expression is a gap between bodies; where it closes an impact opens it again, this much slower (0 to
            1; Newton's law), with impulses that obey all joints.
        doc : str, optional
        friction : float, optional
            Beside a restitution: the coefficient of Coulomb friction in the impact.
        slip : str or sequence of str, optional
            Beside friction: the output that is the sliding velocity, linear in the velocities; in space two outputs,
            along directions at right angles.
        """
        given = {
            "expression": expression,
            "terminal": terminal,
            "direction": direction,
            "reset": None if isinstance(reset, dict) and not reset else reset,
        }
        given |= {"restitution": restitution, "doc": doc, "friction": friction, "slip": slip}
        defaults = {"terminal": False, "direction": 0, "doc": ""}
        self._add("events", name, without_defaults(given, defaults))

    def _quantity(
        self, section: str, name: str, value: Value, unit: str, doc: str, latex: str, key: str = "value"
    ) -> None:
        given = {key: value, "unit": unit, "doc": doc, "latex": latex}
        self._add(section, name, without_defaults(given, {"unit": "", "doc": "", "latex": "", key: ""}))

    def coordinate(self, name: str) -> Any:
        """The SymPy symbol of a coordinate, by name; it is looked up when the model is checked."""
        return symbol(name)

    @property
    def t(self) -> Any:
        """The time, as a SymPy symbol."""
        return symbol("t")

    @property
    def kinetic_energy(self) -> Any:
        """The kinetic energy of the mechanism, as a SymPy symbol for outputs."""
        return symbol("kinetic_energy")

    @property
    def potential_energy(self) -> Any:
        """The potential energy of gravity and springs, as a SymPy symbol for outputs."""
        return symbol("potential_energy")

    # -- bodies ---------------------------------------------------------------------------------------------------
    @property
    def ground(self) -> BodyHandle:
        """The ground, which has markers like a body."""
        return self._body_handle(GROUND_NAME)

    @property
    def bodies(self) -> dict[str, BodyHandle]:
        """Handles of all bodies, by name."""
        names = (entry.name for entry in self._description.sections["bodies"])
        return {name: self._body_handle(name) for name in names if name != GROUND_NAME}

    @property
    def joints(self) -> dict[str, JointHandle]:
        """Handles of all joints, by name."""
        return {entry.name: JointHandle(self, entry) for entry in self._description.sections["joints"]}

    @property
    def parameters(self) -> dict[str, Any]:
        """SymPy symbols of all parameters, by name."""
        return {entry.name: symbol(entry.name) for entry in self._description.sections["parameters"]}

    def _body_handle(self, name: str) -> BodyHandle:
        entries = self._description.sections["bodies"]
        return BodyHandle(self, name, next((entry for entry in entries if entry.name == name), None))

    # -- settings -------------------------------------------------------------------------------------------------
    @property
    def gravity(self) -> Any:
        """Acceleration of gravity in ground axes (m/s^2), three values; assign others to change it."""
        return self._description.values.get("gravity", (0, 0, 0))

    @gravity.setter
    def gravity(self, acceleration: Vector) -> None:
        self._description.values["gravity"] = acceleration

    @property
    def initial(self) -> Any:
        """Initial values by coordinate or ``<coordinate>_dot``: ``m.initial(theta=0.3)``, ``m.initial["theta"]``."""
        return self._description.values["initial"]

    @initial.setter
    def initial(self, values: Mapping[Any, Any]) -> None:
        self._description.values["initial"] = Settings(named("initial", values))

    @property
    def guess(self) -> Any:
        """Rough values of coordinates from which the loops are closed: ``m.guess(phi=1.2)``."""
        return self._description.values["guess"]

    @guess.setter
    def guess(self, values: Mapping[Any, Any]) -> None:
        self._description.values["guess"] = Settings(named("guess", values))

    @property
    def independent(self) -> Any:
        """Independent coordinates of a mechanism with loops: ``m.independent("theta")``, or assign a list."""
        return self._description.values["independent"]

    @independent.setter
    def independent(self, names: Sequence[Any]) -> None:
        self._description.values["independent"] = Names(names_of("independent", names, "a coordinate"))

    @property
    def simulation(self) -> Any:
        """Defaults of a simulation: ``m.simulation(end=5, rtol=1e-9)``."""
        return self._description.values["simulation"]

    @simulation.setter
    def simulation(self, values: Mapping[str, Any]) -> None:
        self._description.values["simulation"] = Settings(named("simulation", values))

    # -- what comes next ------------------------------------------------------------------------------------------
    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on what an import left out or changed, and on accepted doubtful values, one sentence each."""
        return tuple(self._description.notes)

    @property
    def renamed(self) -> dict[str, dict[str, str]]:
        """Names that an import changed: section -> name in the file, or in SymPy -> name in the model."""
        return self._description.renamed

    def mechanism(self) -> Mechanism:
        """Check the model and translate it to one expression graph.

        Returns
        -------
        Mechanism

        Raises
        ------
        ModelError
            The model has faults; ``.problems`` lists all of them.
        """
        return build(self._description)

    def to_yaml(self) -> str:
        """The model as the text of a model file."""
        from .write_yaml import yaml_text

        return yaml_text(self._description)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model to a model file; if writing fails, a file that already exists stays unchanged."""
        from ..base.files import write_whole

        write_whole(path, self.to_yaml())

    # -- display --------------------------------------------------------------------------------------------------
    if not TYPE_CHECKING:  # type checkers know all attributes

        def __getattr__(self, name: str) -> Any:
            if not name.startswith("_"):
                method = self._method(name)
                if method is not None:
                    return method
            raise UnavailableError(f"a Model has no attribute {name!r}; {self._near(name)}")

        def __setattr__(self, name: str, value: Any) -> None:
            """Set what a Model knows; another name would be set without any effect, so it is refused."""
            if not name.startswith("_") and not isinstance(getattr(type(self), name, None), property):
                raise UnavailableError(f"a Model has no attribute {name!r} to set; {self._near(name)}")
            super().__setattr__(name, value)

    def _near(self, name: str) -> str:
        """A suggestion for a name that does not exist."""
        known = (*dir(type(self)), *JOINTS, *FORCES, *CONSTRAINTS)
        return hint(name, [n for n in known if not n.startswith("_")]) or (
            f"joints: {', '.join(JOINTS)}; forces: {', '.join(FORCES)}; constraints: {', '.join(CONSTRAINTS)}"
        )

    def _counts(self) -> str:
        counts = ((section, len(self._description.sections[section])) for section in SECTIONS)
        return ", ".join(f"{number} {_SINGULAR[s] if number == 1 else s}" for s, number in counts if number)

    def __repr__(self) -> str:
        kinds = {"lagrangian": "Lagrangian", "equations": "given equations"}
        kind = "".join(word for key, word in kinds.items() if self._description.values.get(key) is not None)
        return f"<Model {self.name}: {', '.join(part for part in (kind, self._counts()) if part) or 'empty'}>"

    def _repr_html_(self) -> str:
        from .display import model_html

        return model_html(self._description)


_SINGULAR = {section: {"bodies": "body"}.get(section, section[:-1]) for section in SECTIONS}
