"""Reports in the browser: a front or a study as one page of HTML, and a server that shows a study while it runs."""
