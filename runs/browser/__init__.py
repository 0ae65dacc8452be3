"""Reports in the browser: a front or a study as one page of HTML that loads nothing from the network."""
