"""A run as it was asked for: checked, with its method, tolerances, signals and start; and what speaks against its result."""
