"""C sources that compile in no time: enough for everything that concerns files, keys and compilers."""

TINY = {"tiny.c": '#include "tiny.h"\nint tiny(void) { return TINY; }\n', "tiny.h": "#define TINY 7\nint tiny(void);\n"}
