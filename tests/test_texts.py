"""The one place that writes free text into other languages: proofs by every character, and by every short string."""

from __future__ import annotations

import ast
import html.parser
import itertools
import re
import subprocess
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from eomgen import texts

EVERY = [chr(k) for k in range(0x110000) if not 0xD800 <= k <= 0xDFFF]
LONE = [chr(k) for k in range(0xD800, 0xE000)]
ALL = "".join([*EVERY[:0xD800], *LONE, *EVERY[0xD800:]])
#: What takes part in ends of comments, joined lines, trigraphs and escapes, one of each kind, and something harmless.
DANGEROUS = '*/\\?"\n\r \ta'
SHORT = ["".join(part) for n in range(1, 5) for part in itertools.product(DANGEROUS, repeat=n)]
ASCII_LINE = re.compile(r"[ -~]*\Z")


def as_c_reads(text: str) -> str:
    """Phases 1 and 2 of C: trigraphs, then joined lines, as gcc takes them too (blanks before the end of the line)."""
    for pair in ("=#", "/\\", "'^", "([", ")]", "!|", "<{", ">}", "-~"):
        text = text.replace(f"??{pair[0]}", pair[1])
    return re.sub(r"\\[ \t\v\f]*(\r\n|\n|\r)", "", text)


def test_no_character_reaches_a_comment_but_printable_ascii() -> None:
    # Phases 1 and 2 of C change a text only by ??x or a backslash, and a comment ends only by */: none is ever there.
    for c in EVERY + LONE:
        assert ASCII_LINE.match(texts.comment_text(c))
        assert "\\" not in texts.comment_text(c)
    assert ASCII_LINE.match(texts.comment_text(ALL))
    for text in SHORT:
        for shown in (texts.comment_text(text), texts.comment_lines(text, "   ")):
            assert "\\" not in shown
            assert not any(pair in shown for pair in ("*/", "/*", "??"))
            assert as_c_reads(shown) == shown
    assert len(SHORT) == sum(10**n for n in range(1, 5))


def test_a_comment_says_what_can_be_said() -> None:
    assert texts.comment_text("N*m, kg*m**2/s; 10 % of [a], \"b\" 'c' {d} #1") == (
        "N*m, kg*m**2/s; 10 % of [a], \"b\" 'c' {d} #1"
    )
    assert texts.comment_text("µm\\") == "<U+00B5>m<U+005C>"
    assert texts.comment_text("a */ b /* c ??/ /*/") == "a * / b / * c ? ?/ / * /"


def test_a_comment_of_many_lines_keeps_its_words() -> None:
    text = "word *?? */ " * 500
    lines = texts.comment_lines(text, "   ").split("\n   ")
    assert all(len(line) <= texts.WIDTH for line in lines)
    assert " ".join(lines).split() == texts.comment_text(text).split()


@pytest.mark.parametrize("standard", ["-std=c99", "-std=gnu17"])
def test_a_compiler_sees_nothing_of_a_comment(standard: str, tmp_path: Path) -> None:
    parts = [texts.comment_text(text) for text in (*SHORT, ALL)]
    lines = "\n".join(f"/* {part} */" for part in parts)
    file = tmp_path / "comments.c"
    file.write_text(f"{lines}\n/* {texts.comment_lines(' '.join(SHORT), '   ')} */\nint done;\n", encoding="ascii")
    command = [
        "gcc",
        standard,
        "-trigraphs",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wcomment",
        "-Werror",
        "-E",
        "-P",
        str(file),
    ]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr[:500]
    assert found.stdout.split() == ["int", "done;"]


def test_a_docstring_has_the_value_of_the_text() -> None:
    for text in (ALL, "".join(SHORT), '"""', "\\", '\\"', "\\N{BULLET}", "\r\n", "a\n b\n"):
        shown = texts.docstring_text(text)
        assert shown.isascii()
        assert ASCII_LINE.match(shown.replace("\n", ""))
        assert ast.literal_eval(f'"""{shown}"""') == text
    for text in SHORT:  # in one expression: a thousand evaluations would take their time
        assert '"""' not in texts.docstring_text(text)
    assert ast.literal_eval("[" + ",".join(f'"""{texts.docstring_text(text)}"""' for text in SHORT) + "]") == SHORT


def test_toml_and_yaml_read_back_the_text() -> None:
    text = "".join(EVERY)
    assert tomllib.loads(f"x = {texts.toml_text(text)}")["x"] == text
    lines = "\n".join(f"{k} = {texts.toml_text(text)}" for k, text in enumerate(SHORT))
    assert list(tomllib.loads(lines).values()) == SHORT
    reader = YAML(typ="safe", pure=True)
    every = "".join(EVERY[:0x3000]) + "".join(EVERY[0xD700:0xF900]) + "".join(EVERY[::997])
    assert reader.load(f"x: {texts.yaml_quoted(every)}\n")["x"] == every
    chosen = SHORT[::37]
    assert reader.load("\n".join(f"- {texts.yaml_quoted(text)}" for text in chosen)) == chosen


def test_only_what_prints_reaches_a_terminal() -> None:
    for lines in (True, False):
        shown = texts.visible(ALL, lines)
        assert all(c.isprintable() or (lines and c in "\n\t") for c in shown)
    assert texts.visible("µm ü 🙂 ✓") == "µm ü 🙂 ✓"
    assert texts.visible("a\x1b[2J\u202e\x85\n", lines=False) == "a\\x1b[2J\\u202e\\x85\\n"
    assert texts.summary_text(ALL).isprintable()
    assert len(texts.summary_text("x" * 9000)) == 500


class Events(html.parser.HTMLParser):
    """Tags and words of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.words = ""

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.words += data


def test_html_shows_the_text_and_no_tag_of_it() -> None:
    some = "".join([*EVERY[:0x3000], *LONE[::97], *EVERY[0x3000::97]])
    for text in (some, "<script>alert(1)</script>", "]]>", "<!--", "--><b onload='x'>", "&lt;"):
        page = Events()
        page.feed(f"<p title='{texts.html_text(text)}'>{texts.html_text(text)}</p>")
        page.close()
        assert page.tags == ["p"]
        assert page.words == texts.visible(text)
    table = ET.fromstring(f"<div>{texts.html_table(ALL, [(ALL, ALL)], ALL)}</div>")
    assert {part.tag for part in table.iter()} == {"div", "b", "p", "table", "tr", "th", "td"}


def test_markdown_shows_no_markup_of_the_text() -> None:
    shown = texts.markdown_text("# head\n\n1. *x* <b>&amp;</b> `code` $a_1$ [l](u) ~~ | \\\n\n    indented\n---\n```")
    assert not re.search(r"(?<!\\)[*_`\[\]<>$|~#]", re.sub(r"&#\d+;", "", shown))
    assert not re.search(r"^(    |\d+[.)] |[-+=#>])", shown, re.MULTILINE)
    assert texts.markdown_text(ALL).replace("\n", "").isprintable()
    assert texts.markdown_code("a`b``c\nd") == "`a'b''c d`"


def test_surrogates() -> None:
    assert texts.join_surrogates("a\ud83d\ude00b") == "a\N{GRINNING FACE}b"
    assert texts.lone_surrogate("a\ud83d\ude00b") == ""
    assert texts.lone_surrogate("a\ude00\ud83db") == "U+DE00"
    assert all(texts.lone_surrogate(c) == f"U+{ord(c):04X}" for c in LONE)
    assert texts.lone_surrogate("".join(EVERY)) == ""
