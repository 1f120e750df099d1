"""Below which number something counts as zero, closed, dependent, the same: each once, with its derivation.

One file per kind.  ``rounding``: what double precision leaves; ``constraints``: closed, dependent, passed, all from one
error model; ``inertia``: positive, physical; ``systems``: linear systems of a method; ``motions``: motions along
constraints without forces; ``statics``: balance and stability; ``impacts``; ``runs``: integrators, events, inputs;
``descriptions``: what a user wrote; ``files``: sizes of robot files.  Templates in C take theirs from here too
(:mod:`eomgen.limits.in_c`).
"""
