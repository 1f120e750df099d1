"""Printing, writers: a formula -> its text in one form; a class says how each part is written in that form."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ..base.notation import Notation
from . import formula_tree as tree


class FormulaWriter(ABC):
    """Writes the parts of a formula, whatever they stand in.

    Parameters
    ----------
    names : Notation
        How names are printed.
    """

    minus, plus = " - ", " + "  #: between terms
    negative = "-"  #: before a first term that is subtracted

    def __init__(self, names: Notation) -> None:
        self.names = names

    def write(self, formula: tree.Formula) -> str:
        """The text of a formula."""
        match formula:
            case tree.NumberPart():
                return self.number(formula)
            case tree.Name():
                return self.name(formula.name)
            case tree.Letter():
                return self.letter(formula.latex)
            case tree.Words():
                return self.words(formula)
            case tree.SumOf():
                return self.sum(formula)
            case tree.Product():
                return self.product(formula)
            case tree.Quotient():
                return self.quotient(formula)
            case tree.Power():
                return self.power(formula)
            case tree.CallOf():
                return self.call(formula)
            case tree.Relation():
                return self.relation(formula)
            case tree.CasesOf():
                return self.cases(formula)
            case tree.MatrixOf():
                return self.matrix(formula)

    def sum(self, formula: tree.SumOf) -> str:
        """Terms with their signs."""
        found = ""
        for k, (subtracted, term) in enumerate(formula.terms):
            between = self.minus if subtracted else self.plus
            found += (self.negative * subtracted if k == 0 else between) + self.factor(term)
        return found

    def factor(self, formula: tree.Formula) -> str:
        """A formula in a place where a sum needs parentheses."""
        shown = self.write(formula)
        return self.grouped(shown) if tree.is_group(formula) else shown

    @abstractmethod
    def grouped(self, inside: str) -> str:
        """In parentheses."""

    @abstractmethod
    def number(self, part: tree.NumberPart) -> str:
        """A number."""

    @abstractmethod
    def name(self, name: str) -> str:
        """A name."""

    @abstractmethod
    def letter(self, latex: str) -> str:
        """A symbol that is given in LaTeX."""

    @abstractmethod
    def words(self, part: tree.Words) -> str:
        """What no other part is for."""

    @abstractmethod
    def product(self, formula: tree.Product) -> str:
        """Factors side by side."""

    @abstractmethod
    def quotient(self, formula: tree.Quotient) -> str:
        """A fraction."""

    @abstractmethod
    def power(self, formula: tree.Power) -> str:
        """A power, the exponent of a function after its name."""

    @abstractmethod
    def call(self, formula: tree.CallOf) -> str:
        """A function of arguments."""

    @abstractmethod
    def relation(self, formula: tree.Relation) -> str:
        """Sides with a sign between them."""

    @abstractmethod
    def cases(self, formula: tree.CasesOf) -> str:
        """Values and their conditions."""

    @abstractmethod
    def matrix(self, formula: tree.MatrixOf) -> str:
        """Rows of entries."""
