"""The design space of the IRSBot-2: lengths, distal conditions, singular postures."""
