"""Contact: shapes, where they touch, laws of one pair, groups of shapes, soil; types of force like any other."""

from . import groups, point
from .groups import ContactGroups
from .point import Contact, SpherePlane, SphereSphere
from .shapes import ContactShape

CONTACTS = point.TYPES | groups.TYPES

__all__ = ["CONTACTS", "Contact", "ContactGroups", "ContactShape", "SpherePlane", "SphereSphere"]
