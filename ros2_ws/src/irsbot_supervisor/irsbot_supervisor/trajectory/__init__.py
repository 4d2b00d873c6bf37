"""Joint paths, and certificates that a planned motion keeps its limits."""
