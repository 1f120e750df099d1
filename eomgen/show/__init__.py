"""A module and states -> pictures and animations of the mechanism.

:mod:`~..base.picture_data` reads what the metadata says, :mod:`.scene` makes solids and lines of it and finds the plane
of a planar mechanism; :mod:`.axes` and :mod:`.page` draw a scene with matplotlib, or as a page.
"""
