"""Benchmarked problems as users of other programs state them."""
