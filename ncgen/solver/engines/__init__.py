"""What carries a run out: the C runtime, or Python."""
