"""How a mechanism looks: the scene, still figures and time histories, and a player in one HTML file."""
