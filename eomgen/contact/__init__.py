"""Contact: shapes, where they touch, laws of one pair, groups of shapes, soil; types of force like any other."""

from ..elements.element_type import TypeTable

CONTACTS = TypeTable(__package__, point="point_plane sphere_plane sphere_sphere", groups="contacts")
