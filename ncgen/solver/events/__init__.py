"""Events of a run: conditions, actions, the law of impact, and the loop from one event to the next."""
