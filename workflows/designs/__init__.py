"""Studies of many runs: what a file varies, the runs of its design, running them, and one table of what came out."""
