"""The kinds of motions: a class for each, behind the protocol of `motion.Motion`."""
