"""How wrong a mesh is, and what to do about it."""
