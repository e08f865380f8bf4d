"""How programs are written: a language is a folder."""
