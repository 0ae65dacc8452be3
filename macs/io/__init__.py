"""Files, text, consoles and interrupts: nothing of the method is in here."""
