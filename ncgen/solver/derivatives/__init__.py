"""What a motion changes with: parameters, start and inputs."""
