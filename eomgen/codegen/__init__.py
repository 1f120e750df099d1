"""Equations -> functions to generate -> the text of generated files, for every target."""
