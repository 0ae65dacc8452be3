"""Ratios against the alternatives, measured side by side in one run: inner levels in `inner`, on the batches of `cases`; searches in
`search`, batches of them in `study`."""

from .command import KINDS, bench

__all__ = ["KINDS", "bench"]
