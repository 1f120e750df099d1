"""Measured motions -> parameters of a module."""
