"""Batches and ensembles of a model on a GPU; text of device code and arrays -> results."""
