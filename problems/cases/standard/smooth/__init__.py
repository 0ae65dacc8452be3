"""Problems with smooth controls, without active constraints along the way."""
