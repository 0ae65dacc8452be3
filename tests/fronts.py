"""How far a front is from the truth, as the tests measure it: objectives as the user sees them, references as curves."""

from runs.measures.indicators import distance_to_curve, inverted_distance, mean_distance

__all__ = ["distance_to_curve", "inverted_distance", "mean_distance"]
