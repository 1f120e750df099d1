"""Below which number something counts as zero, closed, dependent, the same: each once, with its derivation.

``numbers``: what double precision leaves, what a user wrote, mass matrices and tensors; ``constraints``: closed,
dependent, passed, all from one error model; ``positions``: paths along constraints; ``runs``: integrators, events,
inputs; ``impacts``.  What no run needs stands in ``limits`` of contact, importers, show, analysis and verify, and what
solvers in C need alone in :mod:`eomgen.native.limits`, which gives C all of its limits.
"""
