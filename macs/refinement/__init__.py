"""Points on meshes that simulations confirm: single optima, whole fronts, the mesh of a search, and points that are not verified."""
