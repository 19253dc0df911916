"""Code that tests and benchmarks share: simulated suites, subjects, and trackers with wrong states."""
