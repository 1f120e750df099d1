"""No name that a model may have meets a name, a header guard or a file of the generated code itself."""

from __future__ import annotations

import re
from pathlib import Path

import models
import pytest
from hostile.held_texts import described, model_of

import eomgen as eg
from eomgen import pipeline
from eomgen.compilation import compile_c_library
from eomgen.describe.names import fault_of_model_name
from eomgen.describe.yaml_file import describe_yaml
from eomgen.emit import emit_c, emit_package
from eomgen.layer import LAYER, read_layer

WORD = "zzname"


def words(text: str) -> set[str]:
    """Identifiers of C, without those of comments and literals."""
    bare = re.sub(r'/\*.*?\*/|"(\\.|[^"\\\n])*"', " ", text, flags=re.DOTALL)
    return set(re.findall(r"[A-Za-z_]\w*", bare))


@pytest.mark.parametrize("example", ["slider_crank", "spherical_pendulum", "cam_follower"])
def test_no_name_of_a_model_makes_an_identifier_that_is_there(example: str) -> None:
    text = (models.EXAMPLES / f"{example}.yaml").read_text()
    renamed = re.sub(r"^name: .*$", f"name: {WORD}", text, flags=re.MULTILINE)
    model = eg.Model.from_description(describe_yaml(renamed))
    sources = emit_c(pipeline.build(model.derive(), "c"))
    found = {word for file, text in sources.items() if file.endswith((".c", ".h")) for word in words(text)}
    own = {word for word in found if WORD in word.lower()}
    assert len(own) > 20
    layer = "\n".join(text for file, text in read_layer().items() if file.endswith((".c", ".h")))
    linked = set(re.findall(r"^(?!static|typedef|#)\w[\w ]*[ *](\w+)\(", layer, re.MULTILINE))
    assert "eomgen_step" in linked
    for word in own - {WORD}:
        start, _, end = re.split(f"({WORD})", word, maxsplit=1, flags=re.IGNORECASE)
        for other in (found - own) | linked:
            if len(other) > len(start + end) and other.startswith(start) and other.endswith(end):
                name = other[len(start) : len(other) - len(end)].lower()
                assert fault_of_model_name(name), f"a model {name!r} would make {other}"


def test_no_name_of_a_model_makes_a_file_that_is_there() -> None:
    program = pipeline.build(model_of(described("", WORD)).derive(), "cython")
    files = {Path(file).name.lower() for file in (*emit_package(program, "cython"), *LAYER)}
    own = {file for file in files if WORD in file}
    for file in own:
        end = file.removeprefix(WORD)
        for other in files - own:
            if other.endswith(end) and len(other) > len(end):
                name = other.removesuffix(end)
                assert fault_of_model_name(name), f"a model {name!r} would be written over {other}"


@pytest.mark.parametrize("name", ["eomgen", "eomgen_real", "EOMGEN_x", "Python", "python", "structmember", "errors"])
def test_names_of_files_of_every_package_are_refused(name: str) -> None:
    message, remedy = fault_of_model_name(name) or ("", "")
    assert repr(name) in message
    assert "choose another name" in remedy


@pytest.mark.parametrize("name", ["rk4", "real", "series"])
def test_words_of_the_generated_code_may_name_a_model(name: str) -> None:
    sources = emit_c(pipeline.build(model_of(described("", name)).derive(), "c", ["rhs", "energy"]))
    assert compile_c_library(sources, name).path.is_file()
