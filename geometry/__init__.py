"""Part -> mesh: Gmsh scripts, contact grids, measured surfaces."""
