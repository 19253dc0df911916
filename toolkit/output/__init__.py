"""Files and pictures for people and other programs.

Exports, films and pictures, the report page, pages of validation.
May import `evaluation`, `simulation` and packages below; no tracker is changed here.
"""
