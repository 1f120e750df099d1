"""Stage show: a module and states -> pictures and animations of the mechanism.

:mod:`~..base.picture_data` reads what the metadata says, :mod:`.scene` makes solids and lines of it, :mod:`.plane`
finds the plane of a planar mechanism; :mod:`.flat`, :mod:`.axes_3d` and :mod:`.browser` draw a scene with matplotlib
and k3d.
"""
