"""The cases of the thesis, run through ``slideviz compare``, and its numbers beside ours.

It stands beside the package, not in it: who installs slideviz needs no study, and it uses
nothing but the command line, the samples and the plots that every user has.
"""
