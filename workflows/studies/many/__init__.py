"""Many runs of one scene: grids, life distributions, optima."""
