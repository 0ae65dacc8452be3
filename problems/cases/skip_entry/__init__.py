"""Skip entries: a winged vehicle with an engine dips into the air and leaves it again."""
