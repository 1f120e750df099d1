"""Stage kinematics: constraint rows -> what the entries of each are compared with where a row is told from nothing.

Entries of the scaled Jacobian are about 1 in a loop of a few links.  In one of a hundred, gaps change by its radius,
thirty times the length of a link, while directions turn as in a small one; loops of one mechanism differ in size, too.
A row tells little where its entries are small beside what they can be:

- those of the three components of a gap that a joint closes, beside the largest of the three rows: the derivative of a
  column a x r by another angle is b x (a x r) or that of the other's column, and neither is longer than its column;
- those of a direction that a joint closes, beside 1, which bounds them and their derivatives;
- others beside the largest entry of all rows, as nothing tells how large they can be.
"""

from __future__ import annotations

from .kinematics import Kinematics

ALL, UNIT = 0, -1  #: compared with all rows, with 1; gaps are numbered from 1
COMPONENTS = ("r_x", "r_y", "r_z")


def row_groups(kinematics: Kinematics) -> tuple[int, ...]:
    """The group of each row (m,)."""
    c, coupled = kinematics.constraints, set(kinematics.coupled)
    declared = {*c.labels, *c.vanishing}
    gaps: dict[str, int] = {}
    found = []
    for label, kind, written in zip(c.labels, c.kinds, c.written, strict=True):
        joint, _, component = label.rpartition(".")
        if written or label in coupled:
            found.append(ALL)
        elif kind != "length":
            found.append(UNIT)
        elif component in COMPONENTS and all(f"{joint}.{other}" in declared for other in COMPONENTS):
            found.append(gaps.setdefault(joint, 1 + len(gaps)))
        else:
            found.append(ALL)
    return tuple(found)


def row_velocities(kinematics: Kinematics) -> tuple[tuple[int, ...], ...]:
    """The velocities that each row and its rate can know (m,), those of a gap together; none where all rows know all.

    The noise of a row near a change point is of the size of these velocities, whatever else moves faster.
    Nonholonomic rows count as knowing all, as their factors depend on coordinates that do not move them.
    """
    c, n = kinematics.constraints, len(kinematics.velocity_names)
    known = [{k for k, entry in enumerate(row) if not entry.is_zero} for row in c.jacobian]
    known[len(c.values) :] = [set(range(n))] * c.nonholonomic
    of_gaps: dict[int, set[int]] = {}
    groups = row_groups(kinematics)
    for group, own in zip(groups, known, strict=True):
        if group > 0:
            of_gaps.setdefault(group, set()).update(own)
    found = [of_gaps[group] if group > 0 else own for group, own in zip(groups, known, strict=True)]
    if kinematics.given_rates or all(len(own) == n for own in found):
        return ()
    return tuple(tuple(sorted(own)) for own in found)
