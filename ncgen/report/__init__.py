"""What runs say about themselves: facts about a mechanism and its kernels, timings, cards in notebooks, progress."""
