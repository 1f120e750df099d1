"""Motions that drivers or a path of coordinates prescribe; packages carry this folder where they can be requested."""
