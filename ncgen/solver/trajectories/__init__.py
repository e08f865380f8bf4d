"""What a run found: a trajectory, its energy, outputs and health, and how it differs from another."""
