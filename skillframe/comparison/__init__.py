"""Which of several policies is better, from anybody's table of trials.

`read_trials` reads the table, `compare` judges every pair, `letters` says which policies are not told apart.
"""
