"""Forces that a motion needs: between bodies, of drivers, of motors."""
