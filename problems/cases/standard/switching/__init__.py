"""Problems with bang-bang controls."""
