"""Wear: the wear rate of a cycle, the rules that step through cycles, and the history they leave."""
