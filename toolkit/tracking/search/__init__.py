"""Sources of pose hypotheses: one protocol, one module for each search (Baak 2013, 5.4.1 and 5.4.3)."""

from toolkit.tracking.search.search_protocol import Hypothesis, Proposal, ScoredHypothesis, Search

__all__ = ["Hypothesis", "Proposal", "ScoredHypothesis", "Search"]
