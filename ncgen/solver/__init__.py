"""How a mechanism moves: positions, velocities, accelerations, forces and simulations on any kernels."""
