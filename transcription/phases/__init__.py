"""What every method shares about one phase."""
