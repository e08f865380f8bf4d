"""A mechanism over the rates of its joints: what robotics calls the basics."""
