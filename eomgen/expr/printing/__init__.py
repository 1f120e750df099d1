"""SymPy expressions -> formulas in the order in which textbooks print them: LaTeX, text, MathML."""
