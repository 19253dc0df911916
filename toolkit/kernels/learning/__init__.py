"""Compiled loops of what is learnt from poses."""
