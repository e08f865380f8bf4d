"""What to compute: operations in straight lines and in loops over index tables, for every language the same."""
