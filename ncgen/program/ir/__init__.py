"""The intermediate representation: operations, straight-line blocks and loops, what is done with them whatever they compute."""
