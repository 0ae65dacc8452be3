"""Data of fronts, and functions of them: tables, files, figures, simulation, verification."""
