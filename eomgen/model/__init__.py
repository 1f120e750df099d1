"""What the user says, in Python or in a file -> Mechanism, the frozen value every later stage reads."""

from .description import Description
from .fields import model_schema
from .handles import BodyHandle, JointHandle, MarkerHandle
from .mechanism import Mechanism
from .model import Builder
from .yaml_file import describe_yaml_file

__all__ = [
    "BodyHandle",
    "Builder",
    "Description",
    "JointHandle",
    "MarkerHandle",
    "Mechanism",
    "describe_yaml_file",
    "model_schema",
]
