"""Stage explain, sections: the mechanism, its bodies, its coordinates."""

from __future__ import annotations

import re
from typing import Any

import sympy

from ..base.inline_pictures import trimmed_png
from ..describe.mechanism import JointSpec
from ..describe.placement import axis_word
from ..errors import EomgenError
from ..frames import GROUND
from ..graph.core import Expr
from .author import Author
from .document import DrawnPicture, Folded, FormulaLine, Piece, Section, Sentence, Table

_AXIS = re.compile(r"\{([xyz])\}")  #: stands in sentences and formulas of joints for an axis of the joint
_UNIT = re.compile(r"\\mathbf\{e\}_\{(\\mathbf\{n\}_[xyz])\}")  #: e along an axis n, which is n itself
MANY = 8  #: bodies from which their masses are folded


def mechanism(author: Author, module: Any | None) -> Section:
    """DrawnPicture, topology, joints and loops."""
    m = author.mechanism
    pieces: list[Piece] = []
    if m.doc:
        pieces.append(Sentence(_plain(m.doc)))
    if m.bare:
        kind = "a Lagrangian" if m.lagrangian is not None else "equations of motion"
        pieces.append(Sentence(f"The model is {kind}, so there are no bodies to draw."))
        return Section("Mechanism", tuple(pieces))
    pieces.append(_picture(module))
    report = author.source.report
    cut = report.loop_joints
    loops = f"; joint{'s' * (len(cut) > 1)} {_names(cut)} close{'s a loop' if len(cut) == 1 else ' loops'}"
    pieces.append(
        Sentence(
            f"The mechanism has {_count(len(m.bodies), 'body', 'bodies')} beside ground ({_names(report.bodies)}) and "
            f"{_count(len(m.joints), 'joint')}{loops if cut else ', which form an open tree'}."
        )
    )
    rows = tuple(
        (f"`{s.name}`", s.joint.type_name, f"`{s.predecessor.label}`", f"`{s.successor.label}`", _axis(s), allowed)
        for s, allowed in ((spec, str(spec.joint.allows)) for spec in m.joints)
    )
    pieces.append(Table(("joint", "type", "from (P)", "to (S)", "axis", "degrees of freedom"), rows))
    pieces += [Sentence(text) for text in dict.fromkeys(map(_joint, m.joints))]
    return Section("Mechanism", tuple(pieces))


def _joint(spec: JointSpec) -> str:
    """What a joint does, about and along its own axes as P has them."""
    words = dict(zip("xyz", map(axis_word, spec.axes), strict=True))
    names = {letter: word if word.strip("-") in words else rf"\mathbf{{n}}_{letter}" for letter, word in words.items()}
    told = {x: word if names[x] == word else f"${names[x]}$ = {word}" for x, word in words.items()}
    sentence = _AXIS.sub(lambda found: told[found[1]], spec.joint.sentence)
    formula = _AXIS.sub(lambda found: f"{{{names[found[1]]}}}", spec.joint.formula)
    formula = _UNIT.sub(r"\1", formula)
    return f"A {spec.joint.type_name} joint: {sentence} ${formula}$"


def _axis(spec: JointSpec) -> str:
    """The axis of a joint in the axes of P, two of a cross."""
    x, y, z = map(axis_word, spec.axes)
    return f"{x}, {y}" if spec.joint.has_axes else z if spec.joint.has_axis else ""


def _picture(module: Any | None) -> Piece:
    if module is None:
        return Sentence("No picture: it needs the values of all parameters.")
    try:
        from ..show.draw import small_figure

        figure = small_figure(module)
    except EomgenError as error:
        return Sentence(f"No picture: {_plain(str(error).partition(chr(10))[0])}.")
    data, width = trimmed_png(figure)
    return DrawnPicture(data, round(1.25 * width), "the mechanism in its initial position")


def bodies(author: Author) -> Section | None:
    """Masses, centres of mass and inertias, and the parameters."""
    m = author.mechanism
    pieces: list[Piece] = []
    if m.bodies:
        pieces.append(
            Sentence(
                "For each body: mass $m$ (kg), centre of mass $\\mathbf{c}$ (m) from the body's origin, and inertia "
                "$\\mathbf{J}$ (kg m²) about the centre of mass, both in the body's axes."
            )
        )
        formulas: list[Piece] = []
        for body in m.bodies:
            properties = [body.mass, *body.com, *(x for row in body.inertia for x in row)]
            mass, *rest = map(_as_given, author.write("masses and inertias", properties).expressions)
            formulas.append(FormulaLine((author.of("m", body.name), mass)))
            if any(x != 0 for x in rest[:3]):
                formulas.append(FormulaLine((author.of(r"\mathbf{c}", body.name), sympy.Matrix(3, 1, rest[:3]))))
            if any(x != 0 for x in rest[3:]):
                formulas.append(FormulaLine((author.of(r"\mathbf{J}", body.name), sympy.Matrix(3, 3, rest[3:]))))
        if len(m.bodies) > MANY or not author.full:
            pieces.append(Folded(f"Masses and inertias of {_count(len(m.bodies), 'body', 'bodies')}", tuple(formulas)))
        else:
            pieces += formulas
    given = [(p, "parameter") for p in m.parameters] + [(u, "input") for u in m.inputs]
    if given:
        rows = tuple(
            (
                f"${author.symbol(p.name)}$",
                f"`{p.name}`",
                _value(author.put_in.get(p.name, p.value)),
                _plain(p.unit),
                (_plain(p.doc) or kind) + (", value put in" if p.name in author.put_in else ""),
            )
            for p, kind in given
        )
        pieces.append(Table(("symbol", "name", "value", "unit", "meaning"), rows))
    return Section("Bodies and parameters" if m.bodies else "Parameters", tuple(pieces)) if pieces else None


def _as_given(value: Any) -> Any:
    """A number alone as the decimal that a model file has, 0.4 and not 2/5; all else as it is."""
    ends = value.is_Rational and not value.is_Integer and 10**6 % value.q == 0
    return sympy.Float(float(value)) if ends else value


def _value(value: float | None) -> str:
    return "none" if value is None else f"{value:.6g}"


def coordinates(author: Author) -> Section:
    """Each coordinate: what it measures, and whether it is independent."""
    eqs, m = author.equations, author.mechanism
    free = set(eqs.independent)
    tree, loop = set(eqs.kinematics.names), set(eqs.kinematics.loop_coordinates.names)
    rows: list[tuple[str, ...]] = []
    for spec in m.joints:
        for name, coordinate in zip(spec.coordinates, spec.joint.coordinates, strict=True):
            start, end = (_place(m, marker) for marker in (spec.predecessor, spec.successor))
            kind = {"angle": "angle (rad)", "length": "displacement (m)", "parameter": "Euler parameter"}[
                coordinate.kind
            ]
            role = "independent" if name in free else "dependent" if name in tree else "at a joint that closes a loop"
            rows.append(
                (f"${author.symbol(name)}$", f"`{name}`", role, f"{kind} of {end} against {start}, joint `{spec.name}`")
            )
    known = {row[1] for row in rows}
    for name in (*eqs.kinematics.names, *(n for n in eqs.independent if n not in tree)):
        if f"`{name}`" not in known:
            role = "independent" if name in free else "dependent"
            rows.append((f"${author.symbol(name)}$", f"`{name}`", role, "coordinate of the model"))
    pieces: list[Piece] = [
        Sentence(
            f"The tree has {_count(len(tree), 'coordinate')}"
            + (f", and joints that close loops have {_count(len(loop), 'further one')}" if loop else "")
            + f". The equations of motion are for {_count(len(free), 'independent one')}"
            + (f": {', '.join(f'${author.symbol(n)}$' for n in eqs.independent)}." if free else ".")
        ),
        Table(("symbol", "name", "role", "what it measures"), tuple(rows)),
    ]
    return Section("Coordinates", tuple(pieces))


def _place(m: Any, marker: Any) -> str:
    return "ground" if marker.body == GROUND and not marker.label else f"`{marker.label}`"


def _count(number: int, one: str, many: str = "") -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _names(names: Any) -> str:
    listed = [f"`{name}`" for name in names]
    return ", ".join(listed[:30]) + (f" and {len(listed) - 30} more" if len(listed) > 30 else "")


def _plain(text: str) -> str:
    """Text of a user, without the signs that mark names and formulas."""
    return text.replace("$", "").replace("`", "'")


def expressions_of(element: Any) -> list[tuple[str, Expr]]:
    """Fields of an element that are expressions, with their names."""
    return [(name, x) for name, x in vars(element).items() if isinstance(x, Expr)]
