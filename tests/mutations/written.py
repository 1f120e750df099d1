"""Faults in what writes a user's texts, and in what sources depend on."""

from __future__ import annotations

from mutations.fault import Fault

FAULTS = (
    Fault(
        "text-comment-end", "eomgen/texts.py",
        'return _PAIRS.sub(" ", shown)',
        "return shown",
        "a text with */ or ??/ ends a comment of C",
        ("tests/test_texts.py::test_no_character_reaches_a_comment_but_printable_ascii",),
    ),
    Fault(
        "text-comment-joined", "eomgen/texts.py",
        r'_OUTSIDE = re.compile(r"[^ -\[\]-~]")',
        r'_OUTSIDE = re.compile(r"[^ -~]")',
        "a backslash in a comment joins lines",
        ("tests/test_texts.py::test_no_character_reaches_a_comment_but_printable_ascii",),
    ),
    Fault(
        "text-comment-raw", "templates/c/model.h.j2",
        "{{ row|comment }}",
        "{{ row }}",
        "units and docs of parameters stand in the header as they are",
        ("tests/hostile/test_injected_texts.py::test_c_holds_the_text_as_comment_and_data_only",),
    ),
    Fault(
        "text-docstring", "eomgen/texts.py",
        """_ESCAPED = re.compile(r"[^ !#-\\[\\]-~]")""",
        """_ESCAPED = re.compile(r"[^ -\\[\\]-~]")""",
        "three quotes in a text end a docstring, one a TOML string",
        ("tests/test_texts.py::test_a_docstring_has_the_value_of_the_text",),
    ),
    Fault(
        "text-terminal", "eomgen/texts.py",
        'return "".join(c if c.isprintable() or (lines and c in "\\n\\t") else repr(c)[1:-1] for c in text)',
        "return text",
        "escape sequences in a text reach the terminal",
        ("tests/test_texts.py::test_only_what_prints_reaches_a_terminal",),
    ),
    Fault(
        "sources-looked-at", "eomgen/pipeline.py",
        "kinematics, mobility, tree = equations.fresh()",
        "kinematics, mobility, tree = equations.kinematics, equations.mobility, equations.tree",
        "sources depend on what was read before",
        ("tests/acceptance/test_canonical_sources.py::test_reading_changes_neither_sources_nor_key",),
    ),
)  # fmt: skip
