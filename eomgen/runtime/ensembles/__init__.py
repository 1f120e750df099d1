"""A Module and many initial values, parameters and inputs -> Ensemble of all their runs.

``given_cases`` says what differs between the runs, ``block`` runs a block of them in compiled code on several threads,
``run_blocks`` reduces blocks and keeps them in a store, ``cluster`` runs them on workers, ``ensemble`` is the result.
"""
