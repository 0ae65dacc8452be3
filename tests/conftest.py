"""What all tests share."""

from hypothesis import settings

# How long an example takes says nothing of what it does: machines are noisy.
settings.register_profile("macs", deadline=None)
settings.load_profile("macs")
