"""Studies on disk: cells, files, stores, locks, and the running of what is missing."""
