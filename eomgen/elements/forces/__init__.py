"""Force elements: geometry (a path or a marker) times a law; :data:`FORCES` is the table of their types."""

from ..element_type import TypeTable

FORCES = TypeTable(
    __package__,
    springs="force torque actuator spring damper torsional_spring torsional_damper joint_spring joint_damper "
    "element torsional_element bushing point_gravity",
    friction="friction",
    normal_laws="stop",
    muscle="muscle",
    wheels="creep tyre",
)
