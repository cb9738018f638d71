"""Mesh -> M, K, loads: assembly with scikit-fem, contact interface, sparse factorisation, modes."""
