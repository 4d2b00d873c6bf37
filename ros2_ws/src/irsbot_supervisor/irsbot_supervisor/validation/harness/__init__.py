"""Parts that campaigns share: rows, runner, oracle, test client, input stream."""
