"""Force elements, soils: published numbers of pressure, sinkage and shear strength, by name.

J. Y. Wong, Theory of Ground Vehicles (4th edition, Wiley, 2008), table 2.3, in SI units; the number in a name is the
moisture content in percent.  Moduli of shear deformation are not in the table: those of dry sand (loose) and of clayey
soil (well compacted clay) are what the same book names for such soils; the others have to be given.
"""

from __future__ import annotations

from typing import NamedTuple

RECOVERY = 0.05  #: (s) in which a plate above the ground forgets its sinkage and shear: far less than it is lifted


class Soil(NamedTuple):
    """Numbers of a soil.

    Attributes
    ----------
    exponent : float
        n of the sinkage.
    cohesive, frictional : float
        k_c (N/m^(n+1)) and k_phi (N/m^(n+2)).
    cohesion : float
        c (Pa).
    angle : float
        phi, angle of internal shearing resistance (degrees).
    shear : float or None
        K, modulus of shear deformation (m).
    """

    exponent: float
    cohesive: float
    frictional: float
    cohesion: float
    angle: float
    shear: float | None = None


SOILS = {
    "dry_sand": Soil(1.1, 0.99e3, 1528.43e3, 1.04e3, 28.0, 0.025),
    "sandy_loam_15": Soil(0.7, 5.27e3, 1515.04e3, 1.72e3, 29.0),
    "sandy_loam_22": Soil(0.2, 2.56e3, 43.12e3, 1.38e3, 38.0),
    "sandy_loam_michigan_11": Soil(0.9, 52.53e3, 1127.97e3, 4.83e3, 20.0),
    "sandy_loam_michigan_23": Soil(0.4, 11.42e3, 808.96e3, 9.65e3, 35.0),
    "sandy_loam_hanamoto_26": Soil(0.3, 2.79e3, 141.11e3, 13.79e3, 22.0),
    "sandy_loam_hanamoto_32": Soil(0.5, 0.77e3, 51.91e3, 5.17e3, 11.0),
    "clayey_soil_38": Soil(0.5, 13.19e3, 692.15e3, 4.14e3, 13.0, 0.006),
    "clayey_soil_55": Soil(0.7, 16.03e3, 1262.53e3, 2.07e3, 10.0),
    "heavy_clay_25": Soil(0.13, 12.70e3, 1555.95e3, 68.95e3, 34.0),
    "heavy_clay_40": Soil(0.11, 1.84e3, 103.27e3, 20.69e3, 6.0),
    "lean_clay_22": Soil(0.2, 16.43e3, 1724.69e3, 68.95e3, 20.0),
    "lean_clay_32": Soil(0.15, 1.52e3, 119.61e3, 13.79e3, 11.0),
    "lete_sand": Soil(0.79, 102e3, 5301e3, 1.3e3, 31.1),
    "upland_sandy_loam_51": Soil(1.10, 74.6e3, 2080e3, 3.3e3, 33.7),
    "rubicon_sandy_loam_43": Soil(0.66, 6.9e3, 752e3, 3.7e3, 29.8),
    "north_gower_clayey_loam_46": Soil(0.73, 41.6e3, 2471e3, 6.1e3, 26.6),
    "grenville_loam_24": Soil(1.01, 0.06e3, 5880e3, 3.1e3, 29.8),
    "snow": Soil(1.6, 4.37e3, 196.72e3, 1.03e3, 19.7),
    "snow_sweden": Soil(1.44, 10.55e3, 66.08e3, 6.0e3, 20.7),
}
