"""What docs/operations.md states of eomgen, counted again: nothing takes more operations than the page says."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.program import BY_SYSTEM
from eomgen.expr.core import substitute
from eomgen.expr.schedule import count
from eomgen.mechanics import analyse
from eomgen.mechanics.methods import METHODS
from eomgen.mechanics.methods.reduction import reduce_to_independent

from .large_loops import closed_chain, four_bars
from .loop_robots import ROBOTS as LOOP_ROBOTS
from .models import humanoid, numeric_arm, symbolic_arm
from .operation_counts import of_eomgen
from .report import Limit, Report, Table
from .robot_calls import ROBOTS, build
from .robot_loops import taken

TITLE = "operations that the documentation states"
PAGE = Path(__file__).parents[1] / "docs" / "operations.md"
ARMS = {"PUMA 560": "puma560", "Stanford arm": "stanford", "RX-90": "rx90", "Panda": "panda", "iiwa": "iiwa"}
#: Rows of the page -> models of loop_robots.
LOOPS = {
    "ankle with two rods | 12, 6": "ankle with two rods",
    "two legs with such ankles | 24, 12": "two legs with such ankles",
    "hand of three parallel fingers | 9, 6": "hand of three parallel fingers",
    "delta robot, six rods | 21, 18": "delta robot",
    "Stewart platform | 24, 18": "Stewart platform",
}
#: The beginning of a row, and the first numbers in its other cells.
Rows = Iterator[tuple[str, tuple[int, ...]]]


def inverse_dynamics(quick: bool) -> Rows:
    """Multiplications and additions, work that depends on parameters only included."""
    for row, name in ARMS.items():
        found = count(METHODS["embedding"](analyse(symbolic_arm(name).mechanism())).inverse_dynamics)
        yield row, (found.multiplications, found.additions)


def forward_dynamics(quick: bool) -> Rows:
    """Of arms whose parameters are numbers."""
    for row, name in (("Panda arm", "panda"), ("UR5 arm", "ur5")):
        choice = numeric_arm(name, driven=True).derive().choice
        assert choice is not None
        yield row, (choice.operations["embedding"],)


def right_hand_sides(quick: bool) -> Rows:
    """Inertias numbers; symbols, and what is done once for each set of them."""
    for robot in ROBOTS[:2] if quick else ROBOTS:
        numbers, symbols = (build(robot, symbolic=symbolic)[1].counts for symbolic in (False, True))
        yield f"{robot.name} (URDF)", (numbers["rhs"].total, symbols["rhs"].total, symbols["precompute"].total)


def equal_terms(quick: bool) -> Rows:
    """Multiplications, additions and divisions, inertia regrouped and not."""
    for robot in ROBOTS[:2] if quick else ROBOTS:
        for word in ("on", "off"):
            yield f"{robot.name} (URDF) | {word}", tuple(of_eomgen(robot, word == "on").values())


def loops(quick: bool) -> Rows:
    """A call with one Newton step; the same by the code for states next to change points."""
    for row, name in list(LOOPS.items())[: 3 if quick else None]:
        with TemporaryDirectory() as folder:
            (file := Path(folder, "robot.xml")).write_text(LOOP_ROBOTS[name]().text())
            counts = pipeline.build(eg.load(file).derive(), "c", ["rhs"]).counts
        yield row, (taken(counts), sum(counts[block].total for block in BY_SYSTEM))


def jacobians(quick: bool) -> Rows:
    """Of loops: of the state, of a column of q and of a column of v."""
    chains = {f"closed chain of {n}": closed_chain(n, True, False) for n in ((20,) if quick else (20, 100))}
    for row, model in (chains | {"20 four-bars": four_bars(20)}).items():
        counts = pipeline.build(model.derive(), "c", ["jacobian"]).counts
        yield row, tuple(counts[b].total for b in ("loop_slopes", "slopes_by_position", "slopes_by_velocity"))


def humanoids(quick: bool) -> Rows:
    """Mass matrix and bias of thirty joints."""
    yield "humanoid", (humanoid().derive("embedding").operations["mass_matrix and bias"].total,)


def bicycle(quick: bool) -> Rows:
    """M and h, and the whole embedded system; every parameter a symbol, and a number."""
    equations = eg.load_example("bicycle").derive("embedding")
    kinematics, tree, graph = equations.kinematics, equations.tree, equations.kinematics.graph
    values = {p.name: p.value for p in kinematics.mechanism.parameters}
    numbers = {graph.symbol(name): graph.constant(value) for name, value in values.items()}
    matrix, force = reduce_to_independent(kinematics, equations.mobility, tree, values | {"t": 0.0})
    for row, rows, rest in (("M and h", tree.mass_matrix, tree.bias), ("complete", matrix, force)):
        outputs = [*(entry for line in rows for entry in line), *rest]
        yield f"bicycle, {row}", (count(outputs).total, count(substitute(outputs, numbers)).total)


#: Headings of the page -> who counts.
SECTIONS: dict[str, Callable[[bool], Rows]] = {
    "Inverse dynamics of robot arms, parameters as symbols": inverse_dynamics,
    "Forward dynamics, parameters as numbers": forward_dynamics,
    "Right-hand sides of robots": right_hand_sides,
    "On equal terms": equal_terms,
    "Robots with closed loops": loops,
    "Derivatives": jacobians,
    "Mass matrix and bias of a humanoid": humanoids,
    "Mass matrix and bias of a bicycle": bicycle,
}


def run(quick: bool) -> Report:
    """Count all, the short ones alone if it is to be quick."""
    text = dict(part.split("\n", 1) for part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:])
    rows, limits = [], []
    for heading, counted in SECTIONS.items():
        for row, found in counted(quick):
            line = text[heading].partition(f"\n| {row} |")[2].partition("\n")[0]
            stated = [int(number.replace(",", "")) for number in re.findall(r"\d[\d,]*", line)]
            for number, bound in zip(found, stated[: len(found)], strict=True):
                limits.append(Limit(f"{heading}: {row}", number, bound))
                rows.append((heading, row, bound, number))
    fewer = [f"the page states more than is needed: {row}: {bound}, now {n}" for _, row, bound, n in rows if n < bound]
    return Report((Table("operations", ("table", "row", "stated", "counted"), rows),), tuple(limits), tuple(fewer))
