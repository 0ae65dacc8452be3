"""Gradient solves: single solves, multistart, and the polish of archives and fronts."""
