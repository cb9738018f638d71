"""What a run leaves behind: its types, the HDF5 file, the summary."""
