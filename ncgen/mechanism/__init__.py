"""What a user calls: kernels of one mechanism, in C or NumPy, for one state or many, and runs in C."""
