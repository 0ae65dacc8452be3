"""Problems with bang-bang or singular controls."""
