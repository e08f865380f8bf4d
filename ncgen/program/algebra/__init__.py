"""Linear algebra as operations: elimination, plans of it, vectors in space."""
