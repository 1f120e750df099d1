"""Stage describe: what the user says, in Python or in a file -> Mechanism, the frozen value every later stage reads."""

from .description import Description
from .fields import FORCE as FORCE_FIELDS
from .handles import BodyHandle, JointHandle, MarkerHandle
from .mechanism import Mechanism
from .model import Model
from .schema import model_schema
from .sympy_method import from_sympy
from .yaml_file import load_yaml

__all__ = [
    "FORCE_FIELDS",
    "BodyHandle",
    "Description",
    "JointHandle",
    "MarkerHandle",
    "Mechanism",
    "Model",
    "from_sympy",
    "load_yaml",
    "model_schema",
]
