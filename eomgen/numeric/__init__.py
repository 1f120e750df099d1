"""Stage numeric: constraints and mass matrix of a state -> projected states, accelerations, assembled loops.

The algorithms of closed loops in NumPy.  They are the reference for the C templates, drive the ``numpy`` target, serve
the mobility analysis when a model is derived and the assembly at run time.  All of them work on scaled quantities
(:class:`~.scales.Scales`), so that metres or millimetres make no difference.
"""
