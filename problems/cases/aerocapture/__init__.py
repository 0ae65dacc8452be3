"""Aerocapture at Mars: the shape of the capsule, its heat shield and its way through the air."""
