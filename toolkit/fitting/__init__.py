"""Local optimisation of a pose (Baak 2013, 5.4.1).

Correspondences, residual terms, priors, the solver, the objective that compares a pose with a frame.
May import `database`, `landmarks` and packages below.
"""
