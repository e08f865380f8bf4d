"""The integrators and formalisms there are, as data: what the C runtime, refusals, help texts and tables are made from."""
