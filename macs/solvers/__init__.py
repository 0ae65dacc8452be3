"""What takes a problem and returns a front: the contract of a solver and its run."""
