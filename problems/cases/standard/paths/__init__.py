"""Problems with active state or mixed constraints along the way."""
