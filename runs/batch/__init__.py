"""Studies on disk: their files, cells and folders, and the running of the runs that are missing."""
