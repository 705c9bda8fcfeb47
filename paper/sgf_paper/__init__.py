"""Turns the raw scores that `sgf_eval` writes into the tables and figures of the paper."""
