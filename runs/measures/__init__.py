"""Measures of fronts, as arrays or Fronts: indicators and their references, statistics, attainment surfaces, convergence."""
