"""What the user says, in Python or in a file -> Mechanism, the frozen value every later stage reads."""

from .fields import model_schema
from .yaml_file import describe_yaml_file

__all__ = ["describe_yaml_file", "model_schema"]
