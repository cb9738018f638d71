"""Full -> reduced model: Craig-Bampton and its relatives."""
