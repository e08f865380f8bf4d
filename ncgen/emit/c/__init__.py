"""C99: `spelling` says how programs are written, `files` which files they make."""
