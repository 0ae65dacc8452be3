"""Trajectories, and their check by independent integration."""
