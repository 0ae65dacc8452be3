"""Fronts as data, and functions of them: tables, files, pictures, verification."""
