"""How many operations derived equations take: exact counts, so a change for the worse fails here.

The limits of the five arms are what SymPyBotics gets for the same arms with every parameter a symbol, those of forward
dynamics what CasADi's cse leaves of composite bodies and L^T D L; Robotran prints 17,414 for a humanoid of 29 joints.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import eomgen as eg
from benchmarks.growth import operations
from benchmarks.large_loops import closed_chain, four_bars
from benchmarks.loop_robots import ROBOTS as LOOP_ROBOTS
from benchmarks.models import ARMS, chain, humanoid, numeric_arm, panda, spatial_chain, symbolic_arm
from benchmarks.operation_counts import base_inertias, of_eomgen
from benchmarks.robot_calls import ROBOTS, Robot, build, load_pinocchio, state
from benchmarks.robot_loops import taken
from eomgen import pipeline
from eomgen.emit import emit_c
from eomgen.equations import METHODS
from eomgen.equations.reduction import reduce_to_independent
from eomgen.graph import evaluate
from eomgen.graph.count import Operations, count
from eomgen.graph.substitute import substitute
from eomgen.kinematics import analyse
from eomgen.kinematics.regroup import regroup
from eomgen.program.block_groups import USUAL

EXAMPLES = Path(__file__).parents[1] / "examples"
LIMITS = {"puma560": (498, 402), "stanford": (326, 285), "rx90": (330, 282), "panda": (415, 354), "iiwa": (403, 342)}
#: What is counted today: multiplications and additions of the inverse dynamics by embedding.
FOUND = {"puma560": (269, 279), "stanford": (230, 237), "rx90": (252, 258), "panda": (327, 340), "iiwa": (308, 319)}
#: Right-hand sides of robots from their URDF files, inertias numbers; what CasADi's cse leaves of the same is more.
ROBOT_LIMITS = {"Panda": 1661, "UR5": 908, "Talos": 8616, "ANYmal": 4284}
ROBOTS_FOUND = {"Panda": 1198, "UR5": 556, "Talos": 6657, "ANYmal": 3397}


@pytest.mark.slow
@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_energies_and_inverse_dynamics_grow_linearly(method: str) -> None:
    single, double = operations(100, method), operations(200, method)
    for part, number in single.items():
        assert number > 100, part
        assert double[part] <= 2.1 * number, part


def test_panda_takes_few_operations() -> None:
    lagrange = panda().derive("lagrange").operations
    embedding = panda().derive("embedding").operations
    assert 0 < lagrange["inverse_dynamics"].total <= 2000
    assert 0 < embedding["mass_matrix"].total <= 400
    assert 0 < embedding["bias"].total <= 600


def inverse_dynamics(name: str) -> Operations:
    """Operations of the inverse dynamics of an arm, work that depends on parameters only included."""
    return count(METHODS["embedding"](analyse(symbolic_arm(name).mechanism())).inverse_dynamics)


@pytest.mark.parametrize("name", ARMS)
def test_arms_with_symbolic_parameters(name: str) -> None:
    found = inverse_dynamics(name)
    assert found.divisions == 0
    for number, known, limit in zip((found.multiplications, found.additions), FOUND[name], LIMITS[name], strict=True):
        assert 0.9 * known <= number <= known <= limit


@pytest.mark.parametrize("name", ARMS)
def test_arms_move_as_an_independent_sum_over_bodies_says(name: str) -> None:
    """Inverse dynamics of arms given by first moments against Lagrange's equations of masses and centres of mass."""
    mechanism = symbolic_arm(name).mechanism()
    kinematics = analyse(mechanism)
    one, other = METHODS["embedding"](kinematics), METHODS["lagrange"](kinematics)
    random = np.random.default_rng(5)
    values = {p.name: float(random.uniform(0.5, 1.5)) for p in mechanism.parameters} | {"t": 0.0}
    values |= {n + s: float(random.uniform(-1, 1)) for n in kinematics.names for s in ("", "_dot", "_ddot")}
    a, b = (np.array(evaluate(list(e.inverse_dynamics), values), dtype=float) for e in (one, other))
    assert np.abs(a - b).max() <= 1e-12 * np.abs(b).max()
    # seven inertial parameters at most are left of a link that turns, and the mass of a link that slides
    left = regroup(mechanism.graph, kinematics.links)
    for link, inertia in zip(kinematics.links, left, strict=True):
        entries = [inertia.mass, *inertia.moment, *(inertia.inertia[i][j] for i in range(3) for j in range(i, 3))]
        assert sum(not x.is_zero for x in entries) <= 7, link.name


@pytest.mark.parametrize(("name", "limit"), [("panda", 1661), ("ur5", 908)])
def test_forward_dynamics_with_numeric_parameters(name: str, limit: int) -> None:
    equations = numeric_arm(name, driven=True).derive()
    assert equations.choice is not None
    assert equations.method == "embedding"
    program = pipeline.build(equations, kernels=["rhs"])
    total = program.counts["rhs"].total + program.counts["precompute"].total
    chosen = equations.choice.operations["embedding"]
    checks = len(equations.kinematics.v) + 1
    assert chosen <= total <= chosen + checks
    assert total <= 0.75 * limit


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_right_hand_sides_of_robots(robot: Robot) -> None:
    """Straight-line code also for Talos's 32 joints; with inertias as symbols what depends on them alone is hoisted."""
    equations, program = build(robot)
    assert equations.method == "embedding"
    assert [block.name for block in program.blocks] == ["rhs"]
    total = program.counts["rhs"].total
    assert 0.9 * ROBOTS_FOUND[robot.name] <= total <= ROBOTS_FOUND[robot.name] <= 0.85 * ROBOT_LIMITS[robot.name]
    assert program.counts["precompute"].total == 0
    _, symbolic = build(robot, symbolic=True)
    assert symbolic.counts["rhs"].total <= total
    assert symbolic.counts["precompute"].total > 50


#: Operations without base parameters, and multiplications, additions, divisions with them (docs/operations.md).
WITHOUT_BASE = {"Panda": 1316, "UR5": 618, "Talos": 7109, "ANYmal": 3677}
SPLIT = {"Panda": (642, 550, 6), "UR5": (308, 243, 5), "Talos": (3539, 3091, 27), "ANYmal": (1760, 1622, 15)}


@pytest.mark.parametrize("robot", ROBOTS[:2], ids=lambda robot: robot.name)
def test_operations_on_equal_terms(robot: Robot) -> None:
    """What the page counts with base parameters and without."""
    on, off = of_eomgen(robot, True), of_eomgen(robot, False)
    assert tuple(on.values()) == SPLIT[robot.name]
    assert sum(off.values()) == WITHOUT_BASE[robot.name]


#: Operations of a call with one Newton step, and of such a call by the code for states next to change points.
LOOPS_FOUND = {
    "ankle with two rods": (2790, 4079),
    "two legs with such ankles": (5580, 8153),
    "hand of three parallel fingers": (792, 1214),
    "delta robot": (8534, 20104),
    "Stewart platform": (9725, 19469),
}


@pytest.mark.parametrize("name", LOOPS_FOUND)
def test_right_hand_sides_of_robots_with_loops(name: str, tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(LOOP_ROBOTS[name]().text())
    counts = pipeline.build(eg.load(tmp_path / "robot.xml").derive(), "c", ["rhs"]).counts
    assert (taken(counts), sum(counts[name].total for name in USUAL)) == LOOPS_FOUND[name]


@pytest.mark.parametrize("name", ["closed chain of 20", "closed chain of 100", "20 four-bars"])
def test_jacobians_of_loops_take_what_the_page_says(name: str) -> None:
    n = int(next(word for word in name.split() if word.isdigit()))
    model = four_bars(n) if "bars" in name else closed_chain(n, True, False)
    counts = pipeline.build(model.derive(), "c", ["jacobian"]).counts
    row = [f"{counts[block].total:,}" for block in ("loop_slopes", "slopes_by_position", "slopes_by_velocity")]
    page = (EXAMPLES.parent / "docs" / "operations.md").read_text(encoding="utf-8")
    assert f"| {name} | {' | '.join(row)} |" in page


@pytest.mark.parametrize("robot", ROBOTS[:3], ids=lambda robot: robot.name)
def test_regrouped_inertia_of_peers_takes_the_same_torques(robot: Robot) -> None:
    """Newton-Euler over Pinocchio's twists, once with its own inertia and once with what the peers are given."""
    pin, model = pytest.importorskip("pinocchio"), load_pinocchio(robot)
    data = model.createData()
    q, v, _ = state(model)
    expected = pin.rnea(model, data, q, v, 0.7 * v)
    base = base_inertias(model)
    assert sum(m == 0.0 for m, _, _ in base) == model.njoints - 1  # hinges alone: what ground carries is gone
    forces = [pin.Force.Zero() for _ in range(model.njoints)]
    found = np.zeros(model.nv)
    for k in reversed(range(1, model.njoints)):
        m, h, J = base[k - 1]
        skew = np.array([[0, -h[2], h[1]], [h[2], 0, -h[0]], [-h[1], h[0], 0]])
        inertia = np.block([[m * np.eye(3), -skew], [skew, J]])
        own = pin.Force(inertia @ data.a_gf[k].vector) + data.v[k].cross(pin.Force(inertia @ data.v[k].vector))
        total = forces[k] + own
        found[model.joints[k].idx_v] = total.angular["XYZ".index(model.joints[k].shortname()[-1])]
        forces[model.parents[k]] = forces[model.parents[k]] + data.liMi[k].act(total)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_hinges_about_parallel_axes_are_resolved_together() -> None:
    """A planar chain of five: 193 operations in the axes of each link, 181 in common ones."""
    assert chain(5).derive("embedding").operations["mass_matrix and bias"].total <= 181


def test_humanoid_of_thirty_joints() -> None:
    equations = humanoid().derive("embedding")
    assert len(equations.kinematics.mechanism.joints) == 30
    assert len(equations.kinematics.v) == 35
    assert equations.operations["mass_matrix and bias"].total <= 7000


def bicycle() -> dict[str, tuple[int, int]]:
    """Of M and h, and of the whole embedded system; with every parameter a symbol and a number."""
    equations = eg.load(EXAMPLES / "bicycle.yaml").derive("embedding")
    kinematics, tree = equations.kinematics, equations.tree
    values = {p.name: p.value for p in kinematics.mechanism.parameters}
    matrix, force = reduce_to_independent(kinematics, equations.mobility, tree, values | {"t": 0.0})
    assert (len(matrix), len(force)) == (3, 3)
    graph = kinematics.graph
    numbers = {graph.symbol(name): graph.constant(value) for name, value in values.items()}
    counted = {}
    for title, rows, rest in (("M and h", tree.mass_matrix, tree.bias), ("complete", matrix, force)):
        outputs = [*(entry for row in rows for entry in row), *rest]
        counted[title] = (count(outputs).total, count(substitute(outputs, numbers)).total)
    assert counted["M and h"][0] == equations.operations["mass_matrix and bias"].total
    return counted


def test_bicycle_takes_fewer_operations_than_1900() -> None:
    for symbols, numbers in bicycle().values():
        assert 400 < numbers < symbols <= 1900


def test_auto_takes_the_fewest_operations() -> None:
    short, long = spatial_chain(4).derive(), spatial_chain(40).derive()
    for equations, method in ((short, "embedding"), (long, "recursive")):
        assert equations.choice is not None
        assert set(equations.choice.operations) == {"embedding", "recursive"}
        assert min(equations.choice.operations, key=equations.choice.operations.__getitem__) == method
        assert equations.method == method
        assert f"{method} chosen" in str(equations)


@pytest.mark.slow
def test_recursive_form_grows_linearly_to_two_hundred_bodies() -> None:
    sizes = {}
    for n in (50, 100, 200):
        equations = spatial_chain(n).derive("auto")
        assert equations.method == "recursive"
        program = pipeline.build(equations, "c")
        kernels = ("rhs", "bias", "inverse_dynamics", "energy", "acceleration_tangent", "mass_times")
        text = sum(part.count("\n") for file, part in emit_c(program).items() if file.endswith(".c"))
        sizes[n] = [*(program.counts[k].total for k in kernels), len(equations.kinematics.graph.nodes), text]
    for short, middle, long in zip(*sizes.values(), strict=True):
        assert short > 1000
        assert middle <= 2.15 * short
        assert long <= 2.15 * middle
    assert sizes[200][0] <= 300 * 200


def test_the_table_in_the_documents_is_what_is_counted() -> None:
    text = (Path(__file__).parents[1] / "docs" / "operations.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| (\w[\w -]*?) \| (\d[\d,]* / \d[\d,]*|\d[\d,]*) \|", text, re.MULTILINE))
    written = {"PUMA 560": "puma560", "Stanford arm": "stanford", "RX-90": "rx90", "Panda": "panda", "iiwa": "iiwa"}
    for title, name in written.items():
        found = inverse_dynamics(name)
        assert rows[title] == f"{found.multiplications} / {found.additions}"
    for title, name in (("Panda arm", "panda"), ("UR5 arm", "ur5")):
        choice = numeric_arm(name, driven=True).derive().choice
        assert choice is not None
        assert rows[title] == f"{choice.operations['embedding']:,}"
    for title, counted in bicycle().items():
        assert f"| bicycle, {title} | {counted[0]:,} | {counted[1]:,} |" in text
    for robot in ROBOTS:
        numeric, symbolic = (build(robot, symbolic=symbols)[1].counts for symbols in (False, True))
        ours = f"{numeric['rhs'].total:,} | {symbolic['rhs'].total:,} | {symbolic['precompute'].total:,}"
        assert f"| {robot.name} (URDF) | {ours} |" in text
    assert rows["humanoid"] == f"{humanoid().derive('embedding').operations['mass_matrix and bias'].total:,}"
