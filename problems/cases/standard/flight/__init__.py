"""Flights with smooth controls, without active constraints along the way."""
