"""Evaluators, which a search calls: the contract, optimal control problems and black boxes."""
