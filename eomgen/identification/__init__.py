"""Stage identification: measured motions -> parameters of a module."""
