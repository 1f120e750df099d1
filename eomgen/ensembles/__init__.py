"""A Module and many cases (initial values, parameters, inputs) -> Ensemble of all their runs.

``cases`` says what differs between the runs, ``block`` runs a block of them in compiled code on several threads,
``local`` and ``cluster`` run all blocks, ``store`` keeps finished blocks on disk, ``reductions`` boil blocks down as
they come, ``ensemble`` is the result.
"""
