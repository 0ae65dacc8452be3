"""Pages in Markdown that keep a report in the project's documentation."""
