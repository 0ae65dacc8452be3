"""Files, text, consoles and interrupts, independent of the method."""
