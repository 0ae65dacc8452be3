"""Points of a front under other data than those that they were found with: those of another problem, or dispersed ones."""
