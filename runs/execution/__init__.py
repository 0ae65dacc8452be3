"""Processes that make runs: a run in a process, the processes of this machine and of executors, and the samples of a run."""
