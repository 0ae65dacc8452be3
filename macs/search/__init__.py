"""Multi-Agent Collaborative Search."""
