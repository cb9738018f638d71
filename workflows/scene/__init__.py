"""A scene: its tables, their units, and reading it from TOML."""
