"""Pictures of the algebraic analysis."""
