"""Re-entry of a shuttle: the vehicle, the statement that the cases share, the cases, their fronts and pictures."""
