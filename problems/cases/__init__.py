"""The cases: a module each, or one for several that are alike; a folder where these take more."""
