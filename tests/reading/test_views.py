"""Views of equations: what they show, names of instances of components, and what a view has not."""

from __future__ import annotations

import copy
import pickle
import re
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import sympy as sp
from shown_numbers import evaluate, number, random_state, state_values
from sweeps import part_of

import eomgen as eg
from eomgen.equations import METHODS
from eomgen.errors import UnavailableError, UsageError

EXAMPLES = Path(__file__).parents[2] / "examples"


@cache
def two_arms() -> eg.Model:
    """A cart that carries two arms of one component, ``left`` and ``x``; the second one's prefix is not its name."""
    arm = eg.Model("arm")
    arm.parameter("l", 0.5, unit="m")
    arm.parameter("m", 1.0, unit="kg")
    arm.input("tau", 0.2)
    rod = arm.body("rod", mass="m", com=(0, "-l/2", 0), inertia={"zz": "m*l**2/12"})
    rod.marker("end", at=(0, "-l", 0))
    arm.revolute("hinge", arm.attachment("top"), rod)
    arm.torque("motor", "hinge", "tau")
    model = eg.Model("two_arms", gravity=(0, "-g", 0))
    model.parameter("g", 9.81)
    cart = model.body("cart", mass=3)
    model.prismatic("rail", model.ground, cart, axis="x", coordinate="s")
    model.add(arm, "left_", at=cart.at(-0.3, 0, 0), l=0.4)
    model.add(arm, "x_", at=cart.at(0.3, 0, 0), l=0.6)
    return model


def derived(method: str = "embedding") -> Any:
    return two_arms().derive(method)


# -- names with a dot after the instance ------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_names_of_instances_are_taken_with_dots_everywhere(method: str) -> None:
    equations = derived(method)
    symbol = sp.Symbol("left_hinge")
    assert equations.subs({"left.hinge": 0}).mass_matrix == equations.subs({symbol: 0}).mass_matrix
    assert symbol not in equations.subs({"left.hinge": "x.hinge/2"}).mass_matrix.free_symbols
    assert equations.subs({"left.hinge_dot": 0}).force == equations.subs({"left_hinge_dot": 0}).force
    assert equations.subs({sp.Symbol("left.tau"): sp.Symbol("x.tau")}).force[1].has(sp.Symbol("x_tau"))
    by_mapping = equations.with_parameters({"left.l": 2, "x.l": "left.l"})
    assert by_mapping.mass_matrix == equations.with_parameters(left_l=2, x_l="left_l").mass_matrix
    assert equations.with_parameters({sp.Symbol("g"): 1}, left_l=2).mass_matrix[1, 1] == 4 * sp.Symbol("left_m") / 3
    for name in ("poses", "velocities", "accelerations"):
        parts = getattr(equations, name)
        assert parts["left.rod.end"] == parts["left_rod.end"]
        assert "x.rod" in parts
        assert equations.written(name, "x.rod") == equations.written(name, "x_rod")
    assert equations.generalized_forces["left.motor"] == sp.Matrix([0, sp.Symbol("left_tau"), 0])
    at = {"left.hinge": 0, "x.hinge": sp.pi, "s": 0}
    assert equations.linearize(at=at).A == equations.linearize(at={k.replace(".", "_"): v for k, v in at.items()}).A
    if method in ("newton_euler", "amalgamated"):
        assert equations.free_bodies["x.rod"] == equations.free_bodies["x_rod"]
        assert equations.joint_forces["x.hinge"] == equations.joint_forces["x_hinge"]


def test_independent_coordinates_are_named_with_dots() -> None:
    named = two_arms().derive(independent=["s", "left.hinge", "x.hinge"])
    assert named.independent == ("s", "left_hinge", "x_hinge")
    assert named.mass_matrix == derived().mass_matrix
    with pytest.raises(eg.ModelError, match="no coordinate 'left_hnge'"):
        two_arms().derive(independent=["left.hnge"])


@pytest.mark.parametrize(
    ("ask", "word"),
    [
        (lambda e: e.subs({"left.hnge": 0}), "no symbol 'left_hnge'; did you mean left_hinge"),
        (lambda e: e.subs({"right.hinge": 0}), "no symbol 'right.hinge'"),
        (lambda e: e.subs({"left.hinge": 0, "left_hinge": 1}), "symbol 'left_hinge' is given twice"),
        (lambda e: e.with_parameters({"left.l": 1}, left_l=2), "parameter 'left_l' is given twice"),
        (lambda e: e.with_parameters({"left.hinge": 1}), "no parameter 'left_hinge'"),
        (lambda e: e.with_parameters(3), "values are given by name, as a mapping does, not 3"),
        (lambda e: e.with_parameters({"l": 3}), "no parameter 'l'"),
        (lambda e: e.poses["left.rodd"], "no body or marker 'left_rodd'; did you mean left_rod"),
        (lambda e: e.generalized_forces["left.moter"], "no force element 'left_moter'; did you mean left_motor"),
        (lambda e: e.linearize(at={"left.phi": 0}), "no symbol 'left_phi'"),
        (lambda e: e.written("foo"), "'foo' is no quantity that is written; there are T, V, lagrangian"),
        (lambda e: e.written("masmatrix"), "'masmatrix' is no quantity that is written; did you mean mass_matrix?"),
        (lambda e: e.written("M"), "did you mean mass_matrix?"),
        (lambda e: e.written(None), "None is no quantity that is written"),
        (lambda e: e.written("poses"), "'poses' are written one by one; give the name of one as part: 'cart', "),
        (lambda e: e.written("T", "rod"), "'T' has no parts; leave 'rod' out"),
        (lambda e: e.written("generalized_forces", "motor"), "no force element 'motor'"),
    ],
)
def test_faults_are_named(ask: Any, word: str) -> None:
    with pytest.raises(UsageError) as raised:
        ask(derived())
    assert word in str(raised.value)


@pytest.mark.parametrize("method", METHODS)
def test_all_that_is_written_is_given_by_written(method: str) -> None:
    """Every attribute that is made of the graph, so that the list of names in written() is whole."""
    equations = eg.load(EXAMPLES / "slider_crank.yaml").derive(method)
    plain = {"notation", "momentum_symbols", "intermediates", "report", "operations"}
    for name in (n for n in dir(type(equations)) if not n.startswith("_") and n not in plain):
        kind = type(vars(next(base for base in type(equations).__mro__ if name in vars(base)))[name]).__name__
        value = getattr(equations, name, None)
        if kind not in ("cached_property", "property") or value is None or isinstance(value, bool | str | tuple | dict):
            continue
        part = None if hasattr(value, "shape") or isinstance(value, sp.Expr) else next(iter(value))
        if not isinstance(value, tuple) and part is not None:
            assert equations.written(name, part)[1] == value[part]
        elif part is None:
            assert equations.written(name)[1] == value


# -- parts of the generalized forces ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["four_bar", "n_four_bar", "bricard", "double_wishbone"])
def test_parts_of_the_generalized_forces_come_with_their_named_parts(name: str) -> None:
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    module: Any = equations.compile("numpy")
    values = state_values(module, random_state(module, 5), 0.0)
    whole, total = equations.written("generalized_forces")
    found = {key: evaluate(*_flat(equations.written("generalized_forces", key)), values) for key in total.parts}
    for key, (named, column) in ((key, equations.written("generalized_forces", key)) for key in total.parts):
        assert column == total[key]
        used = column.free_symbols.union(*(x.free_symbols for _, x in named)) - {symbol for symbol, _ in named}
        assert {str(symbol) for symbol in used} <= set(values)
        assert set(named) <= set(whole)
    wanted = number(equations, "generalized_forces", values)[:, 0]
    np.testing.assert_allclose(sum(found.values()), wanted, rtol=1e-9, atol=1e-10 * np.abs(wanted).max())


def _flat(written: tuple[Any, Any]) -> tuple[Any, list[Any]]:
    return written[0], list(written[1])


def test_a_large_part_has_named_parts() -> None:
    """The test above would not see it if all were written out."""
    equations = eg.load(EXAMPLES / "bricard.yaml").derive()
    assert len(equations.written("generalized_forces", "gravity")[0]) > 10


# -- what a view shows ------------------------------------------------------------------------------------------------


def test_a_view_shows_its_values_and_its_equations() -> None:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    for name in ("m", "l", "g"):
        m.parameter(name)
    m.revolute("pin", m.ground, m.body("bob", mass="m", com=(0, "-l", 0)), coordinate="theta")
    equations = m.derive()
    view = equations.with_parameters(l=0.5, g=9.81)
    lines = str(view).splitlines()
    assert lines[1:3] == ["  method embedding, 1 degree of freedom", "  with l = 0.5, g = 9.81"]
    assert "  m θ''/4 = -4.905 m sin(θ)" in lines
    assert repr(view) == str(view)
    assert "read next" in lines[-3]
    assert "operations" not in str(view)
    page = view._repr_html_()
    ElementTree.fromstring(f"<div>{page}</div>")
    assert "<mn>9.81</mn>" in page
    assert "<mn>4.905</mn>" in page
    assert view._repr_latex_().endswith("$$\n\\text{with } l = 0.5,\\quad g = 9.81\n$$")
    assert r"\frac{1}{4} m \ddot{\theta} = -4.905 m \sin \theta" in view._repr_latex_()
    assert "<img" not in page  # the picture has the model's own values
    chain = equations.subs({"l": "2*r_0"}).subs({"r_0": sp.Rational(1, 8)})
    assert "  with l = 2 r₀, r₀ = 1/8" in str(chain).splitlines()
    still = equations.subs({"theta_ddot": 3, "theta": "pi/2"})
    assert "M v' = f with v' = (3)" in str(still).splitlines()
    assert r"M\, \begin{bmatrix}3\end{bmatrix} = f" in still._repr_latex_()


@pytest.mark.parametrize("method", part_of(METHODS, ("embedding", "lagrange", "newton_euler", "hamilton").__contains__))
def test_functions_of_time_show_the_same_equations(method: str) -> None:
    for model in (two_arms(), eg.load(EXAMPLES / "slider_crank.yaml")):
        equations = model.derive(method)
        timed = equations.with_dynamicsymbols()
        changed = str(timed).replace(" of freedom, functions of time", " of freedom")
        assert _without_attributes(changed) == _without_attributes(str(equations))
        assert timed._repr_latex_() == equations._repr_latex_()
        assert timed._equations_html == equations._equations_html


def _without_attributes(text: str) -> str:
    return text.partition("read next")[0]


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "rolling_disc", "satellite", "car_axis"])
def test_the_formulas_of_a_view_are_the_compiled_ones(name: str) -> None:
    """Parameters and the place of a consistent state put in: the same numbers as those of the module there."""
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    module: Any = equations.compile("numpy")
    x = random_state(module, 4)
    values = state_values(module, x, 0.0)
    parameters = dict(zip(module.p_names, map(float, module.p), strict=True))
    view = equations.with_parameters(parameters).subs({n: values[n] for n in module.x_names[: module.n_q]})
    left = {str(s) for s in view.mass_matrix.free_symbols.union(*(x.free_symbols for _, x in view.intermediates))}
    assert left.isdisjoint(parameters)
    assert left.isdisjoint(module.x_names[: module.n_q])
    mass = number(view, "mass_matrix", values)
    wanted = module.embedded_mass_matrix(x[: module.n_q])
    np.testing.assert_allclose(mass, wanted, rtol=1e-9, atol=1e-10 * np.abs(wanted).max())
    a = [values[name] for name in equations.acceleration_names]
    terms = wanted * np.array(a)
    force = number(view, "force", values)[:, 0]
    np.testing.assert_allclose(force, terms.sum(axis=1), atol=1e-9 * np.abs(terms).max())
    shown = str(view)
    assert max(map(len, shown.splitlines())) <= 80
    with_line = shown.partition("coordinates")[0]
    assert all(re.search(rf"\b{value:.4g}"[:6], with_line) for value in list(parameters.values())[:3])
    ElementTree.fromstring(f"<div>{view._repr_html_()}</div>")


def test_a_view_goes_through_pickle_and_copy_with_its_display() -> None:
    view = derived().with_dynamicsymbols().subs({"left.hinge": 0, "s_ddot": 0})
    for twin in (pickle.loads(pickle.dumps(view)), copy.deepcopy(view)):
        assert str(twin) == str(view)
        assert twin.poses["left.rod"] == view.poses["left.rod"]
        assert twin.generalized_forces["x.motor"] == view.generalized_forces["x.motor"]


# -- what a view has not ----------------------------------------------------------------------------------------------


def test_explain_of_a_view() -> None:
    equations = derived()
    assert equations.with_dynamicsymbols().explain("short").difference < 1e-10
    assert equations.subs({}).with_parameters().explain("short").difference < 1e-10
    view = equations.with_parameters({"left.l": 0.5}).subs({"s": 0})
    with pytest.raises(UnavailableError, match=re.escape("no view with left_l = 0.5, then s = 0")) as raised:
        view.explain()
    assert "differentiate by s" in str(raised.value)
    with pytest.raises(UnavailableError, match="the model has no parameter or input k_9"):
        equations.with_parameters({"left.l": "k_9"}).explain()


@pytest.mark.parametrize("method", ["embedding", "newton_euler", "hamilton"])
def test_a_solution_with_values_is_that_of_a_model_with_numbers(method: str) -> None:
    """M of the view's solution is the compiled one at other values than the declared ones, which are not in it."""
    equations = eg.load(EXAMPLES / "two_link_manipulator.yaml").derive(method)
    values = {"l2": 0.7, "m3": "3*m2", "tau3": 0.25}
    solution = equations.subs(values).explain()
    assert solution.difference < 1e-10
    assert "with `l2` = 0.7, `m3` = " in solution.title
    final = next(s for s in solution.sections if s.title == "Equations of motion")
    shown = [
        x for piece in final.pieces for side in getattr(piece, "sides", ()) for x in getattr(side, "free_symbols", ())
    ]
    assert shown
    assert {"l2", "m3", "tau3"}.isdisjoint(map(str, shown))
    m2 = {p.name: p.value for p in equations.kinematics.mechanism.parameters}["m2"]
    module = equations.compile("numpy").bind(p={"l2": 0.7, "m3": 3 * m2}, u={"tau3": 0.25})
    view = equations.subs(values)
    numbers = dict(zip(module.x_names, module.x0(), strict=True)) | dict(zip(module.p_names, module.p, strict=True))
    numbers["tau2"] = 0.0
    at = {sp.Symbol(name): value for name, value in numbers.items()}
    n = module.n_q
    wanted = module.embedded_mass_matrix(module.x0()[:n]) @ module.rhs(0.0, module.x0())[n:]
    assert [float(x.subs(at)) for x in view.force] == pytest.approx(list(wanted), rel=1e-11)


def test_what_is_compiled_is_asked_of_the_equations() -> None:
    view = derived().with_parameters({"left.l": 0.5})
    for name in ("compile", "operations", "report", "tree"):
        assert not hasattr(view, name) or name == "tree"
        with pytest.raises(AttributeError, match=r"view of equations has no .*"):
            getattr(view, name)
    with pytest.raises(AttributeError, match=r"'compile': values are put into what is read.*\.source"):
        _ = view.compile
    assert view.source.method == view.method
    with pytest.raises(AttributeError, match="did you mean mass_matrix"):
        _ = view.mass_matrx
