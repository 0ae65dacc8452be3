"""The cases: one file each, or a folder where a case has several."""
