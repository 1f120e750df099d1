"""Stages program and code: equations -> functions to generate -> the text of generated files, for every target."""
