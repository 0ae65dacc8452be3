"""Plain data from files and from the user: schemas, records with a checksum, addresses of code. Nothing of studies."""
