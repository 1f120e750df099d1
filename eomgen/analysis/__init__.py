"""Analyses of a module: what is worked out from its kernels, one file each.

They stand above runtime and use nothing but errors, numeric and runtime, so that exported packages have them too.
Importing one costs NumPy; SciPy loads inside the calls that need it.
"""
