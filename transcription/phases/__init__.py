"""One phase, as far as all methods share it."""
