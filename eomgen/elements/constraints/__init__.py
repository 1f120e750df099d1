"""Constraint elements: equations between coordinates or markers; :data:`CONSTRAINTS` is the table of their types."""

from ..element_type import TypeTable

CONSTRAINTS = TypeTable(
    __package__,
    constraint="coupling",
    gears="gear rack belt planetary",
    cams="cam cam_contact",
    rolling="rolling knife_edge",
    drivers="driver",
    switching="hold lock",
)
