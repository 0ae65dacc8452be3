"""Figures of preferences: rankings, preference functions with a front on them, degrees side by side."""
