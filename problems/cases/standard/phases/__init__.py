"""Problems of several phases."""
