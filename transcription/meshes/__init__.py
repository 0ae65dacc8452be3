"""Mesh refinement: errors of a mesh, and the next finer mesh."""
