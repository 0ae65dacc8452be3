"""How runs are made: a run in a process, the processes, whoever else makes them, and what is told meanwhile."""
