"""The linear side: compliance of the structure at its contacts, harmonic by harmonic, and the way back to the part."""
