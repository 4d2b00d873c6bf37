"""Analysis of mechanisms for their designers: workspace maps, force workspaces, loops, planar indices."""
