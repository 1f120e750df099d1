"""Python calls -> Description -> Mechanism."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from itertools import chain
from os import PathLike
from typing import TYPE_CHECKING, Any, Self

from ..base.files import write_whole
from ..base.texts import hint
from ..errors import UnavailableError, UsageError, at_odds, ill_typed
from .build_mechanism import build
from .description import GROUND_NAME, SECTIONS, Description, Faults, model_html
from .element_methods import ElementMethods
from .equations import describe
from .fields import ELEMENTS, EQUATIONS
from .handles import (
    BodyHandle,
    Described,
    InstanceHandle,
    JointHandle,
    MarkerHandle,
    Names,
    References,
    Settings,
    Triple,
)
from .methods import check_keywords
from .names import fault_of_name
from .quantities import COM
from .sympy_face import named, names_of, require_name, symbol
from .yaml_file import describe_yaml_file, plain, plain_description, yaml_text

if TYPE_CHECKING:
    from .mechanism import Mechanism

Value = Any  # a number, a text or a SymPy expression
Vector = Sequence[Any]


def _symbol(name: str, doc: str) -> Any:
    """A property that is the SymPy symbol of a name."""
    return property(lambda model: symbol(name), doc=doc)


def _setting(key: str, default: Any, doc: str) -> Any:
    """A property that is a value of the description."""

    def give(model: Builder, value: Any) -> None:
        model._description.values[key] = value

    return property(lambda model: model._description.values.get(key, default), give, doc=doc)


def _settings(key: str, doc: str) -> Any:
    """A property that is a mapping of the description, to which values are assigned as one."""

    def give(model: Builder, values: Mapping[Any, Any]) -> None:
        model._description.values[key] = Settings(named(key, values))

    return property(lambda model: model._description.values[key], give, doc=doc)


class Builder(ElementMethods):
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
        """Make a model from a Lagrangian L = T - V.

        Parameters
        ----------
        name : str
            Identifier; the generated module bears it.
        L : sympy.Expr or str
            T - V in coordinates, velocities and t.
        coordinates : sequence
            Generalized coordinates: functions of time ``q(t)`` (``dynamicsymbols``), whose velocities are their
            derivatives, or plain symbols (or names) ``q``, whose velocities are the symbols ``q_dot``.
        forces : sequence or mapping, optional
            Generalized forces, one for each coordinate in order, or by coordinate.
        dissipation : sympy.Expr, optional
            Rayleigh's dissipation function D(q, q_dot); it adds the forces -dD/dq_dot.
        constraints : sequence of sympy.Expr, optional
            Constraints, each = 0: of coordinates and t (holonomic), or linear in the velocities (nonholonomic).
        parameters : mapping, optional
            Values by symbol or name.  Every other free symbol becomes a parameter without a value.
        inputs : mapping, optional
            Quantities given over time, by symbol or name: the value that holds while none is given.
        latex : mapping, optional
            How formulas and plots print coordinates, parameters and inputs, by symbol or name: ``{q: r"\\varphi"}``;
            also velocities, ``"q_dot"``, and the multipliers of the constraints, ``"lambda_1"``.

        Returns
        -------
        Model

        Raises
        ------
        ModelError
            A coordinate is neither a symbol nor a function of time ``q(t)``.
        """
        raw = {"coordinates": coordinates, "expression": L, "forces": forces, "dissipation": dissipation}
        raw |= {"constraints": constraints, "parameters": parameters, "inputs": inputs, "latex": latex}
        return cls.from_description(describe(name, "lagrangian", raw))

    @classmethod
    def from_equations(
        cls, name: str, coordinates: Sequence[Any], mass_matrix: Any, forcing: Any, **further: Any
    ) -> Self:
        """Make a model from equations of motion M v' = f, as the section ``equations`` of a model file does.

        Values are numbers, texts or SymPy expressions in symbols or functions of time.

        Parameters
        ----------
        name : str
            Identifier; the generated module bears it.
        coordinates : sequence
            Generalized coordinates q, in order.
        mass_matrix : (n, n) array or SymPy matrix
            M(q, t), symmetric.
        forcing : sequence of n
            f(q, v, t, inputs).
        velocities : sequence of n, optional
            Generalized velocities v; ``<coordinate>_dot`` unless given.
        rates : mapping, optional
            q' by coordinate, linear in v; the velocities in order unless given.
        intermediates : mapping, optional
            Named parts of the expressions; each may use those before it.
        constraints : sequence, optional
            Expressions that are 0: functions of coordinates and t, or linear in the velocities.
        multipliers : sequence of str, optional
            Names of the multipliers of the constraints, for outputs: M v' + C_q^T l = f.
        kinetic_energy, potential_energy : optional
            In J, for the balance of energy.
        parameters : mapping, optional
            Values by symbol or name.  Every other free symbol becomes a parameter without a value.
        inputs : mapping, optional
            Quantities given over time, by symbol or name: the value that holds while none is given.
        latex : mapping, optional
            How formulas and plots print coordinates, parameters and inputs, by symbol or name: ``{q: r"\\varphi"}``.

        Returns
        -------
        Model
        """
        check_keywords("from_equations", further, [*EQUATIONS, "parameters", "inputs"])
        raw = {"coordinates": coordinates, "mass_matrix": mass_matrix, "forcing": forcing}
        return cls.from_description(describe(name, "equations", raw | further))

    # -- names -----------------------------------------------------------------------------------------------------
    def coordinate(self, name: str) -> Any:
        """The SymPy symbol of a coordinate, by name; it is looked up when the model is checked."""
        return symbol(name)

    t = _symbol("t", "The time, as a SymPy symbol.")
    kinetic_energy = _symbol("kinetic_energy", "The kinetic energy of the mechanism, as a SymPy symbol for outputs.")
    potential_energy = _symbol(
        "potential_energy", "The potential energy of gravity and springs, as a SymPy symbol for outputs."
    )

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

    check_inertia = _setting(
        "check_inertia",
        True,
        "What happens to a mass and inertia that no rigid body can have: error (True), note or off (False).",
    )

    # -- components ---------------------------------------------------------------------------------------------------
    def attachment(self, name: str) -> MarkerHandle:
        """Declare a name for a marker of the model to which this one is added as a component; see :meth:`add`.

        Parameters
        ----------
        name : str
            Identifier.

        Returns
        -------
        MarkerHandle
            For joints, forces and outputs, like a marker of a body.
        """
        require_name("attachment", name)
        self._description.values["attachments"] = [*self._description.values.get("attachments", ()), name]
        return MarkerHandle(self, name)

    def add(
        self,
        component: Any,
        /,
        prefix: str = "",
        at: Any = None,
        parameters: Mapping[str, Any] | None = None,
        inputs: Mapping[str, Any] | None = None,
        **values: Any,
    ) -> InstanceHandle:
        """Add all parts of another model (bodies, joints, forces, ...) with a prefix before their names.

        The component is copied: later changes of it do not change this model.  Its gravity, independent
        coordinates and settings of simulations are not used.

        Parameters
        ----------
        component : Model or path
            A model, or the name of a model file.
        prefix : str, optional
            Put before every name of the component; ``leg1_`` makes ``leg1_hip`` of ``hip``; ``leg1.hip`` means it too.
        at : marker, or mapping of names to markers, optional
            For each :meth:`attachment` the marker of this model in its place.  One marker alone stands for the only
            attachment; where there is none, for the component's ground.
        parameters, inputs, **values
            Values of its parameters and inputs.  A number makes it a parameter of this model with that value, so does
            none; an expression of this model's parameters takes its place.  A number is in the component's unit, or in
            that of a mapping: ``l={"value": 500, "unit": "mm"}``.

        Returns
        -------
        InstanceHandle

        Raises
        ------
        UsageError
            The component has no such parameter, input or attachment, or one is missing.
        ModelError
            The file of the component has faults.
        """

        from .components import Instance, add_instance, attempt, named_attachments

        part = _component(component)
        if prefix and fault_of_name(prefix):
            raise UsageError(
                f"prefix={prefix!r} cannot begin a name; use letters, digits and underscores", code="EG-NAME-FORM"
            )
        groups = {"parameters": parameters or {}, "inputs": inputs or {}, "": values}
        for what, group in groups.items():
            if not isinstance(group, Mapping):
                raise ill_typed(f"add {part.name}: {what} must be a mapping of names to values, not {group!r}")
        raw = [name for group in groups.values() for name in group]
        if twice := sorted({name for name in raw if raw.count(name) > 1}):
            raise at_odds(f"add {part.name}: {', '.join(twice)} given twice; give each value once")
        name = prefix.rstrip("_") or part.name
        path = f"add.{name}"
        numbers = {n: (plain(x), f"{path}.{n}") for group in groups.values() for n, x in group.items() if x is not None}
        self._note_line(path)
        faults = Faults(Description(lines=self._description.lines))

        def add() -> None:
            instance = Instance(name, prefix, named_attachments(part, self._references(at), "at"), numbers)
            add_instance(self._description, part, instance, path, faults, whole=True)

        attempt(faults.add, add)
        if faults:
            messages = "; ".join(f"{p.message}{f' ({p.remedy})' if p.remedy else ''}" for p in faults.problems)
            raise UsageError(f"add {part.name}: {messages}", code=faults.problems[0].code)
        return InstanceHandle(self, name, prefix)

    def _references(self, at: Any) -> Any:
        if isinstance(at, Mapping) and "body" not in at:
            return {name: plain(References(self).marker(marker)) for name, marker in at.items()}
        return None if at is None else plain(References(self).marker(at))

    # -- sums over the mechanism --------------------------------------------------------------------------------------
    total_energy = _symbol("total_energy", "Kinetic and potential energy together (J).")
    total_mass = _symbol("total_mass", "Mass of all bodies (kg).")

    @property
    def center_of_mass(self) -> MarkerHandle:
        """The centre of mass of all bodies: its ``.position``, ``.velocity`` and ``.acceleration`` in ground axes."""
        return MarkerHandle(self, COM)

    @property
    def momentum(self) -> Triple:
        """Linear momentum of all bodies in ground axes (kg m/s)."""
        return symbol("momentum_x"), symbol("momentum_y"), symbol("momentum_z")

    def angular_momentum(self, about: Any = COM) -> Triple:
        """Angular momentum of all bodies in ground axes (kg m^2/s).

        Parameters
        ----------
        about : body, marker or their name, optional
            The point; the centre of mass of all bodies unless given.  ``m.ground`` is the origin of ground.  A moving
            point counts where it is, and velocities are those relative to ground.
        """
        label = self._label(about)
        x, y, z = (symbol(f"angular_momentum_{axis}({label})") for axis in "xyz")
        return x, y, z

    def inertia_about(self, about: Any = COM) -> tuple[Triple, Triple, Triple]:
        """Inertia of all bodies in ground axes (kg m^2), rows of a symmetric tensor.

        Parameters
        ----------
        about : body, marker or their name, optional
            The point; the centre of mass of all bodies unless given.
        """
        label = self._label(about)
        xx, yy, zz, xy, xz, yz = (symbol(f"inertia_{e}({label})") for e in ("xx", "yy", "zz", "xy", "xz", "yz"))
        return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)

    @staticmethod
    def _label(about: Any) -> str:
        if isinstance(about, MarkerHandle):
            about.note()
            return about.label
        return str(about)

    # -- settings -------------------------------------------------------------------------------------------------
    gravity = _setting(
        "gravity",
        (0, 0, 0),
        "Acceleration of gravity in ground axes (m/s^2), three values; assign others to change it.",
    )
    initial = _settings(
        "initial",
        'Initial values by coordinate or ``<coordinate>_dot``: ``m.initial(theta=0.3)``, ``m.initial["theta"]``.',
    )
    guess = _settings("guess", "Rough values of coordinates from which the loops are closed: ``m.guess(phi=1.2)``.")
    simulation = _settings("simulation", "Defaults of a simulation: ``m.simulation(end=5, rtol=1e-9)``.")

    @property
    def independent(self) -> Any:
        """Independent coordinates of a mechanism with loops: ``m.independent("theta")``, or assign a list."""
        return self._description.values["independent"]

    @independent.setter
    def independent(self, names: Sequence[Any]) -> None:
        self._description.values["independent"] = Names(names_of("independent", names, "a coordinate"))

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
        return yaml_text(self._description)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model to a model file; if writing fails, a file that already exists stays unchanged."""
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
        known = [n for n in (*dir(type(self)), *chain(*ELEMENTS.values())) if not n.startswith("_")]
        return hint(name, known) or "; ".join(f"{section}: {', '.join(types)}" for section, types in ELEMENTS.items())

    def _counts(self) -> str:
        counts = ((section, len(self._description.sections[section])) for section in SECTIONS)
        return ", ".join(f"{number} {_SINGULAR[s] if number == 1 else s}" for s, number in counts if number)

    def __repr__(self) -> str:
        kinds = {"lagrangian": "Lagrangian", "equations": "given equations"}
        kind = "".join(word for key, word in kinds.items() if self._description.values.get(key) is not None)
        return f"<Model {self.name}: {', '.join(part for part in (kind, self._counts()) if part) or 'empty'}>"

    def _repr_html_(self) -> str:
        return model_html(self._description)


_SINGULAR = {section: {"bodies": "body"}.get(section, section[:-1]) for section in SECTIONS}


def _component(raw: Any) -> Any:
    """A component of a Model, or of the file of one."""
    from .components import component_of

    faults = Faults(Description())
    if isinstance(raw, str | os.PathLike):
        description = describe_yaml_file(raw)
    elif isinstance(raw, Described):
        description = plain_description(raw.description)
    else:
        raise ill_typed(f"{raw!r} is not a component; give a Model, or the name of a model file")
    name = str(description.values.get("name", "component"))
    part = component_of(description, name, f"components.{name}.", faults, "")
    for problem in (*description.problems, *faults.problems):
        raise UsageError(f"add {name}: {problem}", code=problem.code)
    return part
