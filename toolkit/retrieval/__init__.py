"""Motion retrieval and annotation of Baak's thesis: features, templates, keyframes, classes, motion priors.

Owns the index, query, class and model files. May import `toolkit.tracking` and the packages below it.
"""
