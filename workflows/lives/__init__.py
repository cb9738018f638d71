"""A number of a scene as a distribution: a surrogate of the runs of a study, its quantiles, and what they depend on."""
