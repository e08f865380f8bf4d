"""Independent routes to the numbers of the kernels: nothing here reads a generated formula."""
