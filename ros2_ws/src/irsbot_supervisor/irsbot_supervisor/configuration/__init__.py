"""Settings from files and parameters, feasibility checks, the proposal of limits."""
