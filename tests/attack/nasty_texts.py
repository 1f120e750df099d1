"""Texts that end, join, escape or drive something in some language: each must stay a text wherever it is written."""

from __future__ import annotations

C = '\n#error "a text of the model is C"\n'
PYTHON = "__import__('os').abort()"

#: What begins and ends comments, joins lines or hides characters, in C, Cython, Python, make, TOML, YAML.
CLOSERS = {
    "comment end": f"*/{C}/*",
    "joined end": f"*\\\n/{C}/*",
    "joined end, CRLF": f"*\\\r\n/{C}/*",
    "joined end, CR": f"*\\\r/{C}/*",
    "joined end, blank": f"*\\ \n/{C}/*",
    "joined end, tab": f"*\\\t\n/{C}/*",
    "joined end, form feed": f"*\\\f\n/{C}/*",
    "joined end, vertical tab": f"*\\\v\n/{C}/*",
    "joined twice": f"*\\\n\\\n/{C}/*",
    "joined end, LINE SEPARATOR": f"*\\\u2028/{C}/*",
    "joined end, NEXT LINE": f"*\\\x85/{C}/*",
    "trigraph end": f"*??/\n/{C}/*",
    "trigraph end, CRLF": f"*??/\r\n/{C}/*",
    "trigraph end, blank": f"*??/ \n/{C}/*",
    "trigraphs": "??=error ??( ??) ??< ??> ??! ??' ??- ??/",
    "four question marks": "????/",
    "digraphs": "%:error <: :> <% %> %:%:",
    "ends apart": "* /*/ **/ /**/ *//*",
    "star at the end": "doc *",
    "slash at the start": "/ doc",
    "backslash at the end": "doc\\",
    "many backslashes": "\\" * 7,
    "line comment": "// doc \\",
    "beginning of a comment": "/* never ended",
    "preprocessor": '\n#include "/etc/passwd"\n#define double int\n',
    "pragma": '_Pragma("GCC error \\"pragma\\"")',
    "universal name": "\\u002a\\u002f \\U0000002a \\N{SOLIDUS} \\x2a\\57",
    "string end": '"; system("true"); char *x = "',
    "raw string": ')EOM"; R"(',
    "Python end": f'"""\n{PYTHON}\n"""',
    "Python end, single": f"'''\n{PYTHON}\n'''",
    "Python end, escaped": f'\\"""\n{PYTHON}\n\\"""',
    "Python line": f"\n{PYTHON}\n",
    "Python, form feed": f"\f{PYTHON}",
    "coding": "-*- coding: utf-7 -*- +ACIAIgAi-",
    "quotes": "\"'`\u2018\u201c\u00ab",
    "one quote": '"',
    "two quotes": '""',
    "hash": "# not a comment",
    "make": "$(shell touch made)\n\ttouch made\n",
    "TOML end": '"\n[build-system]\nrequires = ["evil"]\n',
    "TOML end, many lines": '"""\n[project.scripts]\nx = "os:abort"\n',
    "YAML": "x: !!python/object/apply:os.abort []\n--- &a *a %TAG",
    "YAML end": '", bodies: {}, "',
    "YAML, plain": "- ? : | > {[,]}",
    "INI": "%(here)s\n[options.entry_points]\n",
}
#: What a page, a picture, a terminal, a shell or a template would take for its own.
PAGES = {
    "HTML": "<script>alert(1)</script>",
    "HTML attribute": "\"'><img src=x onerror=alert(1)>",
    "HTML end": "</td></table></pre><!-- ",
    "HTML comment end": "--><svg onload=alert(1)>",
    "XML": "]]><!DOCTYPE x [<!ENTITY e SYSTEM 'file:///etc/passwd'>]>&e;",
    "XML instruction": "<?xml version='1.0'?><?php x ?>",
    "entities": "&lt;b&gt; &#0; &#x202e; &amp",
    "Markdown": "# head\n\n1. a\n- b\n> c\n\n    code\n\n```\n`` ` ``` [l](data:x) ![i](x) **b** _e_\n===\n---",
    "LaTeX": "$\\input{/etc/passwd}$ \\write18{true} \\end{document} %",
    "dollar": "$",
    "two dollars": "$\\frac{$",
    "dollars": "$$x$$ \\$",
    "template": "{{ 7*7 }} {% for x in ().__class__ %} {# #}",
    "template end": "{% endraw %}{{ self }}{% raw %}",
    "format": "%s %n %(name)s {0} {name!r} {0.__class__} ${HOME} $HOME",
    "shell": "; touch made; `touch made` $(touch made) | touch made & touch made",
    "path": "../../../../etc/passwd",
    "path, Windows": "..\\..\\out\\x C:\\nul \\\\server\\share",
    "colours": "\x1b[2J\x1b[31mred\x1b[0m\x1b]0;title\x07\x1b]8;;http://x\x07link\x1b]8;;\x07",
    "one-byte escapes": "\x9b2J\x9d0;title\x9c\x90q\x9c",
    "bell and backspace": "\a\b\b\b\x7f\r overwritten",
}
#: What is no letter: control characters, separators, marks of direction, halves of characters' pairs.
CHARACTERS = {
    "NUL": "a\0b",
    "DEL": "a\x7fb",
    "C0": "".join(map(chr, range(1, 32))),
    "C1": "".join(map(chr, range(0x7F, 0xA0))),
    "separators": "a\u2028b\u2029c\x85d\x1ce\x1df\x1eg",
    "byte order mark": "\ufeffdoc\ufeff",
    "directions": "\u202e/* \u2066 admin \u2069 \u202c \u200f \u061c */",
    "invisible": "a\u200bb\u200cc\u200dd\u2060e\u00adf\u3164g",
    "blanks": "\u00a0\u2003\u3000\t  ",
    "blank": " ",
    "newlines": "\n\n\r\n\r",
    "non-characters": "\ufffe\uffff\U0001ffff\U0010ffff",
    "private": "\ue000\U000f0000",
    "combining": "e" + "\u0301" * 40,
    "accents": "Länge µm ° Ω ñ \u00df \u0130 \u212a",
    "wide": "長さ 길이 \N{GRINNING FACE}\N{MAN}\u200d\N{WOMAN}",
    "right to left": "\u05d0\u05d1 \u0627\u0628",
    "tags": "\U000e0041\U000e0042\U000e007f",
    "long": "long " * 4000,
    "long word": "w" * 20_000,
    "long line of ends": "*/" * 5000,
}  # fmt: skip
NASTY = {**CLOSERS, **PAGES, **CHARACTERS}
#: No file can hold these; they are refused by name.
LONE = {"first half": "a\ud83db", "second half": "\ude00", "halves in the wrong order": "\ude00\ud83d"}
#: As JSON writes a character beyond U+FFFF.
PAIR = "\ud83d\ude00"
