"""Reference fronts, made by long computations."""
