"""One page that can be mailed: film, scene, plots and settings of runs in a single file of HTML."""
