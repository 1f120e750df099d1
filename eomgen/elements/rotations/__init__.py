"""Rotations: matrices, Euler angles and parameters, Rodrigues parameters, rotation vectors, quaternions, their rates.

Every function takes numbers, SymPy expressions or graph expressions, as sequences, arrays or matrices, and answers
in kind: NumPy arrays, SymPy matrices, or tuples of graph expressions.  A rotation matrix takes body to ground axes;
quaternions and Euler parameters have the scalar first; angles are in radians.

Numbers and graph expressions are right everywhere, at no rotation and half turns too.  SymPy answers with the general
form, as textbooks do: it assumes e0 > 0 and an angle that is not 0, and may give angles a full turn off.

>>> from eomgen import rotations
>>> rotations.euler_angles_from_matrix("xyz", [[0, -1, 0], [1, 0, 0], [0, 0, 1]]).round(6) + 0
array([0.      , 0.      , 1.570796])
"""

from .euler import (
    euler_angles_from_euler_parameters,
    euler_angles_from_matrix,
    euler_parameters_from_euler_angles,
    matrix_from_euler_angles,
)
from .quaternions import (
    axis_angle_from_matrix,
    conjugate_quaternion,
    euler_parameters_from_axis_angle,
    euler_parameters_from_matrix,
    euler_parameters_from_modified_rodrigues,
    euler_parameters_from_rodrigues,
    euler_parameters_from_rotation_vector,
    matrix_from_axis_angle,
    matrix_from_euler_parameters,
    matrix_from_rotation_vector,
    modified_rodrigues_from_euler_parameters,
    multiply_quaternions,
    normalize_quaternion,
    rodrigues_from_euler_parameters,
    rotation_vector_from_euler_parameters,
    rotation_vector_from_matrix,
    turn_vector,
)
from .rates import PARAMETERS, angular_velocity, rate_matrix, velocity_matrix

__all__ = [
    "PARAMETERS",
    "angular_velocity",
    "axis_angle_from_matrix",
    "conjugate_quaternion",
    "euler_angles_from_euler_parameters",
    "euler_angles_from_matrix",
    "euler_parameters_from_axis_angle",
    "euler_parameters_from_euler_angles",
    "euler_parameters_from_matrix",
    "euler_parameters_from_modified_rodrigues",
    "euler_parameters_from_rodrigues",
    "euler_parameters_from_rotation_vector",
    "matrix_from_axis_angle",
    "matrix_from_euler_angles",
    "matrix_from_euler_parameters",
    "matrix_from_rotation_vector",
    "modified_rodrigues_from_euler_parameters",
    "multiply_quaternions",
    "normalize_quaternion",
    "rate_matrix",
    "rodrigues_from_euler_parameters",
    "rotation_vector_from_euler_parameters",
    "rotation_vector_from_matrix",
    "turn_vector",
    "velocity_matrix",
]
