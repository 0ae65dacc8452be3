"""Figures of trajectories, and the style of all figures. matplotlib is imported only where one is drawn."""
