"""Aerocapture with shape and bank profile at once."""
