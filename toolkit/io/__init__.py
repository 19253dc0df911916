"""Files and plain values: safe opening, archives, YAML and JSON, checkpoints, errors, progress, worker processes.

Owns every access to the disk. Imports no other package of `toolkit`.
"""
