"""In which box of declared quantities does a skill work, how often at least, and how sure.

`question` says what is asked, `surrogate` and `box` propose a box from trials that were looked at, `claim` fixes what
will be tested before it is tested, `procedure` runs all of it, `certificate` writes and checks what may be signed.
"""
