"""Data sets of others.

Registry with sources, licences and hashes, the data folder, the download.
May import `io` only.
"""
