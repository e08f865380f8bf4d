"""Many variants of one simulation: what varies, what is kept, who computes, where it lies, and what it says."""
