"""The studio: a page on this machine where a face is shaped and an avatar is rigged.

Needs ``pip install facegen[studio]``. Nothing else of facegen imports it.
"""
