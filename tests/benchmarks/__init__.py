"""ncgen next to other people's simulators and generators, and measurements of ncgen itself: begin with bench.py."""
