"""What may be claimed from trials: which policy is better, and in which box a skill works at least so often.

`trials` reads anybody's table, `compare` judges every pair of policies, `letters` says which are not told apart.
`question` says what is asked of a skill, `surrogate` guesses from trials that were looked at where it works (with
`laplace` and `propagation`), `box` proposes a box there, `claim` fixes what will be tested before it is tested,
`procedure` runs all of it, `certificate` writes and checks what may be signed.
"""
