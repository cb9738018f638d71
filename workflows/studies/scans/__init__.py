"""Scans of worn faces: what wore, and the wear coefficient."""
