"""Stage verification, variants: a model -> findings on variants, the same mechanism described differently.

Body frames and ground turned and shifted, other units, names, order, cuts, joints, rotations, methods, targets, ways to
give parameters, inputs and states: none of them may change a result by more than rounding.
"""

from .findings import CHANGES, variant_findings
from .variant import NotApplicable, Variant

__all__ = ["CHANGES", "NotApplicable", "Variant", "variant_findings"]
