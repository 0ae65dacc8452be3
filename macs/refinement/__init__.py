"""Points on meshes that simulations agree with: single optima, whole fronts, the mesh of a search, and points that miss."""
