"""`macs serve`: pages that follow files while these change. Nothing is written, and nothing that a file names is run unasked."""
