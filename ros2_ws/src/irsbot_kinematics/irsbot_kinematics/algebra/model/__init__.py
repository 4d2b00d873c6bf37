"""Systems of equations with exact values: their engine, texts, polynomials, roots and fibres."""
