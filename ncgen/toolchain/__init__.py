"""How sources become functions: compilers, the cache, the loader."""
