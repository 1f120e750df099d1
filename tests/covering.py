"""A few examples that stand for all in sweeps over methods, variants and checks; ``make thorough`` takes all."""

from __future__ import annotations

#: Together they have every type of element and every section of a model file that any example has.
COVERING = (
    "slider_crank",
    "cam_follower",
    "stewart_platform",
    "wheelset",
    "planetary_gear",
    "bicycle",
    "hydraulic_boom",
    "gait_leg",
    "flyball_governor",
    "satellite",
    "gear_train",
    "rimless_wheel",
    "double_wishbone",
)
