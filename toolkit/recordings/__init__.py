"""Files of depth cameras.

Readers by format, options of readers, opening with plausibility checks, the writer.
May import `people`, `sensing` and packages below.
"""
