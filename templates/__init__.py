"""Jinja2 templates of every target, one folder each; shipped as the package ``eomgen.templates``."""
