"""The motion of a mechanism as programs: accelerations, loads, steps, outputs."""
