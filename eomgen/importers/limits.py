"""Limits: what a robot file may be made of, and what reading it may cost."""

from __future__ import annotations

# -- XML -------------------------------------------------------------------------------------------------------------
SIZE = 20_000_000  #: bytes of one XML file
ELEMENTS = 100_000  #: of one file
DEPTH = 200  #: nesting
LONGEST = 200_000  #: characters of one attribute

# -- numbers ---------------------------------------------------------------------------------------------------------
#: Magnitude of a number of a robot file, limits of joints aside: the products of three that a reader forms, such as
#: mass times distance squared, stay within double precision.
LARGEST = 1e100
#: Least impedance of a constraint in MuJoCo, and what the greatest is less than 1.
IMPEDANCE = 1e-4

# -- what a robot becomes ---------------------------------------------------------------------------------------------
FREEDOMS = 800  #: coordinates of its joints; checking a model of so many takes 10 s
TIES = 800  #: joints that close loops, couplings, drives
LAWS = 10_000_000  #: characters of the laws of all drives, which tendons of many joints multiply


# -- MuJoCo's compiler, in a process of its own ------------------------------------------------------------------------
SECONDS = 10  #: of processor time; the largest models that packages ship (fruit fly, dog) take 2
WAIT = 16  #: seconds until it is ended whatever it does
MEMORY = 2_000_000_000  #: bytes of address space; those models take 0.4e9
