"""Damaged and absurd inputs, and what the commands do with them.

``kinds`` has a table of the kinds of inputs, each with files that are right and the commands that
read them; ``damage`` changes files; ``judge`` runs the commands in a process that may crash, and
says what is wrong; ``minimise`` makes an input small. ``plain_su2`` reads SU2's text by the
plainest means, to notice damage that is accepted silently.
"""
