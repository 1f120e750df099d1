"""The mobility report: freedoms at once, redundant rows by name, candidates, notes with remedies, the picture."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import models
import numpy as np
import pytest

import eomgen as eg
from benchmarks.linkages import n_four_bar
from eomgen.kinematics.picture import place
from eomgen.kinematics.report import MechanismReport

from .test_repartition import four_bar


def test_flat_parallelograms_have_more_freedoms_at_once() -> None:
    m = n_four_bar(3)
    m.initial(**{f"theta{k}": 0 for k in range(4)} | {f"bend{k}": 0 for k in (1, 2, 3)})
    report = m.derive(independent=["theta0"]).report
    assert (report.degrees_of_freedom, report.instantaneous_freedoms) == (1, 4)
    assert any(note.startswith("change point: 4 degrees of freedom") for note in report.notes)
    assert "start a little away from this configuration" in str(report)


def test_candidates_are_rated_by_how_well_they_move_the_mechanism() -> None:
    """Of a four-bar: the smallest singular value of J without the column over the largest of J."""
    equations = four_bar((0.3, 0.9, 0.7, 0.8)).derive()
    report = equations.report
    mod = equations.compile()
    J = mod.constraint_jacobian(np.array(equations.mobility.q_reference)) / report.length_scale
    largest = np.linalg.svd(J)[1][0]
    for k, name in enumerate(mod.q_names):
        expected = np.linalg.svd(np.delete(J, k, axis=1))[1][-1] / largest
        assert report.candidates[name] == pytest.approx(expected, rel=1e-10)
    assert list(report.candidates.values()) == sorted(report.candidates.values(), reverse=True)
    assert "can be independent" in str(report)


def test_a_coordinate_at_its_dead_centre_is_no_candidate() -> None:
    m = eg.load(models.EXAMPLES / "slider_crank.yaml")
    m.initial(theta=0)
    report = m.derive().report
    assert set(report.candidates) == {"theta", "B"}


def test_a_poor_choice_is_noted_with_a_better_one() -> None:
    m = eg.load(models.EXAMPLES / "slider_crank.yaml")
    m.initial(theta=1e-3)
    report = m.derive(independent=["s"]).report
    assert any("s hardly moves" in note and "would do better" in note for note in report.notes)
    m.initial(theta=0)
    assert any("would do better" in note for note in m.derive(independent=["s"]).report.notes)


def test_an_overconstrained_mechanism_names_what_is_too_much() -> None:
    report = eg.load(models.EXAMPLES / "bricard.yaml").derive().report
    note = next(note for note in report.notes if note.startswith("overconstrained"))
    assert report.redundant[0] in note
    assert "release only these rows of J6, whose other rows are needed" in note


def epicyclic(kept: set[str]) -> MechanismReport:
    """Three planets between sun and ring, which carry one freedom together; g3 repeats g0."""
    m = eg.Model("epicyclic")
    sun, arm = m.body("sun", mass=1, inertia={"zz": 1e-3}), m.body("arm", mass=1, inertia={"zz": 5e-3})
    s, c = m.revolute("S", m.ground, sun, coordinate="th_s"), m.revolute("C", m.ground, arm, coordinate="th_c")
    for i in range(3):
        planet = m.body(f"p{i}", mass=0.6, inertia={"zz": 4e-4})
        hub = arm.at(0.1 * np.cos(2.0 * i), 0.1 * np.sin(2.0 * i), 0)
        joint = m.revolute(f"P{i}", hub, planet, coordinate=f"th_{i}")
        for name in sorted({f"g{i}", *(["g3"] if i == 0 else [])} & kept):
            m.planetary(name, sun=s, carrier=c, planet=joint, teeth={"sun": 24, "planet": 18, "ring": 60})
    return m.check()


@pytest.mark.parametrize("meshes", [{"g0", "g1", "g2"}, {"g0", "g1", "g2", "g3"}, {"g0", "g3"}])
def test_advice_to_leave_elements_out_keeps_the_freedoms(meshes: set[str]) -> None:
    report = epicyclic(meshes)
    note = next(note for note in report.notes if note.startswith("overconstrained"))
    advice = re.search(r"leave ([\w, ]+) out", note)
    spare = set(advice.group(1).split(", ")) if advice else set()
    assert spare == meshes & {"g3"}
    assert epicyclic(meshes - spare).degrees_of_freedom == report.degrees_of_freedom


def test_gravity_that_was_forgotten_and_angles_in_degrees_are_noted() -> None:
    def pendulum(start: object, **given: object) -> tuple[str, ...]:
        m = eg.Model("pendulum", **given)  # type: ignore[arg-type]
        m.revolute("A", m.ground, m.body("bob", mass=1, com=(0, -1, 0)), coordinate="th")
        m.initial(th=start)
        return tuple(m.check().notes)

    (note,) = pendulum(0.3)
    assert note.startswith("no gravity is given and no force acts")
    assert "if it should fall, give gravity" in note
    assert pendulum("4*pi", gravity=(0, 0, 0)) == pendulum(0.3, gravity=(0, -9.81, 0)) == ()
    (note,) = pendulum(90, gravity=(0, -9.81, 0))
    assert note.startswith("th = 90 is an angle of 14.3 turns")
    assert "deg(90)" in note
    assert pendulum("deg(90)", gravity=(0, -9.81, 0)) == ()


def test_a_motion_given_by_an_equation_needs_no_gravity() -> None:
    m = eg.Model("shaker")
    m.prismatic("A", m.ground, m.body("slide", mass=1), coordinate="q")
    m.coupling("shake", equation="q - 0.1*sin(5*t)")
    assert not m.check().notes


def truss() -> eg.Model:
    """A four-bar with a further rod across: nothing moves."""
    m = four_bar((0.3, 0.9, 0.7, 0.8))
    q = m.derive().report.reference
    x = 0.15 * np.cos(q["theta"]), 0.15 * np.sin(q["theta"])
    y = 0.8 + 0.35 * np.cos(q["psi"]), 0.35 * np.sin(q["psi"])
    m.distance(
        "stay",
        m.bodies["crank"].at(0.15, 0, 0),
        m.bodies["rocker"].at(0.35, 0, 0),
        float(np.hypot(y[0] - x[0], y[1] - x[1])),
    )
    return m


def test_a_locked_mechanism_says_what_holds_it() -> None:
    m = truss()
    report = m.derive().report
    assert report.degrees_of_freedom == 0
    note = next(note for note in report.notes if note.startswith("locked"))
    assert "held by C, stay" in note
    assert "if it should move, remove a constraint, or replace a joint by one with more freedom" in note


def test_contradictory_constraints_are_named_with_their_gap() -> None:
    m = four_bar((0.3, 0.9, 0.7, 0.8))
    for name, length in (("one", 0.8), ("two", 0.9)):
        m.distance(name, m.bodies["crank"].at(0.15, 0, 0), m.bodies["rocker"].at(0.35, 0, 0), length)
    with pytest.raises(eg.AssemblyError, match="contradict each other") as caught:
        m.derive()
    assert "one.length" in str(caught.value)
    assert "two.length" in str(caught.value)
    assert "remove one of them" in str(caught.value)


def test_sizes_that_do_not_close_are_no_contradiction() -> None:
    with pytest.raises(eg.AssemblyError, match=r"joints\.C.*do not close.*C\.r_.*check the dimensions") as caught:
        four_bar((1.0, 0.3, 0.3, 3.0)).derive()
    assert "contradict" not in str(caught.value)


# -- the picture
def test_bodies_lie_in_layers_above_what_carries_them() -> None:
    report = eg.load(models.EXAMPLES / "andrews_squeezer.yaml").derive().report
    places = place(report).bodies
    assert set(places) == set(report.bodies)
    assert len(set(places.values())) == len(places)  # none hides another
    for branch in report.tree:
        below = places[branch["parent"]][1] if branch["parent"] != "ground" else 0
        assert places[branch["body"]][1] == below + 1


@pytest.mark.parametrize("name", ["slider_crank", "andrews_squeezer", "planetary_gear"])
def test_the_picture_shows_every_body_joint_and_element(name: str, tmp_path: Path) -> None:
    report = eg.load(models.EXAMPLES / f"{name}.yaml").derive().report
    axes = report.draw(tmp_path / "graph.svg")
    texts = [text.get_text() for text in axes.texts]
    for shown in (*report.bodies, *(f"{j['name']}\n{j['type']}" for j in report.joints)):
        assert shown in texts
    for element in report.elements:
        assert f"{element['name']} ({element['type']})" in texts
    dashed = [
        t for t in axes.texts if t.arrow_patch is not None and t.arrow_patch.get_linestyle() not in ("-", "solid")
    ]
    assert len(dashed) == len(report.loop_joints)
    assert ElementTree.parse(tmp_path / "graph.svg").getroot().tag.endswith("svg")


def test_the_picture_goes_where_it_is_told(tmp_path: Path) -> None:
    report = n_four_bar(2).derive().report
    report.draw(tmp_path / "graph.png")
    assert (tmp_path / "graph.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(eg.UsageError, match=r"\.svg"):
        report.draw(tmp_path / "graph.doc")


def test_elements_know_the_bodies_they_hold() -> None:
    report = eg.load(models.EXAMPLES / "planetary_gear.yaml").derive().report
    held = {element["name"]: set(element["bodies"]) for element in report.elements}
    assert held["gears"] == {"sun", "carrier", "planet"}
    assert held["rope"] == {"carrier", "load"}
