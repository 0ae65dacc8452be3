"""`python -m runs.truths CASE`: compute the reference front of a case again."""

from .reentry import main

main()
