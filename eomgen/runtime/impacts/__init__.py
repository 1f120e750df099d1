"""Impacts at events, and runs with rigid contacts; packages carry this folder where they can happen."""
