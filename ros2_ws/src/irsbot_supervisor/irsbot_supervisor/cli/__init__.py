"""The commands of `irsbot`: parse, call, print, exit code. 0 done, 1 a check failed, 2 bad use or input."""
