"""Welander 1982: a box of ocean with heat and salt that mixes and stops mixing by itself.

``model`` has the model and its cycle, ``results`` the claims, ``figures`` the pictures;
``python -m papers.welander_1982`` runs everything.
"""
