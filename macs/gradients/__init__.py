"""Points by derivatives: best of several starts, polish, mesh refinement."""
