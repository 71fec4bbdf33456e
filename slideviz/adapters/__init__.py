"""Adapters: the deformer by the names of OpenMDAO and MPhys, and of IDWarp."""
