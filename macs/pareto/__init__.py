"""Pure functions of objectives: dominance, directions, the archive."""
