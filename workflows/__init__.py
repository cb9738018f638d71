"""Scene -> result: TOML scenes, pipeline, HDF5 store, plots, renders, studies, the command."""
