"""How models come in and go out."""
