"""`python -m runs.truths CASE`: the reference front of a case, made anew."""

from .reentry import main

main()
