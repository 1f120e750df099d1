"""Faults in what writes a user's texts, and in what sources depend on."""

from __future__ import annotations

from mutations.fault import Fault

FAULTS = (
    Fault(
        "text-comment-end", "comment_text",
        '_PAIRS.sub(" ", shown)',
        "shown",
        "a text with */ or ??/ ends a comment of C",
        "tests/attack/test_injected_texts.py::test_c_holds_the_texts_as_comments_and_data_only[c]",
    ),
    Fault(
        "text-comment-joined", "_OUTSIDE",
        r'r"[^ -\[\]-~]"',
        'r"[^ -~]"',
        "a backslash in a comment joins lines",
        "tests/attack/test_injected_texts.py::test_c_holds_the_texts_as_comments_and_data_only[c]",
    ),
    Fault(
        "text-comment-raw", "C",
        "{{ row|comment }}",
        "{{ row }}",
        "units and docs of parameters stand in the header as they are",
        "tests/attack/test_injected_texts.py::test_c_holds_the_texts_as_comments_and_data_only[c]",
    ),
    Fault(
        "text-docstring", "_ESCAPED",
        r'r"[^ !#-\[\]-~]"',
        r'r"[^ -\[\]-~]"',
        "three quotes in a text end a docstring, one a TOML string",
        "tests/attack/test_injected_texts.py::test_python_packages_hold_the_texts_as_strings_only",
    ),
    Fault(
        "text-terminal", "visible",
        r'"".join(c if c.isprintable() or (lines and c in "\n\t") else repr(c)[1:-1] for c in text)',
        "text",
        "escape sequences in a text reach the terminal",
        "tests/attack/test_injected_texts.py::test_nothing_of_a_text_drives_the_terminal",
    ),
    Fault(
        "wheel-native", "require_wheel",
        "_refuse_native()",
        "None",
        "a wheel for others is compiled for the processor of this computer",
        "tests/code/test_packages.py::test_flags_for_this_processor_alone_are_refused",
    ),
    Fault(
        "recorded-zero", "_judged",
        "SPREAD_OF_ROUNDING * spread + BUILDS * size + ZERO",
        "SPREAD_OF_ROUNDING * spread + BUILDS * size",
        "the tests of a package ask for the rounding of another build where a result is zero",
        "tests/shown/test_verify.py::test_c_is_within_the_recorded_bounds[slider_crank]",
    ),
    Fault(
        "recorded-inputs", "_record",
        '{"p": case.p, "u": case.u}',
        '{"p": module.p, "u": case.u}',
        "packages are tested at the declared parameters alone",
        "tests/shown/test_verify.py::test_recorded_figures_are_those_of_the_pendulum",
    ),
    Fault(
        "fmu-tolerance", "emit_fmu",
        'settings["rtol"]',
        'settings["atol"]',
        "a functional mock-up unit states the absolute tolerance in place of the relative one",
        "tests/code/test_fmu.py::test_names_units_and_start_values",
    ),
    Fault(
        "exit-missing", "exit_code",
        "ToolchainError | MissingDependencyError",
        "ToolchainError",
        "a library that is missing ends the command as a faulty model does",
        "tests/shown/test_command_line.py::test_a_library_that_is_missing_ends_as_a_compiler_that_is_missing",
    ),
)  # fmt: skip
