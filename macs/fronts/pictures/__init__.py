"""Figures of fronts and flights. matplotlib is imported only where one is drawn."""
