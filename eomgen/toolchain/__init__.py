"""Compilation: source texts -> a cached library of one model, opened by the extension module that all models share.

::

    sources -> compiler: flags -> cache: key -> there? -> load: native.Model
                                             |  no
                                             v
                      build: private attempt directory: compile, link, manifest, published by one rename
"""
