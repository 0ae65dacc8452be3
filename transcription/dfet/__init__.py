"""Direct Finite Elements in Time."""
