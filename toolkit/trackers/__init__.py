"""The trackers by name: `hybrid`, `baak2013`, `lopez2011`, `qammaz`.

Settings and assembly of searches, observers and verifiers, one subpackage for each paper.
May import `retrieval`, `tracking` and packages below.
"""
