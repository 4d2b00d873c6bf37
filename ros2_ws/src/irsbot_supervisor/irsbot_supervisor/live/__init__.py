"""A running suite as a page that a browser shows live. It only listens, and nobody waits for it."""
