"""Export of tracks: one module per format; `run.py` selects it by suffix."""
