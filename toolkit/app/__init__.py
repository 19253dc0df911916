"""Command line, pipeline and stabilised runs.

From settings and recordings to run folders: the `depthmocap` command, batches, `stabilise`.
May import every package.
"""
