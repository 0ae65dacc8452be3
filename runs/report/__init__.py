"""What is made of a study: tables, figures, and the report that has them all."""
