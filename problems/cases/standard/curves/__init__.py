"""Classical problems of the best curve."""
