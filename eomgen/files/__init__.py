"""Files: results -> written whole or not at all; what was kept -> loaded only if no other user could have written it.

``reading``: plain files that a user names.  ``writing``: files of results.  ``ownership``: who can write a file.
``entry``: a published build and its seal.  ``source``: Python text -> module, without bytecode on the disk.
"""
