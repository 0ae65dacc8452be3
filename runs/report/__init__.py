"""Reports on studies: tables, figures, and the report that contains them all."""
