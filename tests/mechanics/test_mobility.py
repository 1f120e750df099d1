"""Mobility: rank, freedoms, redundant rows by name, candidates, contradictions; what is said of them."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import judges
import models
import numpy as np
import pytest
import sympy as sp
from refusals import refused, refuses
from sweeps import TARGETS, part_of

import eomgen as eg
from benchmarks.models.linkages import n_four_bar

# -- Counts ------------------------------------------------------------------------------------------------------------
CRANK_ROCKER = (0.3, 0.9, 0.7, 0.8)


def four_bar(lengths: Sequence[float], rocker: float = 1.2, bend: float = -1.0) -> eg.Model:
    """Uniform rods a (crank), b (coupler), c (rocker) on a ground link d."""
    a, b, c, d = lengths
    m = eg.Model("four_bar", gravity=(0, -9.81, 0))
    rods = [
        m.body(name, mass=size, com=(size / 2, 0, 0), inertia={"zz": size**3 / 12})
        for name, size in (("crank", a), ("coupler", b), ("rocker", c))
    ]
    m.revolute("A", m.ground, rods[0], coordinate="theta")
    m.revolute("B", rods[0].at(a, 0, 0), rods[1], coordinate="bend")
    m.revolute("D", m.ground.at(d, 0, 0), rods[2], coordinate="psi")
    m.revolute("C", rods[1].at(b, 0, 0), rods[2].at(c, 0, 0))
    m.initial(theta=1.0)
    m.guess(psi=rocker, bend=bend)
    return m


@pytest.mark.quick
def test_planar_four_bar_of_spatial_joints_loses_the_rows_that_vanish() -> None:
    report = four_bar((0.04, 0.12, 0.08, 0.10)).derive().report
    assert report.degrees_of_freedom == 1
    assert report.gruebler_kutzbach == -2
    assert report.gruebler_kutzbach_planar == 1
    assert (report.constraints_declared, report.constraints, report.rank) == (5, 2, 2)
    assert report.redundant == []


def test_bad_independent_coordinates_are_refused() -> None:
    refuses("EG-NAME-UNKNOWN independent thet 'theta'?", four_bar(CRANK_ROCKER).derive, independent=["thet"])
    refuses("EG-PARTITION independent 1", four_bar(CRANK_ROCKER).derive, independent=["theta", "psi"])


def test_coordinates_that_cannot_be_independent_together_are_refused() -> None:
    model = four_bar(CRANK_ROCKER)
    for name in "ef":
        model.revolute(name.upper(), model.ground, model.body(name, mass=1, inertia={"zz": 0.3}), coordinate=name)
    refuses("EG-PARTITION independent theta", model.derive, independent=["theta", "bend"])
    refuses("EG-PARTITION independent e", model.derive, independent=["e", "e_dot"])
    model.independent("psi_dot", "f")  # as linearize takes them
    assert model.derive().independent == ("psi", "e", "f")


def test_rank_needs_no_parameter_values() -> None:
    m = eg.Model("slider_crank", gravity=(0, -9.81, 0))
    r, length = m.parameter("r"), m.parameter("l")
    crank, rod, slider = (m.body(n, mass=1, inertia={"zz": 0.1}) for n in ("crank", "rod", "slider"))
    models.join_slider_crank(m, (crank, rod, slider), r, length, "theta - s")
    equations = m.derive()
    assert equations.report.assumed
    assert equations.report.degrees_of_freedom == 1
    assert equations.mass_matrix.shape == (1, 1)
    with refused("EG-MISSING parameters.l") as caught:
        equations.compile()
    assert [p.path for p in caught.value.problems] == ["parameters.r", "parameters.l"]


# -- The report --------------------------------------------------------------------------------------------------------
def test_flat_parallelograms_have_more_freedoms_at_once() -> None:
    m = n_four_bar(3)
    m.initial(**{f"theta{k}": 0 for k in range(4)} | {f"bend{k}": 0 for k in (1, 2, 3)})
    report = m.derive(independent=["theta0"]).report
    assert (report.degrees_of_freedom, report.instantaneous_freedoms) == (1, 4)
    assert any(note.startswith("change point: 4 degrees of freedom") for note in report.notes)
    assert "start a little away from this configuration" in str(report)


def test_a_locked_mechanism_says_what_holds_it() -> None:
    """A four-bar with a further rod across."""
    m = four_bar(CRANK_ROCKER)
    q = m.derive().report.reference
    x = 0.15 * np.cos(q["theta"]), 0.15 * np.sin(q["theta"])
    y = 0.8 + 0.35 * np.cos(q["psi"]), 0.35 * np.sin(q["psi"])
    across = float(np.hypot(y[0] - x[0], y[1] - x[1]))
    m.distance("stay", m.bodies["crank"].at(0.15, 0, 0), m.bodies["rocker"].at(0.35, 0, 0), across)
    report = m.derive().report
    assert report.degrees_of_freedom == 0
    note = next(note for note in report.notes if note.startswith("locked"))
    assert "held by C, stay" in note
    assert "if it should move, remove a constraint, or replace a joint by one with more freedom" in note


def test_contradictory_constraints_are_named_with_their_gap() -> None:
    m = four_bar(CRANK_ROCKER)
    for name, length in (("one", 0.8), ("two", 0.9)):
        m.distance(name, m.bodies["crank"].at(0.15, 0, 0), m.bodies["rocker"].at(0.35, 0, 0), length)
    refuses("EG-LOOP-OPEN one.length two.length", m.derive)


# -- Other independent coordinates -------------------------------------------------------------------------------------


@pytest.mark.parametrize("preferred", part_of(["theta", "bend", "psi"], "psi".__eq__))
def test_a_crank_rocker_turns_whichever_coordinate_is_preferred(preferred: str) -> None:
    """psi turns back twice a turn: a dead centre for it each time."""
    mod = four_bar(CRANK_ROCKER).compile(independent=[preferred], target="numpy")
    x0 = mod.x0(theta=1.0, theta_dot=9.0)
    run = mod.simulate((0, 3), initial=x0, rtol=1e-11, atol=1e-13)
    assert np.ptp(run["theta"]) > 6 * np.pi
    assert np.count_nonzero(np.diff(np.sign(run["psi_dot"]))) >= 6
    assert run.energy_drift <= 1e-8
    assert run.residuals.position <= 1e-13
    for k in np.linspace(0, len(run) - 1, 25).astype(int):
        x = run.x[:, k]
        q, v = x[: mod.n_q], x[mod.n_q :]
        expected = judges.augmented(mod.mass_matrix(q), mod.bias(0.0, x), *judges.loop_terms(mod, q, v))
        assert np.abs(mod.rhs(0.0, x)[mod.n_q :] - expected).max() <= 1e-6 * np.abs(expected).max()
    assert run.change_points == []


# -- Rows that hold whatever the motion --------------------------------------------------------------------------------
def welded(twice: bool = True) -> eg.Model:
    """A pendulum and a plate, held at two places that agree where l1 + l2 = l3."""
    m = eg.Model("welded", gravity=(0, -9.81, 0))
    for length, value in (("l1", 0.1), ("l2", 0.2), ("l3", 0.3)):
        m.parameter(length, value)
    arm = m.body("arm", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
    plate = m.body("plate", mass=0.5, com=(0.1, 0.1, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, arm, coordinate="theta")
    m.weld("W0", arm.at(0.3, 0.1, 0), plate)
    if twice:
        m.weld("W1", arm.at("0.3 + l3", 0.1, 0), plate.at("l1 + l2", 0, 0))
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_it_moves_as_with_one_weld(target: str) -> None:
    one, two = welded(twice=False).compile(target=target), welded().compile(target=target)
    assert two.n_dof == 1
    start = {"theta": 0.3}
    a, b = one.simulate(1.0, initial=start), two.simulate(1.0, initial=start)
    np.testing.assert_allclose(b["theta"][-1], a["theta"][-1], rtol=1e-9)
    x = np.array([0.3, 2.0])
    np.testing.assert_allclose(two.jacobian(0, x), one.jacobian(0, x), atol=1e-12)
    loads = two.reactions(0, x)[:, :3]  # the two welds share what one takes, in the axes of the arm
    np.testing.assert_allclose(loads[1] + loads[2], one.reactions(0, x)[1, :3], atol=1e-10)


@pytest.mark.parametrize("target", TARGETS)
def test_rebound_values_that_open_it_are_refused(target: str) -> None:
    mod = welded().compile(target=target)
    refuses("EG-LOOP-OPEN W1.r_x 0.1", mod.simulate, 0.1, initial={"theta": 0.3}, parameters={"l3": 0.4})
    bound = mod.bind(p={"l3": 0.4})
    for call in (lambda: bound.rhs(0, np.zeros(2)), lambda: bound.project(np.zeros(2))):
        refuses("EG-PROJECTION W1.r_x 0.1", call)
    agreeing = mod.bind(p={"l3": 0.4, "l1": 0.2})
    assert np.isfinite(agreeing.rhs(0, np.zeros(2))).all()


x, x_dot, d, t, u = sp.symbols("x x_dot d t u")


@pytest.mark.parametrize(("row", "what"), [(sp.sin(t) - d * t, "t"), (u - 1, "u")])
def test_rows_of_time_or_inputs_alone_are_refused(row: sp.Expr, what: str) -> None:
    m = eg.Model.from_lagrangian(
        "of_time", x_dot**2 / 2, [x], constraints=[row], parameters={"d": 1.0} if row.has(d) else {}, inputs={"u": 1.0}
    )
    refuses(f"EG-CONTRADICTION lagrangian.constraints: constraint_1 {what}", m.check)


@pytest.mark.parametrize("start", [{}, {"x_1": 1.0, "y_2": 0.5}])
@pytest.mark.parametrize("distance", ["(x_1 - x_2)**2 + (y_1 - y_2)**2", "x_1**2 - 2*x_1*x_2 + x_2**2"])
def test_a_constraint_that_is_a_square_is_named(distance: str, start: dict[str, float]) -> None:
    """Of coincident points |r|^2 is least where it is 0: it is no change point, and its components hold."""
    names = ["x_1", "x_2", "y_1", "y_2"]
    kinetic = " + ".join(f"{name}_dot**2/2" for name in names)
    model = eg.Model.from_lagrangian("points", kinetic, names, constraints=[distance])
    model.initial(**start)
    refuses("EG-REDUNDANT lagrangian.constraints constraint_1 0", model.check)
    components = eg.Model.from_lagrangian("points", kinetic, names, constraints=["x_1 - x_2", "y_1 - y_2"])
    assert components.check().degrees_of_freedom == 2


# -- Gaps across the plane ---------------------------------------------------------------------------------------------
def out_of_plane(offset: float) -> eg.Model:
    m = eg.Model("bars", gravity=(0, -9.81, 0))
    crank, rod, rocker = (m.body(name, mass=1.0, inertia={"zz": 0.1}) for name in ("crank", "rod", "rocker"))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.3, 0, 0), rod)
    m.revolute("C", rod.at(1.0, 0, offset), rocker.at(0.8, 0, 0))
    m.revolute("D", m.ground.at(0.9, 0, 0), rocker)
    m.guess = {"theta": 1.0}
    return m


@pytest.mark.parametrize("offset", [1e-9, 1e-4, 5e-3])
def test_a_gap_across_the_plane_is_reported(offset: float) -> None:
    refuses("EG-LOOP-OPEN C.r_z", lambda: out_of_plane(offset).derive())


# -- Bodies out of the plane -------------------------------------------------------------------------------------------
def body_on(axis: str, inertia: dict[str, float], turned: list[str] | None = None) -> list[str]:
    m = eg.Model("m")
    b = m.body("b", mass=1, com=[0, 0.1, 0], inertia=inertia)
    place = b.marker("p", at=[0, 0, 0], rpy=turned) if turned else b
    m.revolute("j", m.ground, place, axis=axis, coordinate="q")
    return [note for note in m.derive().report.notes if "turns about axes" in note]


@pytest.mark.parametrize("axis", "xy")
def test_it_is_reported(axis: str) -> None:
    (note,) = body_on(axis, {"zz": 1.0})
    assert note.startswith("b turns about axes without a given moment of inertia")
    assert body_on(axis, {"xx": 1.0, "yy": 1.0, "zz": 1.0}) == []


# -- planar loops made of spatial joints -------------------------------------------------------------------------------
FOUR_BAR = (models.EXAMPLES / "four_bar.yaml").read_text(encoding="utf-8")
TILTED = ["tilted_four_bar", "skewed_four_bar"]


def test_redundant_rows_are_reported_by_name(equations: Callable[..., Any], module: Callable[..., Any]) -> None:
    report = equations("three_cranks").report
    assert f"redundant: {', '.join(report.redundant)}" in str(report)
    mod = module("three_cranks")
    assert [mod.metadata["constraint_labels"][k] for k in mod.metadata["redundant_rows"]] == report.redundant
    q = mod.assemble(theta1=1.0)
    assert mod.constraints(q).shape == (3,)
    assert mod.constraint_jacobian(q).shape == (3, 4)
    assert mod.constraints(q, rows="all").shape == (4,)
    assert np.linalg.matrix_rank(mod.constraint_jacobian(q, rows="all"), tol=1e-9) == 3


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
def test_a_third_crank_of_a_parallelogram_changes_nothing(
    equations: Callable[..., Any], module: Callable[..., Any], method: str
) -> None:
    """Closed form: bars stay parallel, (3 m r^2/3 + M r^2) th'' = -(3 m/2 + M) r g cos th."""
    report = equations("three_cranks", method).report
    assert (report.constraints, report.rank, report.degrees_of_freedom) == (4, 3, 1)
    assert report.gruebler_kutzbach_planar == 0
    assert len(report.redundant) == 1
    mod = module("three_cranks", method, "cython")
    g, r, m, M = 9.81, 0.2, 0.7, 1.3
    slope = (1.5 * m + M) * g / ((m + M) * r)
    cranks = [mod.q_names.index(f"theta{k}") for k in (1, 2, 3)]
    for theta, rate in ((-0.5, 0.0), (-1.2, 3.0), (-2.4, -4.0)):
        x = mod.x0(theta1=theta, theta1_dot=rate)
        assert np.abs(x[cranks] - theta).max() <= 1e-12
        a = mod.rhs(0.0, x)[mod.n_q :]
        assert np.abs(a[cranks] + slope * np.cos(theta)).max() <= 1e-11 * slope


def test_a_loop_that_cannot_close_is_an_error_at_its_joint(tmp_path: Path) -> None:
    file = tmp_path / "wide.yaml"
    file.write_text(FOUR_BAR.replace("a4: {value: 0.10", "a4: {value: 0.50"), encoding="utf-8")
    line = next(k for k, text in enumerate(FOUR_BAR.splitlines(), start=1) if text.startswith("  C: "))
    refuses(f"EG-LOOP-OPEN {file}:{line}: joints.C:", lambda: eg.load(file).derive())


def test_inconsistent_initial_values_are_an_error(tmp_path: Path, module: Callable[..., Any]) -> None:
    file = tmp_path / "given.yaml"
    file.write_text(FOUR_BAR.replace("initial: {theta: pi/3,", "initial: {theta: pi/3, psi: 2.0,"), encoding="utf-8")
    line = next(k for k, text in enumerate(FOUR_BAR.splitlines(), start=1) if text.startswith("initial: "))
    refuses(f"EG-LOOP-OPEN {file}:{line}: initial: psi", lambda: eg.load(file).derive())
    refuses("EG-LOOP-OPEN theta psi 2.5", module("four_bar").simulate, (0, 1), {"theta": 1.0, "psi": 2.5})


def test_consistent_values_of_a_message_are_taken_when_they_are_given_back(module: Callable[..., Any]) -> None:
    mod = module("four_bar")
    with pytest.raises(eg.AssemblyError) as caught:
        mod.x0(theta=1.0, psi=2.5)
    advice = dict(pair.split(" = ") for pair in str(caught.value).rpartition("such as ")[2].split(", "))
    state = dict(zip(mod.x_names, mod.x0({name: float(value) for name, value in advice.items()}), strict=True))
    assert {name: f"{state[name]:.12g}" for name in ("theta", "psi")} == advice


def test_assembly_from_a_rough_guess(module: Callable[..., Any]) -> None:
    for name in TILTED:
        mod = module(name)
        q = mod.assemble(theta=1.0, bend=-0.2, psi=1.6)
        assert np.abs(mod.constraints(q, rows="all")).max() <= 1e-13
        assert q[mod.q_names.index("theta")] == 1.0
    mod = module("four_bar")
    other = mod.assemble(theta=1.0, bend=-2.0, psi=-2.0)  # the crossed branch, told by the guess
    assert np.abs(mod.constraints(other)).max() <= 1e-13
    assert other[mod.q_names.index("psi")] < 0
    assert mod.branch(other) == -mod.branch(mod.assemble(theta=1.0))


def spinner(**guess: float) -> eg.Model:
    """A body on a ball joint that a revolute joint about ground's z axis closes."""
    m = eg.Model("spinner")
    body = m.body("body", mass=1.0, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.3))
    m.spherical("ball", m.ground, body, coordinates=["a", "b", "c"])
    m.revolute("pin", m.ground, body)
    m.initial(c=0.2)
    m.guess(**guess)
    return m


def upright(mod: Any, q: np.ndarray) -> float:
    return float(mod.poses(q)[0][2, 2])


@pytest.mark.parametrize("guess", [{"a": 3.0}, {"a": 3.1, "b": 0.2}, {"b": 2.9}, {"a": 2.2, "b": 0.5}])
def test_flipped_solutions_are_rejected_when_a_model_is_assembled(guess: dict[str, float]) -> None:
    mod = spinner(**guess).compile(target="numpy")
    assert mod.n_dof == 1
    assert upright(mod, mod.x0()[: mod.n_q]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("target", TARGETS)
def test_flipped_solutions_are_rejected_by_the_module(target: str) -> None:
    mod = spinner().compile(target=target)
    for guess in ({"a": 3.0}, {"a": 3.1, "b": 0.2}, {"b": 2.9}):
        assert upright(mod, mod.assemble(guess)) == pytest.approx(1.0, abs=1e-12)
    # half a turn about x, held exactly, leaves half a turn about y, which stands upright; without it only the flipped
    assert upright(mod, mod.x0(a=np.pi)[: mod.n_q]) == pytest.approx(1.0, abs=1e-12)
    refuses("EG-LOOP-OPEN flipped", mod.x0, a=np.pi, b=0.0)
    assert all(upright(mod, q) > 0 for q in mod.branches())


def test_what_a_note_advises_to_leave_out_leaves_the_freedom() -> None:
    """Redundant rows of planets: what a note advises to leave out leaves one degree of freedom."""

    def epicyclic(keep: set[str]) -> Any:
        m = eg.Model("epi")
        sun, arm = m.body("sun", mass=1, inertia={"zz": 1e-3}), m.body("arm", mass=1, inertia={"zz": 5e-3})
        s, c = m.revolute("S", m.ground, sun, coordinate="th_s"), m.revolute("C", m.ground, arm, coordinate="th_c")
        for i in range(3):
            a = 2 * np.pi * i / 3
            p = m.body(f"p{i}", mass=0.6, inertia={"zz": 4e-4})
            joint = m.revolute(f"P{i}", arm.at(0.1 * np.cos(a), 0.1 * np.sin(a), 0), p, coordinate=f"th_{i}")
            if f"g{i}" in keep:
                m.planetary(f"g{i}", sun=s, carrier=c, planet=joint, teeth={"sun": 24, "planet": 18, "ring": 60})
        return m.check()

    whole = {"g0", "g1", "g2"}
    notes = " ".join(map(str, epicyclic(whole).notes))
    advice = re.search(r"leave ([\w, ]+?) out", notes)
    left_out = set(re.findall(r"g\d", advice.group(1))) if advice else set()
    assert epicyclic(whole - left_out).degrees_of_freedom == 1
