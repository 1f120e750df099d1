"""The solvers of equations of motion in C, the same for all models."""
