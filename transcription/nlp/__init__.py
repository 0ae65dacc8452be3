"""Gradient solves of one Pareto point, and the certificate of its optimality."""
