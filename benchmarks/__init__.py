"""One script per figure; each prints it and stores it as JSON with machine, commit and settings."""
