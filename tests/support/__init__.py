"""What tests and benchmarks share: simulated suites, subjects, and trackers misled on purpose."""
