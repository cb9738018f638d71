"""Beside a measurement: what was measured is read, and stands beside what a scene computes."""
