"""How good it is: facts about a mechanism and its kernels, timings, and the screens that show them."""
