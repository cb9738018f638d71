"""One self-contained page for a result, or for several side by side."""
