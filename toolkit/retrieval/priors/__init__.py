"""Tracks stabilised by what retrieval finds in them (thesis, Chapter 6): above the tracker and above retrieval."""
