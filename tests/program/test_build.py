"""What build_program decides: blocks and drivers, ports, hoisting, counts, refusals."""

import json
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, replace

import pytest

from benchmarks.large_loops import closed_chain
from eomgen.errors import UsageError
from eomgen.graph.count import count
from eomgen.graph.substitute import symbols_of
from eomgen.program import KERNELS, Limits, build_program
from eomgen.program.hoist import count_apart, hoist

DERIVATIVES = ["input_jacobian", "parameter_jacobian", "dae_jacobian"]


def names(program):
    return [b.name for b in program.blocks], [d.name for d in program.drivers]


def test_a_small_tree_has_its_right_hand_side_on_the_graph(systems):
    blocks, drivers = names(systems.chain(3).program())
    assert drivers == ["dae_jacobian"]
    assert {"rhs", "outputs", "project", "kinematics", "embedded_mass_matrix", "jacobian"} < set(blocks)
    assert {"input_jacobian", "parameter_jacobian"} < set(blocks)
    assert not {"terms", "position", "rate", "accelerated_outputs", "residual_jacobian"} & set(blocks)
    _, drivers = names(systems.chain(3).program(limits=Limits(jacobian_nodes=10)))
    assert drivers == ["jacobian", *DERIVATIVES]


def test_a_large_tree_and_a_loop_have_drivers(systems):
    blocks, drivers = names(systems.chain(3).program(limits=Limits(unrolled=2)))
    assert drivers == ["rhs", "jacobian", "outputs", *DERIVATIVES]
    blocks, drivers = names(systems.slider_crank().program())
    assert drivers == ["rhs", "jacobian", "embedded_mass_matrix", "project", "outputs", "kinematics", *DERIVATIVES]
    assert {"terms", "position", "rate", "residual_jacobian", "accelerated_outputs", "scales"} < set(blocks)
    blocks, _ = names(systems.slider_crank().program(limits=Limits(jacobian_nodes=10)))
    assert "residual_tangent" in blocks
    assert "residual_jacobian" not in blocks


def test_derivatives_tell_which_entries_vanish(systems):
    program = systems.chain(3).program()
    n, sparsity = 3, program.metadata["sparsity"]
    assert sparsity["jacobian"][:n] == [n, 2 * n + n + 1, 4 * n + n + 2]  # q' = v
    outputs = {b.name: b.outputs for b in program.blocks}
    for name, places in sparsity.items():
        assert places == [k for k, x in enumerate(outputs[name]) if not x.is_zero]
    assert len(sparsity["mass_matrix"]) == n * n


def test_the_kernels_are_those_of_the_table_with_their_shapes(systems):
    for system in (systems.chain(2), systems.slider_crank(copies=2)):
        program = system.program()
        optional = ("events", "resets", "held_errors")
        empty = [k.name for k in KERNELS if (k.late or k.name in optional) and 0 in k.shape(program.sizes)]
        expected = [k.name for k in KERNELS if k.name not in (*empty, "coordinate_slopes", "meeting_time")]
        assert [k.name for k in program.kernels] == expected
        n, m = system.n, system.terms.n_c
        shapes = program.metadata["kernels"]
        assert shapes["jacobian"] == [2 * n, 2 * n]
        assert shapes["constraint_jacobian"] == [m, n]
        assert shapes["poses"] == [program.sizes.n_bodies, 4, 4]
        for kernel in program.kernels:
            product = 1
            for size in shapes[kernel.name]:
                product *= size
            assert kernel.n_out == product
        assert program.metadata["n_x"] == 2 * n
        assert program.metadata["n_c"] == m
        json.dumps(program.metadata, allow_nan=False)


def test_layouts_of_the_inner_blocks(systems):
    system = systems.slider_crank(copies=2)
    blocks = {b.name: b for b in system.program().blocks}
    n, m, terms = 3, 4, system.terms
    assert blocks["terms"].inputs == (*terms.q, *terms.v)
    assert blocks["terms"].n_out == n * (n + 1) // 2 + n + m * n + m
    assert blocks["terms"].outputs[1] == terms.mass_matrix[1][0]
    assert blocks["terms"].outputs[6:9] == terms.bias
    assert blocks["position"].outputs[:m] == terms.constraints
    assert blocks["residual_jacobian"].inputs == (*terms.q, *terms.v, *terms.a, *terms.multipliers)
    assert blocks["residual_jacobian"].n_out == 2 * n * n + 3 * m * n
    assert not any(blocks[name].public for name in ("terms", "position", "rate", "residual_jacobian"))


def test_a_kernel_that_repeats_another_is_written_once_unless_drivers_call_it(systems):
    assert systems.chain(3).program().twins["embedded_mass_matrix"] == "mass_matrix"
    assert "embedded_mass_matrix" not in systems.chain(3, preferred=(2, 0, 1)).program().twins
    program = systems.slider_crank().program()  # C_t is zero, as other results of two entries may be
    assert not {name for d in program.drivers for name in d.blocks} & set(program.twins)


def test_only_what_is_asked_for_is_built(systems):
    program = systems.slider_crank().program(kernels=["energy"])
    assert names(program) == (["energy"], [])
    program = systems.slider_crank().program(kernels=["project"])
    assert names(program) == (["scales", "position", "rate"], ["project"])
    assert list(program.metadata["kernels"]) == ["project", "scales"]
    with pytest.raises(UsageError, match="did you mean 'jacobian'"):
        systems.chain(1).program(kernels=["jacobain"])


def test_hoisted_values_depend_on_parameters_only_and_are_counted_apart(systems):
    system = systems.chain(3)
    program = system.program()
    assert program.hoisted
    assert all(symbols_of([y]) <= set(system.terms.p) for y in program.hoisted)
    assert all(y.node[0] not in ("sym", "const") for y in program.hoisted)
    operations = program.metadata["operations"]
    assert operations["bias"] == program.counts["bias"].as_dict()
    assert program.counts["bias"].total < count(system.terms.bias).total
    assert program.counts["precompute"].total == count(program.hoisted).total


def test_hoisting_takes_the_largest_values_only(systems):
    g = systems.Graph()
    a, b, x = (g.symbol(s) for s in "abx")
    inner = a * b
    outer = inner + 1.0
    hoisted, parameter_only = hoist(g, [outer * x, a * x], ["a", "b"])
    assert hoisted == (outer,)
    assert parameter_only == {inner.id, outer.id}
    hoisted, _ = hoist(g, [outer * x, inner - x, b / a], ["a", "b"])
    assert set(hoisted) == {inner, outer, b / a}
    assert count_apart([outer * x], parameter_only).total == 1
    assert hoist(g, [x * 2.0], ["a"]) == ((), frozenset())


def test_a_program_cannot_be_changed_and_the_given_metadata_is_not(systems):
    system = systems.chain(1)
    before = dict(system.metadata)
    program = system.program()
    assert system.metadata == before
    with pytest.raises(FrozenInstanceError):
        program.name = "other"


@pytest.mark.parametrize("name", ["two words", "2fast", "größe", "eomgen"])
def test_names_that_no_module_can_have_are_refused(systems, name):
    system = systems.chain(1)
    with pytest.raises(UsageError, match="cannot name"):
        build_program(system.terms, system.metadata | {"name": name})


def test_terms_that_contradict_each_other_are_refused_all_at_once(systems):
    terms = systems.slider_crank().terms
    wrong = replace(terms, bias=terms.bias[:2], parent=(-1, 1, 0), preferred=(7,))
    with pytest.raises(UsageError) as caught:
        build_program(wrong, {"name": "x"})
    for word in ("bias has 2 entries, 3 expected", "parent", "preferred"):
        assert word in str(caught.value)


def test_a_symbol_that_a_function_is_not_given_is_refused(systems):
    terms = systems.chain(1).terms
    stray = replace(terms, potential=terms.potential + terms.graph.symbol("q0_ddot"))
    with pytest.raises(UsageError, match="energy depends on q0_ddot"):
        build_program(stray, {"name": "x"})


def test_importing_the_stage_loads_neither_sympy_nor_templates():
    code = (
        "import sys, eomgen.program, eomgen.emit; print([m for m in ('sympy', 'jinja2', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_what_auto_chose_is_counted_when_read_and_goes_through_pickle() -> None:
    equations = closed_chain(40, True, True).derive()
    again = pickle.loads(pickle.dumps(equations))
    assert equations.choice is not None
    assert again.choice == equations.choice == closed_chain(40, True, True).derive().choice
    assert str(again.choice) == str(equations.choice)
    assert set(again.choice.operations) == {"recursive"}
    assert again.choice.operations["recursive"] > 40 * 100
