"""What Model's methods give back -> references by name, and SymPy symbols on demand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..base import texts
from ..elements.joints import JOINTS
from ..elements.kinds import Fields
from ..errors import at_odds, calling_line, ill_placed, ill_typed, no_choice
from ..expr.records import Record
from ..expr.texts import printed
from .build_elements import coordinate_names, sketch
from .description import GROUND_NAME, DescribedEntry, Description, as_written, is_zero, items, label_of
from .mechanism import velocity_names
from .names import RATES
from .quantities import MULTIPLIER, REACTION, WRENCH, Named
from .sympy_face import names_of, require_name, symbol

Triple = tuple[Any, Any, Any]


class Described:
    """A mechanism under description."""

    _description: Description

    @property
    def description(self) -> Description:
        """The description of the model, with the same structure as a model file."""
        return self._description

    def _add(
        self, section: str, name: str, values: dict[str, Any], keys: Fields | None = None, home: str = ""
    ) -> DescribedEntry:
        """Append an entry to a section, with the file and line of the call; see :meth:`Description.add`."""

        def twice(path: str) -> None:
            raise at_odds(f"{path} is given in a law and beside it; give it once")

        entry = self._description.add(section, require_name(section, name), values, keys, home, twice)
        self._note_line(as_written(entry.path, self._description.written_paths))
        return entry

    def _note_line(self, *paths: str) -> None:
        """Note the file and line of the user's call for what was said there."""
        self._description.lines.update(dict.fromkeys(paths, calling_line()))

    @property
    def name(self) -> Any:
        """Name of the model."""
        return printed(self._description.values.get("name", ""))


class Wrench(NamedTuple):
    """Force and moment of an element, as SymPy symbols.

    Of a joint they are what its predecessor exerts on its successor, at the successor's marker; of a force element what
    it exerts on the body of the marker ``on``, about that marker's origin. ``axes`` is the label of the marker along
    whose axes the components are, empty for ground.
    """

    function: str
    element: str
    axes: str = ""
    on: str = ""

    @property
    def force(self) -> Triple:
        """Components of the force (N)."""
        return (self._part("x"), self._part("y"), self._part("z"))

    @property
    def moment(self) -> Triple:
        """Components of the moment (N m)."""
        return (self._part("mx"), self._part("my"), self._part("mz"))

    @property
    def size(self) -> Any:
        """Size of the force (N)."""
        return self._replace(axes="")._part("size")

    def _part(self, part: str) -> Any:
        return symbol(str(Named(self.function, self.element, "", self.axes, self.on, part)))


class JointReaction(Wrench):
    """What the predecessor of a joint exerts on the successor, at the successor's marker, as SymPy symbols."""

    __slots__ = ()

    @property
    def normal(self) -> Any:
        """Size of the force across the axis of the joint (N)."""
        return self._replace(axes="")._part("normal")


def noted(marker: MarkerHandle) -> str:
    """The label of a marker whose motion an expression uses; UsageError if it is none."""
    if not hasattr(marker, "note"):
        raise ill_typed(f"give a body or a marker, such as m.ground or rod.at(1, 0, 0), not {texts.quote(marker)}")
    marker.note()
    return marker.label


class ElementHandle:
    """A joint, force element or constraint of the model.

    Attributes
    ----------
    model : Model
        The model it belongs to.
    name : str
        Its name.
    """

    def __init__(self, model: Described, entry: DescribedEntry) -> None:
        self.model, self.name, self._entry = model, entry.name, entry

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}: {self._entry.values.get('type')}>"


def _of_element(word: str, doc: str) -> Any:
    """A property that is the symbol of a quantity of an element."""
    return property(lambda element: symbol(str(Named(word, element.name))), doc=doc)


class ForceHandle(ElementHandle):
    """A force element of the model; what it does can stand in outputs, events and other laws."""

    force = _of_element(
        "force", "Force along its path (N or N m), positive where it increases it; of a contact the normal force."
    )
    length = _of_element("length", "Length or angle of its path (m or rad), or penetration of a contact (m).")
    rate = _of_element("rate", "Rate of :attr:`length` (m/s or rad/s).")
    power = _of_element("power", "Power of everything that it exerts (W): positive where it drives the mechanism.")

    def on(self, marker: MarkerHandle, axes: MarkerHandle | None = None) -> Wrench:
        """Force and moment that it exerts on the body of a marker, in ground axes or along those of another marker.

        Parameters
        ----------
        marker : BodyHandle or MarkerHandle
            On whose body it acts; moments are about its origin.
        axes : BodyHandle or MarkerHandle, optional
            Along whose axes the components are; ground unless given.
        """
        return Wrench(WRENCH, self.name, "" if axes is None else noted(axes), noted(marker))


class ConstraintHandle(ElementHandle):
    """A constraint element of the model; its multipliers can stand in outputs, events and laws."""

    def multiplier(self, row: str = "") -> Any:
        """The Lagrange multiplier of an equation, as a SymPy symbol.

        Parameters
        ----------
        row : str, optional
            Which equation, such as ``height`` of a rolling wheel; not needed where there is one.
        """
        return symbol(str(Named(MULTIPLIER, f"{self.name}.{row}" if row else self.name)))


def _vector(prefix: str, suffix: str, doc: str) -> Any:
    """A property that is three symbols, of the quantities along x, y and z."""

    def read(motion: Motion) -> Triple:
        ends = motion._ends()
        x, y, z = (symbol(str(Named(f"{prefix}{axis}{suffix}", *ends))) for axis in "xyz")
        return (x, y, z)

    return property(read, doc=doc)


class Motion:
    """The motion of a marker in ground axes, or in others, as SymPy symbols for outputs, events and force laws."""

    def _ends(self) -> tuple[str, ...]:
        """Labels of the marker, of the one it is seen from, and of the one whose axes count."""
        raise NotImplementedError

    position = _vector("", "", "Position of the origin (m).")
    velocity = _vector("v", "", "Velocity of the origin (m/s).")
    acceleration = _vector("a", "", "Acceleration of the origin (m/s^2), for outputs.")
    angular_velocity = _vector("w", "", "Angular velocity of the body (rad/s).")
    angular_acceleration = _vector("w", "_dot", "Angular acceleration of the body (rad/s^2), for outputs.")


class SeenMotion(Record, Motion):
    """The motion of a marker as seen from another, in the axes of a third, as SymPy symbols (SI units).

    ``origin`` and ``axes`` are labels of markers, empty for ground.
    """

    marker: str
    origin: str = ""
    axes: str = ""

    def _ends(self) -> tuple[str, ...]:
        return (self.marker, self.origin, self.axes)


class MarkerHandle(Motion):
    """A frame fixed in a body; joints and forces attach to it, outputs read its motion.

    Attributes
    ----------
    model : Model
        The model it belongs to.
    reference : str or dict
        How the model file would refer to it: ``rod.tip`` or a mapping of body, at, rpy.
    label : str
        How messages and symbols call it, e.g. ``rod.tip`` or ``crank.at(r, 0, 0)``.
    """

    def __init__(self, model: Described, reference: Any) -> None:
        self.model, self.reference = model, reference
        self.label: str = reference if isinstance(reference, str) else label_of(reference)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.label}>"

    body_angular_velocity = _vector(
        "w", "_body", "Angular velocity in its own axes (rad/s), as SymPy symbols for outputs, events and force laws."
    )
    body_angular_acceleration = _vector(
        "w", "_body_dot", "Angular acceleration of the body in its own axes (rad/s^2), as SymPy symbols for outputs."
    )

    @property
    def angle(self) -> Any:
        """Turn of the marker about the z axis of ground (rad), as a SymPy symbol."""
        return self._symbol(Named("angle", self.label))

    def seen(self, origin: MarkerHandle | None = None, axes: MarkerHandle | None = None) -> SeenMotion:
        """The motion of this marker as seen from another marker, in the axes of a third.

        Parameters
        ----------
        origin : marker, optional
            Marker whose position, velocity or angular velocity is subtracted; ground unless given.  The rates are
            those of vectors as seen from ground, whatever the axes.
        axes : marker, optional
            Marker in whose axes the components are; those of ground unless given.

        Returns
        -------
        SeenMotion
        """
        ends = ["" if end is None else noted(end) for end in (origin, axes)]
        return SeenMotion(noted(self), *ends)

    def distance(self, other: MarkerHandle) -> Any:
        """Distance from the origin of another marker (m), as a SymPy symbol."""
        return self._symbol(Named("distance", self.label, noted(other)))

    def distance_rate(self, other: MarkerHandle) -> Any:
        """Rate of the distance from the origin of another marker (m/s), as a SymPy symbol."""
        return self._symbol(Named("distance_rate", self.label, noted(other)))

    def angle_from(self, other: MarkerHandle) -> Any:
        """Turn of this marker about the z axis of another (rad), as a SymPy symbol."""
        return self._symbol(Named("angle", self.label, noted(other)))

    def note(self) -> None:
        """Store an unnamed marker in the description, because an expression uses its motion."""
        if not isinstance(self.reference, str):
            self.model.description.motions[self.label] = self.reference

    def _symbol(self, quantity: Named) -> Any:
        self.note()
        return symbol(str(quantity))

    def _ends(self) -> tuple[str, ...]:
        return (noted(self),)


class BodyHandle(MarkerHandle):
    """A body or the ground; where a marker is expected, it stands for the frame at its origin."""

    def __init__(self, model: Described, name: str, entry: DescribedEntry | None) -> None:
        super().__init__(model, name)
        self.name = name
        self._entry = entry

    def at(
        self,
        x: Any = 0,
        y: Any = 0,
        z: Any = 0,
        *,
        rpy: Sequence[Any] = (0, 0, 0),
        axes: Mapping[str, Any] | None = None,
        matrix: Any = None,
    ) -> MarkerHandle:
        """Make an unnamed marker.

        Parameters
        ----------
        x, y, z : number, str or SymPy expression
            Position in body axes (m).
        rpy : sequence of three, optional
            Fixed-axis roll, pitch, yaw (rad).
        axes : mapping, optional
            Two of its axes in body axes, instead of ``rpy``: ``{"x": (1, 1, 0), "z": "z"}``.
        matrix : (3, 3) array, optional
            Its axes as columns in body axes, instead of ``rpy``; numbers, texts or SymPy expressions.

        Returns
        -------
        MarkerHandle
        """
        return MarkerHandle(self.model, {"body": self.name, **_placed((x, y, z), rpy, axes, matrix)})

    def marker(
        self,
        name: str,
        at: Sequence[Any] = (0, 0, 0),
        rpy: Sequence[Any] = (0, 0, 0),
        *,
        axes: Mapping[str, Any] | None = None,
        matrix: Any = None,
    ) -> MarkerHandle:
        """Add a named marker; everywhere its name is ``body.name``.

        Parameters
        ----------
        name : str
            Identifier, unique in the body.
        at : sequence of three
            Position in body axes (m).
        rpy : sequence of three, optional
            Fixed-axis roll, pitch, yaw (rad).
        axes, matrix : optional
            As for :meth:`at`, instead of ``rpy``.

        Returns
        -------
        MarkerHandle
        """
        if self._entry is None:
            self._entry = self.model._add("bodies", GROUND_NAME, {})
        placed = _placed(at, rpy, axes, matrix)
        self.model._note_line(f"{self._entry.path}.markers.{name}")
        markers = self._entry.values.get("markers", [])
        listed = list(markers.items()) if isinstance(markers, dict) else list(markers)
        self._entry.values["markers"] = [*listed, (name, placed)]
        return MarkerHandle(self.model, f"{self.name}.{name}")


def _placed(at: Any, rpy: Any, axes: Mapping[str, Any] | None, matrix: Any) -> dict[str, Any]:
    """A place in a body."""
    listed = items(rpy)
    turn = {} if is_zero(rpy) else {"rpy": rpy if listed is None else tuple(listed)}
    return {"at": at, **turn, **_turned(axes, matrix)}


def _turned(axes: Mapping[str, Any] | None, matrix: Any) -> dict[str, Any]:
    """Keys of a place for axes and matrix, those that are given."""
    rows = None if matrix is None else items(matrix)
    plain = matrix if rows is None else [items(row) or row for row in rows]
    return {key: value for key, value in (("axes", axes), ("matrix", plain)) if value is not None}


def _derivative(order: int, doc: str) -> Any:
    """A property that is the symbol of the coordinate of a joint of one degree, or of a rate of it."""

    def read(joint: JointHandle) -> Any:
        names = joint.coordinate_names
        if len(names) != 1:
            listed = ", ".join(names) or "none"
            raise ill_placed(f"joint {joint.name!r} has {len(names)} coordinates ({listed}); use .coordinates")
        return symbol(names[0] + RATES[order])

    return property(read, doc=doc)


class JointHandle(ElementHandle):
    """A joint of the model; its coordinates are SymPy symbols that forces and outputs can use."""

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the coordinates, in order."""
        type_name = self._entry.values.get("type")
        if type_name not in JOINTS:
            raise no_choice(f"joints.{self.name}.type: no joint of type {type_name!r}; types: {', '.join(JOINTS)}")
        return coordinate_names(type_name, self.name, self._entry.values)[0]

    @property
    def coordinates(self) -> tuple[Any, ...]:
        """All coordinates as SymPy symbols."""
        return tuple(symbol(name) for name in self.coordinate_names)

    @property
    def velocities(self) -> tuple[Any, ...]:
        """All generalized velocities as SymPy symbols: rates of coordinates, or components of an angular velocity."""
        names = self.coordinate_names
        joint = sketch(str(self._entry.values.get("type")), self._entry.values)
        return tuple(symbol(name) for name in velocity_names(joint, self.name, names))

    coordinate = _derivative(0, "The coordinate of a joint of one degree, as a SymPy symbol.")
    velocity = _derivative(1, "The rate of the coordinate of a joint of one degree, as a SymPy symbol.")
    acceleration = _derivative(
        2, "The second derivative of the coordinate of a joint of one degree, as a SymPy symbol (for outputs)."
    )

    @property
    def reaction(self) -> JointReaction:
        """What the joint carries, in ground axes; as ``reactions`` of a module gives it."""
        return JointReaction(REACTION, self.name)

    def reaction_in(self, axes: MarkerHandle) -> JointReaction:
        """What the joint carries, along the axes of a marker."""
        return JointReaction(REACTION, self.name, noted(axes))


class Settings(dict[str, Any]):
    """A mapping that is also called to add to it: ``model.initial(theta=0.3)``, ``initial({"arm.theta": 0.3})``."""

    def __call__(self, *mappings: Any, **values: Any) -> None:
        """Set the given entries, those of mappings first, and keep the others."""
        for raw in mappings:
            if not isinstance(raw, Mapping):
                message = (
                    f"values are given by name, as in initial(theta=0.3) or a mapping, not as {printed(raw)} alone"
                )
                raise ill_typed(message)
        named = [str(name) for raw in (*mappings, values) for name in raw]
        if twice := sorted({name for name in named if named.count(name) > 1}):
            raise at_odds(f"{', '.join(twice)}: given twice in one call; give each name once")
        for raw in mappings:
            self.update(raw)
        self.update(values)


class Names(list[Any]):
    """A list of names that can also be called to replace it: ``model.independent("theta")``."""

    def __call__(self, *names: Any) -> None:
        """Replace the list by the given names, or by one list of names."""
        self[:] = names_of("independent", names[0] if len(names) == 1 else names, "a coordinate")


class InstanceHandle:
    """A component that was added to a model; names are those of the component.

    Attributes
    ----------
    name : str
        Of the instance, as in ``leg1.hip``.
    prefix : str
        What stands before its names in the model: ``leg1_``.
    """

    def __init__(self, model: Described, name: str, prefix: str) -> None:
        self.model, self.name, self.prefix = model, name, prefix

    def __repr__(self) -> str:
        return f"<InstanceHandle {self.name}>"

    @property
    def bodies(self) -> dict[str, BodyHandle]:
        """Handles of its bodies, by their names in the component."""
        return {name: BodyHandle(self.model, entry.name, entry) for name, entry in self._entries("bodies").items()}

    @property
    def joints(self) -> dict[str, JointHandle]:
        """Handles of its joints, by their names in the component."""
        return {name: JointHandle(self.model, entry) for name, entry in self._entries("joints").items()}

    def symbol(self, name: str) -> Any:
        """The SymPy symbol of a parameter, input or coordinate of the component, or of a rate."""
        return symbol(self.prefix + require_name("symbol", name))

    def marker(self, label: str) -> MarkerHandle:
        """A named marker of one of its bodies: ``foot.tip``."""
        return MarkerHandle(self.model, self.prefix + require_name("marker", label))

    def _entries(self, section: str) -> dict[str, Any]:
        made = self.model.description.origins
        return {
            entry.name.removeprefix(self.prefix): entry
            for entry in self.model.description.sections[section]
            if (origin := made.get(f"{section}.{entry.name}")) is not None
            and origin.instance.partition(".")[0] == self.name
        }


class References(NamedTuple):
    """How a model file refers to what calls of a model are given."""

    model: Described

    def marker(self, value: Any) -> Any:
        """A marker, body or name as a model file refers to it; raises UsageError for a handle of another model."""
        if isinstance(value, JointHandle):
            raise ill_placed(f"{value.name} is a joint; a body or a marker is expected")
        return self._of_this_model(value).reference if isinstance(value, MarkerHandle) else value

    def joint(self, value: Any) -> Any:
        """A joint, coordinate or name as a model file refers to it; raises UsageError for a handle of another model."""
        if isinstance(value, MarkerHandle):
            raise ill_placed(f"{value.label} is a body or marker; a joint or a coordinate is expected")
        return self._of_this_model(value).name if isinstance(value, JointHandle) else value

    def markers(self, raw: Any) -> Any:
        """Markers by name, their axes as a model file writes them; what is no mapping is left as it is."""
        if not isinstance(raw, Mapping):
            return raw
        turned = {n: _turned(x.get("axes"), x.get("matrix")) for n, x in raw.items() if isinstance(x, Mapping)}
        return {name: {**x, **turned[name]} if name in turned else x for name, x in raw.items()}

    def _of_this_model(self, handle: Any) -> Any:
        if handle.model is self.model:
            return handle
        name = handle.label if isinstance(handle, MarkerHandle) else handle.name
        other = f"the model {handle.model.name!r}, not to {self.model.name!r}"
        if handle.model.name == self.model.name:
            other = f"another model that is called {self.model.name!r} too"
        raise ill_placed(f"{name} belongs to {other}; use a handle of this model")
