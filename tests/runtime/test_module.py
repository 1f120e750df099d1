"""The calls of a Module: shapes, batches, parameters, assembly by name, kinematics, errors."""

import ast
import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from eomgen.api.module import CALLS, FORMS, Module
from eomgen.errors import (
    AssemblyError,
    NonFiniteError,
    PartitionError,
    ProjectionError,
    SingularMassMatrixError,
    UsageError,
)
from eomgen.runtime import NumpyCore

REFERENCES = Path(__file__).parents[1] / "reference"


def test_shapes_of_every_call_for_one_state_and_a_batch(crank):
    m = crank(copies=2)
    x = m.x0()
    q, v, a = x[:3], x[3:], np.zeros(3)
    batch = np.repeat(x[:, None], 4, axis=1)
    expected = {
        "rhs": (6,), "jacobian": (6, 6), "bias": (3,), "outputs": (2,), "energy": (2,), "project": (6,),
        "mass_matrix": (3, 3), "embedded_mass_matrix": (1, 1), "poses": (3, 4, 4), "constraints": (2,),
        "constraint_jacobian": (2, 3),
    }  # fmt: skip
    for name, shape in expected.items():
        call = getattr(m, name)
        timed = name in ("rhs", "jacobian", "bias", "outputs")
        full = name in ("rhs", "jacobian", "bias", "outputs", "energy", "project")
        one, many = (x, batch) if full else (q, batch[:3])
        before = (0.0,) if timed else ()
        result = call(*before, one)
        assert result.shape == shape, name
        every = call(*before, many)
        assert every.shape == (*shape, 4), name
        np.testing.assert_allclose(every[..., 2], result, rtol=1e-13, atol=1e-13)
        # strided and other real types
        wide = np.zeros((len(one), 8))
        wide[:, ::2] = many
        np.testing.assert_array_equal(call(*before, wide[:, ::2]), every)
        np.testing.assert_array_equal(call(*before, wide[:, 0]), result)
        np.testing.assert_array_equal(call(*before, one.tolist()), result)
        out = np.empty(shape)
        assert call(*before, one, out=out) is out
        np.testing.assert_array_equal(out, result)
        with pytest.raises(UsageError):
            call(*before, np.zeros(7))
    assert m.inverse_dynamics(q, v, a).shape == (3,)
    assert m.inverse_dynamics(batch[:3], batch[3:], np.zeros((3, 4))).shape == (3, 4)
    assert m.constraints(q, rows="all").shape == (3,)
    with pytest.raises(UsageError, match="independent"):
        m.constraints(q, rows="some")
    T, V = m.energy(x)
    assert T > 0
    assert np.isfinite(V)


def test_rhs_is_the_published_one(crank):
    """Reference: planar_slider_crank_dynamics.json (multiplier form in 30 digits)."""
    data = json.loads((REFERENCES / "planar_slider_crank_dynamics.json").read_text())
    m = crank()
    x = m.x0(theta=0.0, theta_dot=150.0)
    expected = [float(a) for a in data["reference"]["omega150"]["initial_acc"]]
    np.testing.assert_allclose(m.rhs(0.0, x)[3:], expected, rtol=1e-13, atol=1e-11)


def test_parameters_and_inputs_per_call_and_bound(crank):
    m = crank()
    x = m.x0(theta=0.3, theta_dot=2.0)
    u = np.array([0.5, 0.0])
    bound = m.bind(u={"tau": 0.5})
    np.testing.assert_array_equal(m.rhs(0, x, u=u), bound.rhs(0, x))
    assert not np.array_equal(m.rhs(0, x), bound.rhs(0, x))
    p = m.p
    p[m.p_names.index("g")] = 0.0
    np.testing.assert_array_equal(m.rhs(0, x, p=p), m.bind({"g": 0.0}).rhs(0, x))
    assert m.bind({"g": 0.0}).bind({"m3": 1.0}).p[m.p_names.index("g")] == 0.0
    with pytest.raises(UsageError, match="did you mean m1"):
        m.bind({"m11": 1.0})
    with pytest.raises(UsageError, match="must be a number"):
        m.bind({"m1": "heavy"})
    with pytest.raises(UsageError, match=r"shape \(11,\)"):
        m.bind(np.zeros(3))


def test_x0_holds_given_values_exactly_and_closes_the_loops(crank):
    m = crank(copies=2)
    for values in ({"theta": 0.3, "theta_dot": 10.0}, {"s": 0.4}, {"psi": 0.2, "psi_dot": 1.0}, {"beta": 0.1}, {}):
        x = m.x0(**values)
        named = dict(zip(m.x_names, x, strict=True)) | {"psi": -x[1], "psi_dot": -x[4]}
        for name, value in values.items():
            assert named[name] == pytest.approx(value, abs=1e-11 if name in m.loop_names else 0)
        assert np.abs(m.constraints(x[:3], rows="all")).max() < 1e-12
        assert np.abs(m.constraint_jacobian(x[:3], rows="all") @ x[3:]).max() < 1e-11
    assert m.x0()[m.x_names.index("theta_dot")] == 10.0  # declared
    assert m.x0(theta=0.5)[m.x_names.index("theta_dot")] == 10.0  # declared, and there is room
    assert m.x0(s_dot=0.0, theta=0.5)[3] == 0.0  # declared, but no room


def test_x0_stays_on_the_branch_of_the_reference(crank):
    m = crank()
    for theta in np.linspace(-9, 9, 13):
        assert np.cos(m.x0(theta=theta)[1]) > 0
    assert m.branch(m.x0(theta=3.0)) == 1
    both = m.branches(theta=0.5)
    assert len(both) == 2
    assert m.branch(both[1]) == -1
    assert np.cos(m.assemble(theta=0.5, beta=3.0)[1]) < 0
    assert m.assemble(theta=0.5, beta=3.0)[0] == 0.5
    assert m.assemble(theta=0.5)[0] == 0.5


def test_assembly_with_other_parameters(crank):
    m = crank()
    p = {"l1": 0.2, "l2": 0.5, "e": 0.05}
    x = m.x0({"theta": 0.7}, p=p)
    assert x[0] == 0.7
    assert np.abs(m.bind(p).constraints(x[:3])).max() < 1e-13
    with pytest.raises(AssemblyError, match=r"C\.y"):
        m.x0({"theta": 0.7}, p={"e": 3.0})


def test_initial_values_that_do_not_fit_are_told(crank):
    m = crank()
    with pytest.raises(AssemblyError, match="inconsistent: 2 values for 1 degree of freedom"):
        m.x0(theta=0.3, s=0.2)
    with pytest.raises(AssemblyError, match="cannot close with s = 2"):
        m.x0(s=2.0)
    with pytest.raises(AssemblyError, match="theta_dot = 1, s_dot = 1"):
        m.x0(theta=0.3, theta_dot=1.0, s_dot=1.0)
    with pytest.raises(UsageError, match="did you mean theta"):
        m.x0(thetta=0.3)
    with pytest.raises(UsageError, match="parameter, not a coordinate"):
        m.x0(l1=0.3)
    with pytest.raises(UsageError, match="finite"):
        m.x0(theta=np.nan)
    with pytest.raises(UsageError, match="positions only"):
        m.assemble(theta_dot=1.0)
    # more than needed is fine when it fits
    x = m.x0(theta=0.3)
    np.testing.assert_array_equal(m.x0(dict(zip(m.q_names, x, strict=False)))[:3], x[:3])


@pytest.mark.parametrize("case", ["inline", "offset"])
def test_kinematics_equal_the_closed_form_over_a_full_turn(crank, case):
    """Reference: slider_crank_kinematics.json (closed form, 17 digits); in between, the same formulas."""
    data = json.loads((REFERENCES / "slider_crank_kinematics.json").read_text())["reference"][case]
    r, length, e = (float(data[key]) for key in "rle")
    m = crank().bind({"l1": r, "l2": length, "e": e})
    angles = np.array([float(key) for key in data["rows"]])
    q, v, a = m.kinematics(np.deg2rad(angles)[None], np.full((1, len(angles)), 10.0), np.full((1, len(angles)), 3.0))
    for j, row in enumerate(data["rows"].values()):
        assert q[2, j] == pytest.approx(float(row["x"]), abs=1e-14)
        assert q[1, j] == pytest.approx(float(row["rod_angle"]), abs=1e-14)
        assert v[2, j] == pytest.approx(float(row["v"]), abs=1e-12)
        assert a[2, j] == pytest.approx(float(row["a"]), abs=1e-11)
        assert a[1, j] == pytest.approx(float(row["rod_alpha"]), abs=1e-11)
    theta = np.linspace(0, 2 * np.pi, 100)
    q, _, _ = m.kinematics(theta[None])
    np.testing.assert_allclose(q[2], r * np.cos(theta) + np.sqrt(length**2 - (e - r * np.sin(theta)) ** 2), atol=1e-13)


@pytest.mark.parametrize("slack", [0.0, 1e-12])
def test_the_slider_cannot_be_given_a_velocity_at_a_dead_centre(crank, slack):
    m = crank()
    r, l = (m.p[m.p_names.index(name)] for name in ("l1", "l2"))
    with pytest.raises(AssemblyError, match=r"s_dot = 1 cannot .* dead centre.*; give theta_dot"):
        m.x0(s=r + l - slack, s_dot=1.0)
    x = m.x0(s=r + l - slack, theta_dot=2.0)
    assert abs(x[m.x_names.index("s_dot")]) < 1e-4
    theta = 0.01  # near, and the closed form still holds
    x = m.x0(theta=theta, s_dot=1.0)
    speed = -r * np.sin(theta) * (1 + r * np.cos(theta) / np.sqrt(l**2 - (r * np.sin(theta)) ** 2))
    assert x[m.x_names.index("theta_dot")] == pytest.approx(1.0 / speed, rel=1e-9)


def test_kinematics_is_pure(crank):
    m = crank()
    targets = np.array([[5.0, -3.0, 0.2, 5.0, 2.0]])
    batch = m.kinematics(targets)[0]
    for j in (4, 1, 0):
        np.testing.assert_array_equal(m.kinematics(targets[:, j])[0], batch[:, j])
    with pytest.raises(UsageError, match="q_i must have shape"):
        m.kinematics(np.zeros(2))
    other = m.kinematics([0.5], guess=[0.5, 3.0, 0.0])[0]
    assert np.cos(other[1]) < 0


def test_kinematics_says_when_the_way_is_blocked(crank):
    m = crank(independent=[2], q_reference=[0.7, -0.32768, 0.40673])
    with pytest.raises((ProjectionError, PartitionError), match=r"path to s = 0\.6 is blocked"):
        m.kinematics([0.6])


def test_a_tree_has_trivial_constraints(pendulum):
    x = pendulum.x0()
    assert x.tolist() == [0.5, 0.0]
    assert pendulum.constraints(x[:1]).shape == (0,)
    assert pendulum.constraint_jacobian(np.zeros((1, 4))).shape == (0, 1, 4)
    np.testing.assert_array_equal(pendulum.project(x), x)
    np.testing.assert_array_equal(pendulum.embedded_mass_matrix(x[:1]), [[2.0]])
    q, v, a = pendulum.kinematics([300.0], [2.0], [3.0])
    assert (q[0], v[0], a[0]) == (300.0, 2.0, 3.0)
    assert pendulum.assemble(theta=1.0).tolist() == [1.0]
    np.testing.assert_allclose(pendulum.outputs(0, x), [np.sin(0.5), -9.81 * np.sin(0.5)])


def test_failures_name_time_state_and_culprit(crank, pendulum):
    m = crank()
    with pytest.raises(SingularMassMatrixError, match=r"t = 2, theta = .*moving theta meets no inertia") as caught:
        m.bind({"m1": 0.0, "m2": 0.0, "m3": 0.0, "J1": 0.0, "J2": 0.0}).rhs(2.0, m.x0())
    assert caught.value.time == 2.0
    np.testing.assert_array_equal(caught.value.state, m.x0())
    with pytest.raises(ProjectionError, match=r"largest residual at C\.y"):
        m.bind({"e": 2.0}).rhs(0.0, m.x0())
    with pytest.raises(NonFiniteError, match="beta already is not"):
        m.rhs(0.0, [0.0, np.nan, 0.3, 0.0, 0.0, 0.0])
    with pytest.raises(SingularMassMatrixError, match="moving theta"):
        pendulum.bind({"m": 0.0}).rhs(0.0, [0.5, 0.0])
    with pytest.raises(PartitionError, match="independent are s"):
        crank(independent=[2]).embedded_mass_matrix(m.x0()[:3])
    assert np.isnan(m.kernels.timed("rhs", nan=True)(0.0, np.full(6, np.nan))).all()


def test_failed_columns_of_a_batch_are_nan_alone(crank):
    m = crank()
    rhs = m.kernels.timed("rhs", nan=True)
    x = np.repeat(m.x0()[:, None], 3, axis=1)
    x[0, 1] = np.nan
    result = rhs(0.0, x)
    assert np.isfinite(result[:, [0, 2]]).all()
    assert np.isnan(result[:, 1]).all()
    assert rhs.failure[0] == 1


def test_driven_constraints_depend_on_time(crank):
    m = crank().bind({"a": 0.02, "w": 5.0})
    x = m.x0(theta=0.7, theta_dot=2.0, t=0.1)
    assert np.abs(m.constraints(x[:3], t=0.1)).max() < 1e-13
    assert np.abs(m.kernels.state("velocity_constraints")(x, t=0.1)).max() < 1e-12
    q, v, _ = m.kinematics([0.7], [2.0], [0.0], t=0.1)
    np.testing.assert_allclose(np.concatenate([q, v]), x, atol=1e-12)
    times = np.array([0.1, 0.2])
    q = m.kinematics(np.array([[0.7, 0.7]]), t=times)[0]
    assert np.abs(m.constraints(q, t=times)).max() < 1e-13


def test_a_declared_position_without_values_for_parameters(models):
    data = models.crank_metadata(p_values=[None, *list(models.CRANK_PARAMETERS.values())[1:]])
    m = Module(NumpyCore(json.dumps(data), models.crank_blocks()), p={"l1": 0.153})
    assert np.isfinite(m.rhs(0, m.x0())).all()


def test_flips_are_refused_through_the_alignment_kernel(models):
    blocks = models.crank_blocks() | {"alignment": lambda t, x, u, c: np.cos(x[1:2])}
    m = Module(NumpyCore(models.crank_metadata(alignment_labels=["C"]), blocks))
    assert np.cos(m.assemble(theta=0.5, beta=3.0)[1]) > 0


def test_reports(crank):
    m = crank(copies=2)
    assert "redundant at the reference: C.x again" in m.report()
    assert "1 degree of freedom" in repr(m)
    assert "<table>" in m._repr_html_()


def test_the_layout_of_the_metadata_is_checked(models):
    with pytest.raises(UsageError, match="layout 7"):
        NumpyCore(models.crank_metadata(abi=7), {})


def test_importing_the_runtime_costs_numpy_alone():
    code = (
        "import numpy, sys, time; before = set(sys.modules); start = time.perf_counter(); import eomgen.runtime; "
        "seconds = time.perf_counter() - start; new = {name.partition('.')[0] for name in set(sys.modules) - before}; "
        "assert not new & {'scipy', 'sympy', 'pandas', 'matplotlib', 'rich'}, new; print(seconds)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)  # once, so that the byte code is there
    result = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert float(result.stdout) < 0.2


@pytest.mark.parametrize("out", [[0.0] * 6, np.zeros(6, np.float32), np.zeros(5)], ids=["list", "single", "short"])
def test_results_go_into_fitting_arrays_only(crank, pendulum, out):
    m = crank()
    x = m.x0()
    with pytest.raises(UsageError, match="out"):
        m.rhs(0.0, x, out=out)
    with pytest.raises(UsageError, match="out"):
        m.constraints(x[:3], out=out)
    with pytest.raises(UsageError, match="out"):
        pendulum.constraints([0.1], out=out)
    with pytest.raises(UsageError, match="out"):
        pendulum.project(pendulum.x0(), out=out)


def test_coordinates_called_like_arguments_go_in_a_dict(pendulum, models):
    metadata = json.loads(pendulum.core.metadata)
    metadata |= {"q_names": ["u"], "v_names": ["u_dot"], "x_names": ["u", "u_dot"], "initial": {}}
    m = Module(NumpyCore(metadata, pendulum.core.blocks))
    with pytest.raises(UsageError, match="give the coordinate 'u' in a dict: {'u': ...}"):
        m.x0(u=0.4)
    assert m.x0({"u": 0.4})[0] == 0.4


def test_calls_are_methods_with_the_whole_story() -> None:
    """Every name of the table is a function that takes the model by place alone and explains its arguments."""
    for name in CALLS:
        function = getattr(Module, name)
        first, *others = inspect.signature(function).parameters.values()
        assert (function.__name__, first.kind) == (name, first.POSITIONAL_ONLY), name
        text = inspect.getdoc(function) or ""
        assert "module :" not in text, name
        for other in others:
            if other.kind is not other.VAR_KEYWORD and name not in ("undetermined_reactions", "driving_forces"):
                assert re.search(rf"\b{other.name}\b", text), f"{name}: {other.name}"
    assert vars(Module)["step"].function is Module.step


def test_type_checkers_read_the_same_table() -> None:
    """What stands under TYPE_CHECKING in the class and its imports are the calls, from the same files."""
    tree = ast.parse(inspect.getsource(sys.modules[Module.__module__]))
    homes = {
        alias.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == f"_{alias.name}"
    }
    (own,) = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "Module"]
    (block,) = [node for node in own.body if isinstance(node, ast.If)]
    methods = [f"{name} = _{name}" for name in CALLS]
    forms = [f"{name}: {name.capitalize()}" for name in FORMS]
    solvers = [f"{name}: type[Any]" for name in ("DOP853", "RK45", "RK23", "Radau", "Taylor")]
    assert [ast.unparse(line) for line in block.body] == [*methods, "jacobian: JacobianCall", *forms, *solvers]
    assert homes == CALLS
