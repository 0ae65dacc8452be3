"""Numbers about fronts: indicators, what they are measured against, statistics, attainment, convergence. Arrays and Fronts in."""
