"""What methods on elements share: tables of basis functions, one phase, propagation."""
