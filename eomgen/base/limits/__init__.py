"""Below which number something counts as zero, closed, dependent, the same: each once, with its derivation.

``numbers``: what double precision leaves, what a user wrote, sizes of files, mass matrices and tensors;
``constraints``: closed, dependent, passed, all from one error model; ``crossings`` of change points; ``systems``:
linear systems of a method; ``contacts``: laws, and rigid ones; ``impacts``; ``runs``: integrators, events, inputs;
``analyses``: balance and stability, motions without forces, identification, verification; ``pictures``.  Templates in C
take theirs from here too (:mod:`eomgen.base.limits.in_c`).
"""
