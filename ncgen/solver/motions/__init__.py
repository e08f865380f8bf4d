"""The doors to motions: of one state, step by step, and of many."""
