"""Kuznetsov, Rinaldi & Gragnani 2003: bifurcations of planar Filippov systems, the harvest model.

``model`` has the model and its sliding cycles, ``results`` the claims, ``figures`` the pictures;
``python -m papers.kuznetsov_2003`` runs everything.
"""
