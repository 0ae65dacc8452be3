"""Collocation at Gauss, Radau, Lobatto and Chebyshev points."""
