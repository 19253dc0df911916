"""Report page: film, 3-D view, plots and settings of runs in a single HTML file."""
