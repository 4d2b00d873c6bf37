"""The fault campaign: what the supervision must withstand, tried many times and counted. `rows` says what a row is."""
