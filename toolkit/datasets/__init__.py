"""Data sets of others: their registry, the folder that holds them, and the download."""
