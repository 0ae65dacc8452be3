"""Gradient solves: single ones, the best of several starts, the polish of archives and of fronts."""
