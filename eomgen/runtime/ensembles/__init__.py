"""A Module and many initial values, parameters and inputs -> Ensemble of all their runs.

``varied`` says what differs between the runs, ``block`` runs a block of them in compiled code on several threads,
reduces it and keeps it in a store, ``cluster`` runs blocks on workers, ``ensemble`` is the result.
"""
