"""Gradient solves: best of several starts, polish of archives and fronts, mesh refinement."""
