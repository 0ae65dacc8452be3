"""What can be searched: the contract, optimal control problems and black boxes."""
