"""Where a mechanism can be: positions that close it, how free it is there, which coordinates determine the others."""
