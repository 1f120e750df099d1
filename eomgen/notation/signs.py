"""Notation, tables: letters and signs of LaTeX and their characters, accents, styles."""

# ruff: noqa: RUF001 - characters that look like others are what this file is about

from __future__ import annotations

#: In Unicode's order; a dash stands for omicron, and for the sigma at the end of words.
_SMALL = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi - pi rho - sigma tau upsilon phi chi psi "
    "omega"
)
_LARGE = {"Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π", "Sigma": "Σ", "Upsilon": "Υ"}
_VARIANTS = {"varepsilon": "ϵ", "vartheta": "ϑ", "varpi": "ϖ", "varrho": "ϱ", "varsigma": "ς", "varphi": "ϕ"}

#: Greek letters by their names, which are LaTeX's commands too.
GREEK = {word: chr(ord("α") + k) for k, word in enumerate(_SMALL.split()) if word != "-"}
GREEK |= {**_LARGE, "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω", **_VARIANTS}

#: Other letters, which may bear dots.
LETTERS = {**GREEK, "ell": "ℓ", "hbar": "ħ", "imath": "ı", "jmath": "ȷ", "nabla": "∇", "partial": "∂"}

#: Signs without a command's argument.
SIGNS = {
    "prime": "′", "star": "⋆", "ast": "∗", "dagger": "†", "circ": "∘", "bullet": "•", "infty": "∞", "parallel": "∥",
    "perp": "⊥", "cdot": "·", "times": "×", "pm": "±", "mp": "∓", "to": "→", "rightarrow": "→", "leftarrow": "←",
    "uparrow": "↑", "downarrow": "↓", "ldots": "…", "dots": "…", "_": "_", "%": "%",
}  # fmt: skip

PRIME = SIGNS["prime"]
RAISED = tuple(SIGNS[word] for word in ("prime", "star", "ast", "dagger", "circ"))  #: which stand high by themselves
#: Spaces; those of no width at last.
SPACES = {" ": " ", ",": " ", ":": " ", ";": " ", "quad": " ", "!": ""}

#: Accents and the combining character of each; of ``vec`` none that terminals show.
ACCENTS = {
    "dot": "\u0307", "ddot": "\u0308", "dddot": "\u20db", "hat": "\u0302", "widehat": "\u0302", "bar": "\u0304",
    "overline": "\u0305", "tilde": "\u0303", "widetilde": "\u0303", "vec": "\u20d7", "breve": "\u0306",
    "check": "\u030c", "acute": "\u0301", "grave": "\u0300", "mathring": "\u030a", "underline": "\u0332",
}  # fmt: skip
#: Accents -> the sign over a letter in MathML.
OVER = {
    "dot": "˙", "ddot": "¨", "dddot": "˙˙˙", "hat": "^", "widehat": "^", "bar": "¯", "overline": "¯", "tilde": "~",
    "widetilde": "~", "vec": "→", "breve": "˘", "check": "ˇ", "acute": "´", "grave": "`", "mathring": "˚",
    "underline": "_",
}  # fmt: skip
#: Derivatives by the time, by their order.
DOTS = ("", "dot", "ddot", "dddot")

#: Commands that set the letters of their argument in a style.
STYLES = {
    "mathrm": "rm", "mathbf": "bf", "mathit": "it", "mathsf": "sf", "mathtt": "tt", "mathcal": "cal", "mathbb": "bb",
    "mathfrak": "frak", "mathscr": "scr", "boldsymbol": "bf", "operatorname": "rm", "text": "text", "textrm": "text",
    "textbf": "textbf", "textit": "textit", "mathnormal": "it",
}  # fmt: skip
#: Commands that set what comes after them in the group in a style.
SWITCHES = ("rm", "bf", "it", "sf", "tt", "cal")

#: Characters that stand for themselves.
PLAIN = frozenset("+-=*/().,:;|![]?")
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SUPERSCRIPTS = str.maketrans("0123456789+-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻")
